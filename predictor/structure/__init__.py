"""What a grid shows: clutter, wall faces, directions, thickness, edges, doorways, door proposals, ROSE."""
