"""The seeded generator of offices and schools."""
