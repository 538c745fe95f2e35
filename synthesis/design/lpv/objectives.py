"""Objectives of a closed loop: gains of some of its channels, and a region for its poles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from symheli.errors import InputError


@dataclass(frozen=True, kw_only=True)
class _Channel:
    """A bound on the gain from some disturbances to some of the performance.

    Parameters
    ----------
    disturbances, performance : sequence of str, optional
        Names of the plant's; all by default.
    bound : float, optional
        Never exceeded: a hard bound.
    weight : float
        Of the gain in the sum that is minimised; 0 for a hard bound alone.
    """

    disturbances: Sequence[str] | None = None
    performance: Sequence[str] | None = None
    bound: float | None = None
    weight: float | None = None

    def __post_init__(self) -> None:
        if self.bound is not None and not 0 < self.bound < math.inf:
            raise InputError(f"bound: expected a finite number > 0, got {self.bound!r}")
        if self.weight is not None and not 0 <= self.weight < math.inf:
            raise InputError(f"weight: expected a finite number >= 0, got {self.weight!r}")

    @property
    def soft(self) -> float:
        """The weight; 1 where neither weight nor bound is given, 0 beside a bound."""
        if self.weight is not None:
            return self.weight
        return 1.0 if self.bound is None else 0.0


@dataclass(frozen=True, kw_only=True)
class L2(_Channel):
    """The induced L2 gain (for frozen p the H-infinity norm).

    Examples
    --------
    >>> L2(bound=2.0).soft
    0.0
    """


@dataclass(frozen=True, kw_only=True)
class H2(_Channel):
    """The H2 norm: the root of the output's variance in white noise of unit intensity; there must
    be no feedthrough from these disturbances to this performance.

    Examples
    --------
    >>> H2().soft
    1.0
    """


@dataclass(frozen=True, kw_only=True)
class EnergyToPeak(_Channel):
    """The generalized H2 norm: the largest Euclidean norm of the output at any time, for a
    disturbance of unit energy; there must be no feedthrough.

    Examples
    --------
    >>> EnergyToPeak(weight=0.5).soft
    0.5
    """


@dataclass(frozen=True, kw_only=True)
class PoleRegion:
    """A region for the poles of every frozen closed loop (continuous time).

    Parameters
    ----------
    decay : float
        Real parts at most -decay, 1/s.
    radius : float
        Moduli at most so, rad/s.
    damping : float
        Damping ratios at least so, below 1.

    Raises
    ------
    InputError
        For a number out of range.

    References
    ----------
    Chilali and Gahinet, IEEE Trans. Automatic Control 41 (1996).

    Examples
    --------
    >>> PoleRegion(decay=0.2, radius=60.0, damping=0.35).radius
    60.0
    """

    decay: float = 0.0
    radius: float = math.inf
    damping: float = 0.0

    def __post_init__(self) -> None:
        if not (0 <= self.decay < math.inf and self.radius > 0 and 0 <= self.damping < 1):
            raise InputError(
                "pole region: expected decay >= 0, radius > 0 and 0 <= damping < 1, got"
                f" {self.decay}, {self.radius}, {self.damping}"
            )
        if self.decay >= self.radius:
            raise InputError(
                f"pole region: no pole has a real part below -{self.decay:g} and a modulus below"
                f" {self.radius:g}"
            )


Objective = L2 | H2 | EnergyToPeak
