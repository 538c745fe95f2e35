"""Linear time-invariant models: H-infinity norm, balancing of matrices."""
