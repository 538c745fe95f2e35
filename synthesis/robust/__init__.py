"""Several uncertain things at once: real parameters, and dynamics of bounded gain."""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
