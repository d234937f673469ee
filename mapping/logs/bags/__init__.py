"""Rosbags, versions 1 and 2, and MCAP.

``rosbag`` reads runs and ``clicked_points`` doors: ``bag_messages`` within ``bag_limits``, by a user's ``bag_options``;
frames by a ``transform_tree``, sweeps by ``bag_scans``. ``bag_writer`` writes what a simulated robot sensed.
"""
