"""Invariant sets of LPV models within limits of states and controls, proven between the scheduling
points, and a governor that keeps any command inside.
"""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
