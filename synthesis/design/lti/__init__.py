"""Controllers of one linear model: H-infinity, H2, mixed sensitivity and loop shaping."""
