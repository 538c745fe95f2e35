"""Controllers designed, certified and flown along the transition."""
