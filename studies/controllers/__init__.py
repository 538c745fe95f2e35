"""Controllers designed, certified and simulated along the transition."""
