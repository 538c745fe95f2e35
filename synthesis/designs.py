"""Designs beside those at the top: LFT and loop-shaping controllers, coefficient diagrams."""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
