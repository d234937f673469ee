"""From a map and its closed doors to the rooms behind them (paper, sections 3 and 4)."""
