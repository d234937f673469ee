"""How the robot moved.

From one scan to the next by its odometry (``motion_prediction``; ``uncertain_motion`` is how far to trust that) or by
the scans alone (``scan_odometry``), and while a sweep was taken (``sweep_motion``).
"""
