"""The simulated world and its robot: ``simulation`` takes commands and gives observations.

``physics_world`` is PyBullet behind an interface, ``building`` puts a plan into it, ``door_leaves`` move.
``differential_drive`` and ``contacts`` move the robot (its radius and speeds are ``core.robot``), ``lidar`` and
``odometry`` are what it senses, ``config`` its noise.
"""
