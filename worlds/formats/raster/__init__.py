"""A map of cells read as a floor plan: ``rosmap`` reads the file.

``raster_rooms`` finds rooms and doors in the cells, ``raster_walls`` turns occupied cells into pieces of wall.
"""
