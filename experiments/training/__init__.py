"""What the methods of prediction are fitted on, what they are chosen by, and what is reported (never both).

``buildings`` says which building is used for what. ``train`` is the command and ``config`` its options. ``examples``
makes patches and true rooms of samples, ``batches`` mirrors and disturbs them, ``trainer`` fits the ``network``;
``export`` writes it as ONNX, with its ``model_card`` and the ``learning_curves``. ``synthetic_maps`` draws maps with
closed doors straight from floor plans.
"""
