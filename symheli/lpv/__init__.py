"""Linear, LPV and LFT models: pure NumPy, no physics, no solver.

The examples of this package start from a spring that stiffens with p:

>>> import numpy as np
>>> import symheli
>>> from symheli import lpv
>>> spring = symheli.LPVStateSpace.polynomial(
...     A=[[[0.0, 1.0], [-2.0, -1.0]], [[0.0, 0.0], [-0.5, 0.0]]],
...     B=[[[0.0], [1.0]]],
...     C=[[[1.0, 0.0]]],
...     D=[[[0.0]]],
...     scheduling=symheli.Scheduling("p", "1", low=0.0, high=1.0),
... )
"""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
