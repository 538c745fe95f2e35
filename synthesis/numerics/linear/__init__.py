"""Linear time-invariant models: H-infinity norm, Riccati equations, balancing of matrices."""
