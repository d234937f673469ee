"""How sure a prediction is: expected IoU of its rooms, what else they could be, and each cell's probability.

- ``judge``: beliefs about the rooms become their confidence; calls the others.
- ``belief``: what is thought of one room.
- ``outside``: whether a door leads outside and there is none.
- ``shape_variants``: the same for a room of which only shape and kind are known.
- ``room_features``: figures of a room; ``calibration``: from figures to an expected IoU, by method.
"""
