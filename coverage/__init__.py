"""Topological graph, coverage tour and cost estimates (paper, section 5)."""
