"""Decisions on the estimated map: where to look next, how to drive there, and how to follow a coverage tour.

- ``control_loop``: sense, map, decide, move. A ``decider`` is the ``explorer`` or the tour follower in ``tour/``.
- Exploring: ``frontiers``, ``goal_search``. Driving, which both do: ``driving/``.
- ``config``: settings of all of these; the robot itself is ``core.robot``.
"""
