"""Estimators, to be given to `fit(..., method=)` with their settings."""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
