"""The recording of a run for the rerun viewer; the only rooms that import rerun."""
