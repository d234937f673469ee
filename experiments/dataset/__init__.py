"""Ground-truth datasets: maps with some doors closed, and what is really behind them."""
