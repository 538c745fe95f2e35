"""Check of P and a multiplier as a proof, from the LFT alone, in floating point or in exact
rational arithmetic.

Nothing here is shared with the assembly of the cone program: an error there cannot pass here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from symheli.lpv.lft_matrices import LFTMatrices, parts
from symheli.lpv.lpv_matrices import Matrices
from symheli.lpv.scheduling import Scheduling
from symheli.values.arrays import Array
from synthesis.certify.lft.multipliers import Multiplier
from synthesis.certify.proof import pointwise
from synthesis.certify.statement.kind import L2_GAIN, STABILITY
from synthesis.certify.statement.units import Scaling
from synthesis.numerics.polynomial import structure
from synthesis.numerics.polynomial.exact import Number, exact, positive_definite, rational
from synthesis.numerics.polynomial.symmetric import schur_complement, symmetrized

MAX_PARAMETERS_AT_CORNERS = 6
"""Largest number of parameters for which a proof is checked independently at all corners of the
box.
"""


class QuadraticStorage(NamedTuple):
    """V = x'P x and a multiplier, in physical units and in the copies of the parameters the LFT
    has.
    """

    P: Array
    multiplier: Multiplier

    @property
    def form(self) -> str:
        """The form in words."""
        return f"V = x'Px, multiplier of the class {self.multiplier.scaling!r}"


class LFTEvidence(NamedTuple):
    """An LFT, and the coordinates in which its numbers are of order one."""

    lft: LFTMatrices
    coordinates: Coordinates

    @property
    def parameters(self) -> tuple[Scheduling, ...]:
        """The parameters of the LFT."""
        return self.lft.parameters

    @property
    def matrices(self) -> LFTMatrices:
        """The LFT."""
        return self.lft

    def fault(self, proof: QuadraticStorage, kind: str, rates: tuple[float, ...]) -> str | None:
        """Return why the proof does not belong to this LFT and statement, before any inequality is
        checked; None where it does.
        """
        if not isinstance(proof, QuadraticStorage) or not isinstance(proof.multiplier, Multiplier):
            return "expected P and a Multiplier"
        if kind != (L2_GAIN if self.lft.inputs else STABILITY):
            return f"the LFT of the proof is not one of the kind {kind!r}"
        if rates != (math.inf,) * len(self.lft.parameters):
            return f"the proof is for parameters that jump, the certificate for rates {rates}"
        x, M = len(self.lft.states), proof.multiplier
        units, left, right = self.coordinates
        return structure.first(
            structure.symmetric(np.asarray(proof.P), (x, x), "P"),
            M.fault
            or (
                None
                if _structure_holds(M, self.lft)
                else f"the multiplier is not of the class {M.scaling!r} for this LFT"
            ),
            structure.coordinates(left, right, (), self.lft.order),
            units.fault(x),
        )

    def least_gain(self, proof: QuadraticStorage) -> tuple[float, float]:
        """Return (gain that the proof admits, condition number of P); inf where it proves nothing,
        NaN without channels.
        """
        lft, (units, _, right) = self.lft, self.coordinates
        E = np.zeros((lft.order + len(lft.states) + len(lft.inputs),) * 2)
        n, x = lft.order, len(lft.states)
        root = math.sqrt(units.time)
        # columns of (w, x, u); energies divided by the channel squared and counted in the unit of
        # time
        E[:n, :n], E[n : n + x, n : n + x] = right, root * units.right @ units.weight
        E[n + x :, n + x :] = np.eye(len(lft.inputs))
        F = E.T @ _left_side(lft, proof, float) @ E / units.channel**2
        F = symmetrized(F)
        if not (self._conditions_hold(proof) and _negative(F[: n + x, : n + x])):
            return math.inf, math.inf
        values = np.linalg.eigvalsh(units.to_scaled(proof.P)) if x else np.ones(1)
        if not len(lft.inputs) or not len(lft.outputs):
            return math.nan, float(values[-1] / values[0])
        level = symmetrized(schur_complement(F, n + x))
        g = max(float(np.linalg.eigvalsh(level).max()), 0.0)
        return units.channel * math.sqrt(g), float(values[-1] / values[0])

    def floating(self, proof: QuadraticStorage, gamma: float) -> bool:
        """Check by eigenvalues, with a margin for rounding."""
        least = self.least_gain(proof)[0]
        return math.isnan(least) if math.isnan(gamma) else least < gamma

    def exact(self, proof: QuadraticStorage, gamma: float) -> bool:
        """Check by LDL' in rationals; the doubles of the LFT, of the proof and of gamma are taken
        as exact rationals.
        """
        number, n, x = rational(), self.lft.order, len(self.lft.states)
        if not _structure_holds(proof.multiplier, self.lft):
            return False
        F = -_left_side(self.lft, proof, number)
        if math.isnan(gamma):
            F = F[: n + x, : n + x]
        else:
            for i in range(n + x, len(F)):
                F[i, i] = F[i, i] + number(gamma) * number(gamma)
        exactly = all(
            positive_definite(M)
            for M in (exact(proof.P, number), *_conditions(proof.multiplier, number), F)
        )
        return exactly and self.checked_independently(proof, gamma, number)

    def checked_independently(self, proof: QuadraticStorage, gamma: float, number: Number) -> bool:
        """Check the inequality of V = x'Px at the corners of the box and inside it, through the
        closed model's own matrices.
        """
        g = None if math.isnan(gamma) else number(gamma) * number(gamma)
        P, m = exact(proof.P, number), len(self.lft.parameters)
        corners = product((-1.0, 1.0), repeat=m) if m <= MAX_PARAMETERS_AT_CORNERS else ()
        diagonals = (np.where(np.arange(m) % 2, -t, t) for t in np.linspace(-0.9, 0.9, 7))
        for delta in (*corners, *diagonals):
            M, x = self.lft.matrix(np.array(delta, dtype=float)), len(self.lft.states)
            parts_of = (M[:x, :x], M[:x, x:], M[x:, :x], M[x:, x:])
            own = Matrices(*(exact(part, number) for part in parts_of))
            F = pointwise.dissipation(own, P, None, None if self.lft.dt is None else P, g)
            if not positive_definite(-F):
                return False
        return True

    def _conditions_hold(self, proof: QuadraticStorage) -> bool:
        units, right = self.coordinates.units, self.coordinates.right
        if not _structure_holds(proof.multiplier, self.lft):
            return False
        if len(proof.P) and not _negative(-units.to_scaled(proof.P)):
            return False
        transforms = [right[part, part] for part in parts(proof.multiplier.sizes)]
        if proof.multiplier.scaling == "full block":
            transforms += [right] * 2 ** len(proof.multiplier.sizes)
        scaled = _conditions(proof.multiplier, float)
        return all(_negative(-(T.T @ M @ T)) for M, T in zip(scaled, transforms, strict=True))


def _left_side(lft: LFTMatrices, proof: QuadraticStorage, number: Number) -> Array:
    """The quadratic form on (w, x, u) with gamma = 0: rows of the LFT are (z, dx/dt or x(k+1),
    y).
    """
    M11, M12, M21, M22 = (exact(M, number) for M in (lft.M11, lft.M12, lft.M21, lft.M22))
    n, x = lft.order, len(lft.states)
    z = np.concatenate([M11, M12], axis=1)
    below = np.concatenate([M21, M22], axis=1)
    move, y = below[:x], below[x:]
    P = exact(proof.P, number)
    Q, S, R = (
        exact(M, number) for M in (proof.multiplier.Q, proof.multiplier.S, proof.multiplier.R)
    )
    F = z.T @ R @ z + y.T @ y
    cross = S @ z
    F[:n] = F[:n] + cross
    F[:, :n] = F[:, :n] + cross.T
    F[:n, :n] = F[:n, :n] + Q
    here = slice(n, n + x)
    if lft.dt is None:
        slope = P @ move
        F[here] = F[here] + slope
        F[:, here] = F[:, here] + slope.T
    else:
        F = F + move.T @ P @ move
        F[here, here] = F[here, here] - P
    return F


def _structure_holds(multiplier: Multiplier, lft: LFTMatrices) -> bool:
    """Check exactly that the blocks are those of the LFT, and that the multiplier has the form of
    its class.
    """
    Q, S, R = multiplier.Q, multiplier.S, multiplier.R
    if multiplier.sizes != lft.sizes or np.any(Q != Q.T) or np.any(R != R.T):
        return False
    if multiplier.scaling == "full block":
        return True
    owner = np.repeat(np.arange(len(multiplier.sizes)), multiplier.sizes)
    outside = owner[:, None] != owner[None, :]
    allowed = np.all(S == -S.T) if multiplier.scaling == "DG" else not np.any(S)
    scalar = (
        multiplier.scaling != "small gain"
        or not len(R)
        or np.array_equal(R, R[0, 0] * np.eye(len(R)))
    )
    return bool(
        allowed
        and scalar
        and np.array_equal(Q, -R)
        and not np.any(R[outside])
        and not np.any(S[outside])
    )


def _conditions(multiplier: Multiplier, number: Number) -> Iterator[Array]:
    """Yield the matrices that must be positive for the multiplier to hold on the whole box, given
    its structure.
    """
    Q, S, R = (exact(M, number) for M in (multiplier.Q, multiplier.S, multiplier.R))
    for part in parts(multiplier.sizes):
        yield -Q[part, part]
    if multiplier.scaling == "full block":
        m = len(multiplier.sizes)
        for corner in range(2**m):
            signs = np.repeat([1 if corner >> i & 1 else -1 for i in range(m)], multiplier.sizes)
            turned = S * signs[:, None]
            yield Q * signs[:, None] * signs + turned + turned.T + R


def _negative(M: Array) -> bool:
    """Whether F is negative definite by more than rounding can hide."""
    if not len(M):
        return True
    values = np.linalg.eigvalsh(0.5 * (M + M.T))
    return bool(values[-1] < -20 * len(M) * np.finfo(float).eps * np.abs(values).max())


class Coordinates(NamedTuple):
    """`units` of state, output and time; z = right z', w = right w' with left = right^-1 and both
    commuting with Delta.
    """

    units: Scaling
    left: Array
    right: Array
