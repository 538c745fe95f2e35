"""Gain against acceleration and jerk: `python -m studies.jerk`."""
