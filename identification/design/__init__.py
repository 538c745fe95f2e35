"""Design of experiments: what a record determines, and which experiment is most informative."""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
