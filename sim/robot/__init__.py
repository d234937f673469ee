"""The simulated robot: how it drives.

A ``driven_robot`` is a disc (``differential_drive``) or a body on wheels (``wheeled_robot``) after a ``robot_model``:
ours, or a user's own (``robot_urdf``), of which ``urdf_description`` is checked, ``urdf_joints`` are read and
``drive_calibration`` finds out what its wheels do.
"""
