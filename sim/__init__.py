"""The simulated world and its robot: ``simulation`` takes commands and gives observations.

- The building: ``physics_world`` is PyBullet behind an interface, ``building`` puts a plan into it; ``doors`` move
  their ``door_leaves``.
- The robot, whose radius and speeds are ``core.robot``: a disc (``differential_drive``, ``contacts``) or a body on
  wheels (``wheeled_robot``; ``robot_model`` is ours, ``robot_urdf`` a user's own).
- What it senses: ``lidar`` and ``odometry``; their noise is in ``config``.
- What disturbs it: ``glass``, ``bystanders`` (people and things that move), ``faults``.
"""
