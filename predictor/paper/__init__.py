"""The method of the paper, sections 3.1 to 3.7, a file a step; ``method`` calls them in this order.

- 3.1: ``segments``, ``directions``, ``lines`` (``wall_lines`` by Hough or ROSE), ``arrangement``, ``unknown_faces``.
- 3.2: ``initial_faces``: the face behind each door; with 3.1 put together in ``initial_layouts``.
- 3.3, 3.4: ``expansion``: rooms grow jointly; ``subsets`` of faces, scored by ``layout_score``.
- 3.5: ``face_swaps``.
- 3.6, 3.7: ``border``, ``finished_rooms``: layouts become rooms.
- ``trace``: what a recording shows of it.
"""
