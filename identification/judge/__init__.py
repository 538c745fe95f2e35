"""What a model is worth: comparisons, uncertainty, stability, dependence."""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
