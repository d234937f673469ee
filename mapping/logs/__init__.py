"""Recorded runs in the formats of robots."""
