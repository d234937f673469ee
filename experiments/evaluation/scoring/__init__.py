"""One sample through all methods (``sample_evaluation``) and what is measured then.

``scores`` of rooms and areas, their ``sureness``, coverage ``tours`` and the distribution of their ``cost``.
"""
