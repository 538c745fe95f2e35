"""Less frequent tools of linear and LPV models: plots, delays, feedback of a block, nu-gaps."""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
