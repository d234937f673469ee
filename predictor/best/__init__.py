"""The method ``best``: rectangles between wall faces, chosen jointly by their evidence; ``method`` calls the steps.

- ``scene``: the map along its walls, the doors' poses (``door_pose``, ``door_frame``), in cells of one ``resolution``.
- ``hypotheses``: rectangles (``candidates``) scored by ``features`` of ``rectangles`` and the ``evidence`` of their
  sides; a ``feature`` is a measure with its weight.
- ``selection``: all rooms together, by ``pair_features``; ``shared_rooms`` of several doors.
- ``room_shape``: from rectangles to rooms.
- ``rectangle_belief``: where each room may be, for its confidence; ``trace``: what was seen and weighed, to be drawn.
"""
