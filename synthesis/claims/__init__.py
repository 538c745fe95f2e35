"""Proofs that somebody else computed: a plant and a P, K or V, and whether it proves what it says,
in exact arithmetic.
"""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
