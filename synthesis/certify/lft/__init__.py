"""The classical LFT tests: arbitrarily fast parameters, one constant P and a multiplier."""
