"""What the formats share that list rooms but no walls (Luperto, KTH, HouseExpo, pyrobosim).

``room_outlines`` repairs outlines and fits them to each other, ``door_stretches`` straightens them where doors stand,
``portals`` makes walls, doors and openings, ``hallways`` turns passages between distant rooms into rooms or doors.
"""
