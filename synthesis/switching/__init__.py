"""Linear control that switches between designs: its dwell times, and the controller that flies."""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
