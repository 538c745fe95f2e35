"""The worth of a model: comparisons, uncertainty, stability, dependence."""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
