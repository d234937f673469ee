"""Runs every stage: explore, run, record, evaluate, and the command line."""
