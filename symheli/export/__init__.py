"""The model for other programs: C99 source, MATLAB files; and the controller that flies it."""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
