"""What a grid shows, for every method.

- The part that is known: ``known_window``; without furniture: ``clutter``.
- Walls: ``edges``, ``wall_directions``, ``wall_faces``, ``wall_thickness``; ``rose`` with ``peaks`` and
  ``fourier`` (section 4.2).
- Doors: ``doorways`` (the opening of a door that is given), ``door_proposals`` (doors that nobody gave) with
  ``window_rows`` and ``door_proposal_config``.
"""
