"""The specification sheet: required values, and what controllers reach of them over a parameter."""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
