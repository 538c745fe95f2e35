"""Gain against acceleration and jerk: `python -m evidence.jerk`."""
