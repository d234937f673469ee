"""Decisions on the estimated map: where to look next, how to drive there, and how to follow a coverage tour.

- ``control_loop``: sense, map, decide, move. A ``decider`` is an ``explorer`` or a ``tour_follower``.
- Exploring: ``frontiers``, ``goal_search``.
- Driving: ``costmap``, ``planner``, ``path_follower``, ``driver``, ``path_check``, ``path_back``, ``met_obstacles``.
- Following a tour: ``opened_doors``, ``prediction_monitor``, ``revised_prediction``, ``remaining_tour``.
- ``config``: settings of all of these; the robot itself is ``core.robot``.
"""
