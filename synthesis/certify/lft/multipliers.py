"""Multipliers for w = Delta z, Delta = diag(delta_i I), |delta_i| <= 1: quadratic constraints on
(w, z) at every instant.

A multiplier [Q S; S' R] states [w; z]'[Q S; S' R][w; z] >= 0 for every Delta of the box. Four
nested classes:

small gain   t (|z|^2 - |w|^2) with one number t > 0, in the coordinates the LFT has D            R
= -Q = diag(D_i) > 0, S = 0                                     (scalings that commute with Delta)
DG           as D, and S = diag(G_i), G_i' = -G_i                               (the parameters are
real) full block   any Q, S, R with Q_ii < 0 and Delta'Q Delta + Delta'S + S'Delta + R > 0 at the
corners of the box

With Q_ii < 0 the last expression is concave in each parameter alone, so its minimum over the box is
at a corner. For one parameter DG loses nothing against the full block: a quadratic matrix
polynomial that is positive on an interval is a sum of squares. Sources: Fan, Tits and Doyle, IEEE
TAC 36 (1991), D and G; Scherer, "LPV control and full block multipliers", Automatica 37 (2001);
Meinsma, Shrivastava and Fu, IEEE TAC 42 (1997), why DG is exact for one repeated scalar.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.summary import summarized
from synthesis.numerics.polynomial import structure

SCALINGS = ("small gain", "D", "DG", "full block")
"""The classes, from the most to the least conservative."""


@dataclass(frozen=True, eq=False)
class Multiplier:
    """[Q S; S' R] (2n, 2n) of the class `scaling` for parameter blocks of `sizes`; Q and R
    symmetric, exactly.
    """

    scaling: str
    sizes: tuple[int, ...]
    Q: Array
    S: Array
    R: Array

    __repr__ = summarized

    def __post_init__(self) -> None:
        if not isinstance(self.sizes, tuple) or any(
            structure.whole(size, 0, "size") for size in self.sizes
        ):
            raise InputError(f"expected a tuple of block sizes, got {self.sizes!r:.60}")
        for name in ("Q", "S", "R"):
            object.__setattr__(self, name, structure.numbers(getattr(self, name), name))
        if self.fault:
            raise InputError(self.fault)

    @property
    def fault(self) -> str | None:
        """Reason why the form is invalid, None where it is valid."""
        if not isinstance(self.scaling, str) or self.scaling not in SCALINGS:
            return f"expected one of the scalings {', '.join(SCALINGS)}, got {self.scaling!r:.60}"
        n = sum(self.sizes)
        if self.S.shape != (n, n) or not np.all(np.isfinite(self.S)):
            return (
                f"S of a multiplier: expected finite numbers of shape {(n, n)}, got shape"
                f" {self.S.shape}"
            )
        return structure.first(
            *(
                structure.symmetric(M, (n, n), f"{name} of a multiplier")
                for name, M in (("Q", self.Q), ("R", self.R))
            )
        )

    @property
    def matrix(self) -> Array:
        """[Q S; S' R]."""
        return np.block([[self.Q, self.S], [self.S.T, self.R]])

    def transformed(self, left: Array, weight: float) -> Multiplier:
        """weight times the multiplier for w = left^-1 w', z = left^-1 z' (left commutes with
        Delta), its class kept exactly.
        """

        def back(M: Array) -> Array:
            return weight * left.T @ M @ left

        Q, S, R = back(self.Q), back(self.S), back(self.R)
        if self.scaling == "full block":
            return Multiplier(self.scaling, self.sizes, 0.5 * (Q + Q.T), S, 0.5 * (R + R.T))
        if self.scaling == "small gain" and len(R):
            R = R[0, 0] * np.eye(len(R))
        mask = block_mask(self.sizes)
        R = mask * 0.5 * (R + R.T)
        G = mask * 0.5 * (S - S.T) if self.scaling == "DG" else np.zeros_like(S)
        return Multiplier(self.scaling, self.sizes, -R, G, R)


def block_mask(sizes: Sequence[int]) -> Array:
    """1 inside the diagonal blocks, 0 elsewhere."""
    owner = np.repeat(np.arange(len(sizes)), sizes)
    return (owner[:, None] == owner[None, :]).astype(float)
