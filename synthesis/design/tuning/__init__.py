"""Descent on the largest gain of many loops at once."""
