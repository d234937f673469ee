"""Ground-truth datasets: maps with some doors closed, and what is really behind them; ``dataset`` makes one.

``variants`` says which samples there are, ``sample`` makes one: explored, or redrawn (``erase``, ``rays``) from an
``open_survey`` that ``survey_store`` keeps. ``layout``, ``dataset_card`` and ``checksums`` are what stands around
samples. Of shards ``shard_plan`` says which sample goes where, ``shard_jobs`` is what workers do,
``sharded_dataset`` the whole.
"""
