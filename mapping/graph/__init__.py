"""The pose graph over the scans that make the map.

``keyframe`` is such a scan, ``keyframe_graph`` holds them with the edges between them, ``loop_closure`` finds edges to
places that were seen before, ``pose_graph`` optimises the poses by ``normal_equations``.
"""
