"""The simulated world and its robot: ``simulation`` takes commands and gives observations.

- The building: ``physics_world`` is PyBullet behind an interface (imported by ``pybullet_process``), ``solids`` go into
  it, ``building`` puts a plan there; ``doors`` move their ``door_leaves``.
- The robot, whose radius and speeds are ``core.robot``: ``robot/`` drives it, ``contacts`` are what it touches.
- What it senses: ``lidar`` and ``odometry``; their noise is in ``config``.
- What disturbs it: ``glass``, ``bystanders`` (people and things that move), ``faults``.
"""
