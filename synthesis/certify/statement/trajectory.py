"""A path of the scheduling parameters."""

from __future__ import annotations

from typing import NamedTuple

from symheli.values.arrays import Array
from symheli.values.summary import summarized


class SchedulingTrajectory(NamedTuple):
    """Trajectory of the scheduling parameters: `time` (n,) in s, `p` (n,), straight lines between
    them; a jump has one time twice.

    Discrete time: one p for every sample. A cycle is to be repeated. Several parameters: `p` (n,
    m).
    """

    time: Array
    p: Array

    __repr__ = summarized
