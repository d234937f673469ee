"""From a topological graph to a coverage tour (paper, section 5): ``tour_planner`` is where to begin.

- Blocks and tours: ``biconnected``, ``exact_tour``, ``routing``, ``local_search``, ``lower_bound``, ``coverage_tour``.
- For robots and files: ``drivable_path``, ``ros_tour``, ``tour_features``.
"""
