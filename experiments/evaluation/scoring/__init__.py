"""One sample through all methods (``sample_evaluation``) and what is measured then.

``timed_prediction`` predicts, ``hidden_space`` and ``scores`` measure rooms and areas, ``sureness`` how far a method is
right about its own certainty, ``tours`` the coverage tours and ``cost`` the distribution of their cost. ``kept_scores``
tells what an earlier evaluation has done already.
"""
