"""Whether a V is a proof: recomputed from the model and V alone, in floating point and exactly."""
