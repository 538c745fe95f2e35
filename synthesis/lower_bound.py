"""Bad scheduling trajectories: a gain that no certificate may undercut."""
from __future__ import annotations
from dataclasses import dataclass
from typing import NamedTuple
from synthesis.certificate import Trajectory
from synthesis.frozen import FrozenGain, frozen_gain


@dataclass(frozen=True)
class Search:
    """x."""


class LowerBound(NamedTuple):
    """x."""
    gamma: float
    trajectory: Trajectory | None


def lower_bound(lpv, rate, *, frozen=None, search=None) -> LowerBound:
    """x."""
    frozen = frozen or frozen_gain(lpv)
    return LowerBound(frozen.gamma, None)
