"""The seeded generator of offices and schools; ``generator`` is its door, ``bundled`` the 20 that come with us.

Steps: ``corridors``, ``room_programme``, ``sketch``, ``construction`` of walls and doors, ``furniture``.
"""
