"""Driving to one place: ``planner`` on a ``costmap``, ``path_follower`` and ``driver`` along the path.

``path_check`` says whether the path is still free, ``path_back`` is the way the robot came, ``met_obstacles`` are those
that it touched but does not see.
"""
