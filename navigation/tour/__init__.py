"""Following a tour through opened doors: ``tour_follower`` over the stops of a ``remaining_tour``.

``opened_doors`` are wiped from the map, ``prediction_monitor`` holds it against the prediction, and
``revised_prediction`` is what follows.
"""
