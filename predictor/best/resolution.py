"""The cells that the evidence of the method ``best`` is counted in."""

# Cell size [m]: that of the authors' maps, on which the weights were found.
RESOLUTION = 0.05


def in_cells(metres: float) -> int:
    """Convert a length [m] to the nearest whole number of cells."""
    return round(metres / RESOLUTION)
