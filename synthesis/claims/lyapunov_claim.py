"""A claim by V = x'Px about a linear plant: stability, a decay rate or an energy gain."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import positive
from symheli.values.summary import summarized
from synthesis.claims.plants import GridPlant, VertexPlant

KINDS = ("stability", "decay rate", "l2 gain")
FASTEST = 300.0
"""Decay of a sample, the logarithm of its factor, beyond which a claim is not read."""


@dataclass(frozen=True, eq=False)
class LyapunovClaim:
    """The claim that V = x'Px proves a property of a plant, closed by u = K x where a K is given.

    Parameters
    ----------
    kind : str
        "stability", "decay rate" (|x(t)| <= c exp(-bound t) |x(0)|) or "l2 gain" (exponentially
        stable, and |y|_2 < bound |u|_2 from rest).
    P : array (n, n), or (N, n, n)
        Symmetric; one for all, or one a vertex or point of the grid, with straight lines between.
    bound : float, optional
        The decay rate, 1/s, or the gain.
    K : array (m, n) or (N, m, n), optional
        u = K x + the input of the claim.
    p : array (N,), optional
        Points of the P of a model (LPVStateSpace) of one parameter, from end to end of its range.

    Raises
    ------
    InputError
        For another kind, a bound that is missing, or a P that is not symmetric.

    Examples
    --------
    >>> LyapunovClaim("decay rate", [[1.0]], 0.5).sentence
    '|x(t)| <= c exp(-0.5 t) |x(0)|'
    """

    kind: str
    P: Array
    bound: float = math.nan
    K: Any = None
    p: Any = None

    __repr__ = summarized

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f"expected a claim of {', '.join(KINDS)}, got {self.kind!r:.60}")
        P = np.asarray(self.P, dtype=object)
        P = frozen(self.P, "P", (None,) * 3 if P.ndim == 3 else (None, None))
        if P.shape[-1] != P.shape[-2]:
            raise InputError(f"P: expected square matrices, got shape {P.shape}")
        if not np.array_equal(P, np.swapaxes(P, -1, -2)):
            raise InputError(
                "P is not symmetric to the last digit; V = x'Px is that of (P + P')/2: give that"
            )
        object.__setattr__(self, "P", P)
        bound = 0.0
        if self.kind != "stability":
            bound = positive(self.bound, "bound", or_zero=self.kind == "decay rate")
        object.__setattr__(self, "bound", bound)
        if self.K is not None:
            K = np.asarray(self.K, dtype=object)
            own = frozen(self.K, "K", (None,) * 3 if K.ndim == 3 else (None, None))
            object.__setattr__(self, "K", own)
        if self.p is not None:
            object.__setattr__(self, "p", frozen(self.p, "p", (None,)))

    @property
    def sentence(self) -> str:
        """The claim in words."""
        closed = "" if self.K is None else "with u = K x + w: "
        closed = (
            closed.replace("K", "K of each vertex or point") if self.each_has_its_own else closed
        )
        return (
            closed
            + {
                "stability": "the state tends to zero exponentially from every start",
                "decay rate": f"|x(t)| <= c exp(-{self.bound!r} t) |x(0)|",
                "l2 gain": f"exponentially stable, and |y|_2 < {self.bound!r} |u|_2 from rest",
            }[self.kind]
        )

    @property
    def each_has_its_own(self) -> bool:
        """Whether every vertex or point has its own K."""
        return self.K is not None and self.K.ndim == 3

    def fitting(self, plant: VertexPlant | GridPlant) -> tuple[Array, Array]:
        """Return P (1 or N, n, n) and K (1 or N, m, n) of a plant.

        Raises `InputError` where they do not fit it.
        """
        if self.p is not None:
            raise InputError("p of a claim is for a model; vertices and grids have points already")
        count, n, m = len(plant.A), plant.states, plant.B.shape[2]
        P = self.P if self.P.ndim == 3 else self.P[None]
        K = np.zeros((1, m, n)) if self.K is None else self.K
        K = K if K.ndim == 3 else K[None]
        for name, M, size in (("P", P, (n, n)), ("K", K, (m, n))):
            if M.shape[1:] != size or len(M) not in (1, count):
                raise InputError(
                    f"{name}: expected {size[0]} x {size[1]}, one or {count} of them, got shape"
                    f" {M.shape}"
                )
        if self.kind == "l2 gain" and not (m and plant.C.shape[1]):
            raise InputError(
                "a gain is from inputs to outputs: give B and C, and D if there is one"
            )
        if self.kind == "decay rate" and self.bound * (plant.dt or 0.0) > FASTEST:
            raise InputError(
                f"bound: exp(-bound dt) is below exp(-{FASTEST:g}), beyond what doubles hold; give"
                f" a rate of at most {FASTEST / (plant.dt or 1.0):g} 1/s"
            )
        if len(P) > 1 and isinstance(plant, VertexPlant) and plant.dt is None:
            raise InputError(
                "in continuous time a P of each vertex proves nothing while the plant moves in any"
                " way: give one P, or a grid of one parameter with its rate"
            )
        return P, K
