"""Ground-truth datasets, evaluation, robustness, and the workers that they share."""
