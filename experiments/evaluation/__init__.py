"""Methods against the truth on samples of a dataset; ``evaluate`` is the command.

``listing`` and ``samples`` find and read them, ``sample_evaluation`` takes one through all methods, ``scores`` and
``tours`` measure. ``summary``, ``statistics`` and ``numbers`` say it together; ``report`` with ``tables``, ``curves``,
``cases`` and ``page`` shows it, in a ``claimed_folder``.
"""
