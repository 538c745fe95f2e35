"""A claim about the terminal set and the terminal cost of a model predictive controller."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import positive
from symheli.values.summary import summarized
from synthesis.claims.plants import LimitedPlant


@dataclass(frozen=True, eq=False, kw_only=True)
class TerminalClaim:
    """The claim that u = K x keeps a set within the limits, and lets a cost fall in it.

    The set is {x'Px <= level}, or {H x <= h}; no motion leaves it, and in it all limits of the
    plant hold. With Q and R also x+'P x+ - x'Px + x'(Q + K'RK)x <= 0 of every x.

    Parameters
    ----------
    K : array (m, n)
        The terminal controller, u = K x.
    P : array (n, n), optional
        Symmetric: of the ellipsoid, and of the terminal cost.
    level : float, optional
        Of the ellipsoid.
    H, h : array (k, n), (k,), optional
        Of the polytope; h is not below zero.
    Q, R : array (n, n), (m, m), optional
        Stage cost x'Qx + u'Ru.

    Raises
    ------
    InputError
        Where neither a level nor H and h are given, or both; or a P is missing or not symmetric.

    Examples
    --------
    >>> TerminalClaim(K=[[-0.5]], P=[[1.0]], level=4.0).sentence
    "no motion leaves x'Px <= 4.0 with u = K x, and all limits hold in it"
    """

    K: Array
    P: Any = None
    level: Any = None
    H: Any = None
    h: Any = None
    Q: Any = None
    R: Any = None
    kind: ClassVar[str] = "terminal set"

    __repr__ = summarized

    def __post_init__(self) -> None:
        for name, axes in (("K", 2), ("P", 2), ("H", 2), ("h", 1), ("Q", 2), ("R", 2)):
            M = getattr(self, name)
            if M is not None:
                object.__setattr__(self, name, frozen(M, name, (None,) * axes))
        for name in ("P", "Q", "R"):
            M = getattr(self, name)
            if M is not None and not (M.shape[0] == M.shape[1] and np.array_equal(M, M.T)):
                raise InputError(f"{name}: expected a symmetric matrix, got {M!r:.60}")
        if (self.level is None) == (self.H is None) or (self.H is None) != (self.h is None):
            raise InputError("give the level of x'Px <= level, or H and h of H x <= h")
        if (self.Q is None) != (self.R is None):
            raise InputError("give both Q and R of the stage cost, or none of them")
        if self.P is None and (self.level is not None or self.Q is not None):
            raise InputError("P is missing: it is that of x'Px <= level and of the terminal cost")
        if self.level is not None:
            object.__setattr__(self, "level", positive(self.level, "level"))
        if self.h is not None and (np.any(self.h < 0) or len(self.h) != len(self.H)):
            raise InputError("h: expected one number >= 0 for each row of H")

    @property
    def sentence(self) -> str:
        """The claim in words."""
        own = "H x <= h" if self.level is None else f"x'Px <= {self.level!r}"
        falls = "" if self.Q is None else "; the cost x'Px falls by x'(Q + K'RK)x at least"
        return f"no motion leaves {own} with u = K x, and all limits hold in it{falls}"

    def fit(self, plant: LimitedPlant) -> None:
        """Raise `InputError` where the claim does not fit the plant."""
        n, m = plant.states, plant.B.shape[2]
        for name, shape in (("K", (m, n)), ("P", (n, n)), ("H", (None, n)), ("Q", (n, n)),
                            ("R", (m, m))):  # fmt: skip
            M = getattr(self, name)
            if M is not None:
                frozen(M, name, shape)
