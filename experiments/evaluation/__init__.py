"""Methods against the truth on samples of a dataset; ``evaluate`` is the command.

``listing``, ``shard_rows`` and ``samples`` find and read them, ``sample_evaluation`` takes one through all methods;
``scores``, ``sureness``, ``tours`` and ``cost`` measure. ``summary``, ``statistics`` and ``numbers`` say it together;
``report`` with ``tables``, ``curves``, ``cases`` and ``page`` shows it, in a ``claimed_folder``. ``config`` has the
options.
"""
