"""Regions of attraction of polynomial systems by sums of squares, checked exactly."""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
