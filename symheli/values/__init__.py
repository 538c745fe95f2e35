"""Names, units and arrays: the values that every room shares."""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
