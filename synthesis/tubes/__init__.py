"""Invariant tubes: sets that a nonlinear helicopter, or any other model, does not leave, whatever
the gusts.
"""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
