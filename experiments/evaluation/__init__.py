"""Methods against the truth on samples of a dataset: scores, tables, pictures."""
