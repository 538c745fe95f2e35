"""The classical LFT tests: parameters as fast as they like, one constant P and a multiplier."""
