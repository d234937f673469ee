"""The method ``learned``: the rectangles of ``best``, rated by a network that was trained on true rooms.

Training stands in ``experiments/training/`` and needs torch; predicting needs OpenCV alone.
"""
