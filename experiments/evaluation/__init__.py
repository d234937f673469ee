"""Methods against the truth on samples of a dataset; ``evaluate`` is the command, ``config`` has its options.

``samples/`` finds and reads them, ``scoring/`` takes each through all methods, ``reporting/`` says it together.
"""
