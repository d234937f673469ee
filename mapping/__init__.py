"""The mapper: log-odds grid, scan matching, keyframes, closed doors, frontiers and paths."""
