"""The plant of a claim with its u = K x closed: in doubles for a search, in rationals at rest."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from symheli import Scheduling
from symheli.lpv.lpv_matrices import Matrices
from symheli.values.arrays import Array
from synthesis.claims.lyapunov_claim import LyapunovClaim
from synthesis.claims.plants import GridPlant, VertexPlant, rationals

COMBINATIONS = 200
"""Convex combinations of vertices that are looked at, beside the middles of their pairs."""


@dataclass(frozen=True)
class ClosedLoop:
    """The closed loop of a claim, as the search for lower bounds takes it: a model at every p, of
    a grid or on the line between two vertices.
    """

    plant: GridPlant
    K: Array
    shift: float
    """Decay rate that is taken off: of A + shift I, sampled exp(shift dt) A."""

    @classmethod
    def of(cls, plant: VertexPlant | GridPlant, claim: LyapunovClaim) -> list[ClosedLoop]:
        """Return the loops of a grid, or of each pair of vertices."""
        _, K = claim.fitting(plant)
        shift = claim.bound if claim.kind == "decay rate" else 0.0
        K = np.broadcast_to(K, (len(plant.A), *K.shape[1:]))
        if isinstance(plant, GridPlant):
            return [cls(plant, K, shift)]
        pairs = [(i, j) for i in range(len(K)) for j in range(i)]
        return [cls(_pair(plant, K, i, j), 0 * K[[i, j]], shift) for i, j in pairs]

    @property
    def scheduling(self) -> Scheduling:
        """The parameter: its range and rate."""
        p = self.plant.p
        return Scheduling("p", "1", float(p[0]), float(p[-1]), self.plant.rate)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return tuple(f"x{i + 1}" for i in range(self.plant.states))

    @property
    def dt(self) -> float | None:
        """Sample period, s."""
        return self.plant.dt

    def matrices(self, p: Any, /) -> Matrices:
        """A + BK, B, C + DK, D at p (...), in doubles."""
        own = self.plant
        A, B, C, D, K = (own.at(p, M) for M in (own.A, own.B, own.C, own.D, self.K))
        A, C = A + B @ K, C + D @ K
        if own.dt is None:
            return Matrices(A + self.shift * np.eye(own.states), B, C, D)
        return Matrices(A * math.exp(self.shift * own.dt), B, C, D)


def _pair(plant: VertexPlant, K: Array, i: int, j: int) -> GridPlant:
    """Return the line between two closed loops."""
    A, B, C, D = (M[[i, j]] for M in (plant.A, plant.B, plant.C, plant.D))
    own = A + B @ K[[i, j]], B, C + D @ K[[i, j]], D
    return GridPlant(np.array([0.0, 1.0]), *own, rate=math.inf, dt=plant.dt)


@dataclass(frozen=True)
class FrozenLoop:
    """The loop with the plant at rest, exactly: A + BK, B, C + DK, D of rationals; `words` say
    where, `p` is the parameter or the number of a vertex.
    """

    words: str
    p: float | None
    A: Array
    B: Array
    C: Array
    D: Array

    def shifted(self, claim: LyapunovClaim, dt: float | None, spare: Fraction) -> Array:
        """Return A + (rate - spare) I; sampled exp(rate dt) (1 - spare) A: it decays where the loop
        decays faster than the claim by so much.
        """
        rate = Fraction(claim.bound) if claim.kind == "decay rate" else Fraction(0)
        if dt is None:
            own = self.A.copy()
            own[range(len(own)), range(len(own))] += rate - spare
            return own
        factor = Fraction(math.exp(float(rate) * dt) * (1 - 1e-15)) if rate else Fraction(1)
        return self.A * (factor * (1 - spare))


def frozen_loops(plant: VertexPlant | GridPlant, claim: LyapunovClaim) -> Iterator[FrozenLoop]:
    """Yield loops at rest: vertices, middles of pairs and convex combinations; points of a grid and
    their middles.
    """
    _, K = claim.fitting(plant)
    K = np.broadcast_to(K, (len(plant.A), *K.shape[1:]))
    every = tuple(rationals(M) for M in (plant.A, plant.B, plant.C, plant.D, K))
    for words, p, weights in _places(plant):
        if isinstance(plant, VertexPlant):
            loops = [_closed([M[i] for M in every]) for i in weights]
            yield FrozenLoop(words, p, *_mixed(loops, weights))
        else:
            at = [[M[i] for M in every] for i in weights]
            yield FrozenLoop(words, p, *_closed(_mixed(at, weights)))


def _closed(matrices: Sequence[Array]) -> list[Array]:
    """Return A + BK, B, C + DK, D of A, B, C, D, K."""
    A, B, C, D, K = matrices
    return [A + B @ K, B, C + D @ K, D] if K.shape[0] else [A, B, C, D]


def _mixed(each: Sequence[Sequence[Array]], weights: dict[int, Fraction]) -> list[Array]:
    """Return the convex combination of several lists of matrices."""
    out = [M * Fraction(0) for M in each[0]]
    for w, own in zip(weights.values(), each, strict=True):
        out = [total + M * w for total, M in zip(out, own, strict=True)]
    return out


def _places(
    plant: VertexPlant | GridPlant,
) -> Iterator[tuple[str, float | None, dict[int, Fraction]]]:
    count, half = len(plant.A), Fraction(1, 2)
    if isinstance(plant, GridPlant):
        for k, p in enumerate(plant.p):
            yield f"p = {p:.9g}", float(p), {k: Fraction(1)}
            if k:
                middle = 0.5 * (plant.p[k - 1] + p)
                yield f"p = {middle:.9g}", float(middle), {k - 1: half, k: half}
        return
    for i in range(count):
        yield f"vertex {i + 1}", float(i + 1), {i: Fraction(1)}
    rng = np.random.default_rng(0)
    for _ in range(COMBINATIONS if count > 1 else 0):
        few = rng.choice(count, min(count, 2 + int(rng.integers(2))), replace=False)
        parts = [Fraction(int(v), 64) for v in rng.integers(1, 64, len(few))]
        weights = {int(i): v / sum(parts) for i, v in zip(few, parts, strict=True)}
        words = " + ".join(f"{v} of vertex {i + 1}" for i, v in weights.items())
        yield words, None, weights


def without_gain(claim: LyapunovClaim) -> LyapunovClaim:
    """Return the claim of stability that a claim of a gain has in it; another claim as it is."""
    return replace(claim, kind="stability") if claim.kind == "l2 gain" else claim
