"""Samples on disk: ``listing`` finds where they are (``sample_path``, ``shard_rows``), ``sample_reader`` reads one."""
