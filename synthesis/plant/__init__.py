"""Design plants: their channels and weights, what closes them, and why one has no controller."""
