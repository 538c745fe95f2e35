"""Guarantees for LPV models: certified gains and stability, each with a proof that is verified
after the solver.

No solver is loaded by importing this package.

The examples of the designs start from a lag that grows unstable with p, disturbed by w and measured
with noise:

>>> import synthesis
>>> from symheli import LPVStateSpace, Scheduling
>>> lag = LPVStateSpace.polynomial(
...     A=[[[-1.0]], [[2.0]]],
...     B=[[[1.0, 0.0, 1.0]]],
...     C=[[[1.0], [0.0], [1.0]]],
...     D=[[[0, 0, 0], [0, 0, 1.0], [0, 0.1, 0]]],
...     scheduling=Scheduling("p", "1", 0.0, 1.0, rate=0.5),
...     states=["x"],
...     inputs=["w", "noise", "u"],
...     outputs=["z_x", "z_u", "y"],
... )
>>> plant = synthesis.Plant(
...     lag,
...     disturbances=["w", "noise"],
...     performance=["z_x", "z_u"],
...     controls=["u"],
...     measurements=["y"],
... )
"""

from symheli.lazy import lazily

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
