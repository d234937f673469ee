"""How sure a prediction is: expected IoU of its rooms, what else they could be, and each cell's probability."""
