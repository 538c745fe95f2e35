"""Questions beside those at the top: gain against rate, open loops, attitude bandwidth."""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
