"""Certified gains, stability and decay rates of a model: from the problem to its certificate."""
