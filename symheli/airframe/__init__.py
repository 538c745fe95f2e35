"""The vehicle file: quantities, units, sources; models identified elsewhere."""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
