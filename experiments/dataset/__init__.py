"""Ground-truth datasets: maps with some doors closed, and what is really behind them; ``dataset`` makes one.

``variants`` says which samples there are, ``sample`` makes one: explored, or redrawn (``erase``, ``rays``) from an
``open_survey`` that ``survey_store`` keeps. ``layout``, ``dataset_card`` and ``checksums`` are what stands around
samples.
"""
