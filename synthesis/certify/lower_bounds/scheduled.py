"""Interface of a model to the search for worst trajectories."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from symheli.lpv import Matrices, Scheduling


class Scheduled(Protocol):
    """A linear model whose matrices depend on one parameter: an LPVStateSpace, or an LFT of one
    parameter.
    """

    @property
    def scheduling(self) -> Scheduling:
        """The parameter: its range, rate and unit."""
        ...

    @property
    def states(self) -> Sequence[object]:
        """Names of the states."""
        ...

    @property
    def dt(self) -> float | None:
        """Sample time in s, None in continuous time."""
        ...

    def matrices(self, p: object, /) -> Matrices:
        """A, B, C, D at p, whose axes come first."""
        ...
