"""The words every stage shares (poses, grids, scans, doors, rooms, errors) and the files they are kept in."""
