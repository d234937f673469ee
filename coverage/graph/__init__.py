"""From a map to its topological graph (paper, section 5): ``graph_builder`` is where to begin.

- Cells: ``free_space``, ``reachable_space``, ``skeleton``.
- Vertices and edges: ``graph_draft``, ``vertex_merging``, ``line_of_sight``, ``grid_path``, ``topological_graph``.
"""
