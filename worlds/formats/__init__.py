"""Floor plans in the formats of others and in our own, a file a format."""
