"""How mapping noise moves the prediction: sweeps over its sources, one at a time and together."""
