"""Controllers of a given structure: named gains, found by descent on the largest closed-loop
gain.
"""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
