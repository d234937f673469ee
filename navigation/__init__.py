"""Decisions on the estimated map: where to look next, how to drive there, and how to follow a coverage tour."""
