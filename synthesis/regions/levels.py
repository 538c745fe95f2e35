"""Search for the largest level of V up to which a polynomial E is proven negative but at 0."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from symheli.errors import InputError
from symheli.progress import Task, task
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.multivariate import SparsePolynomial
from synthesis.numerics.program.cone_program import Solver
from synthesis.regions.coordinates import (
    ceiling,
    rises_near_zero,
    rising_point,
    round_coordinates,
    short,
)
from synthesis.regions.proof import NOT_POSITIVE, RegionProof, why_not
from synthesis.regions.search import Effort, RegionSearch, bases

CLOSEST, CLOSE = 1e-5, 1e-3
"""Relative distance below the ceiling at which a level is tried first, and accuracy of others."""
ENOUGH = 0.99
"""Share of the ceiling from which multipliers of higher degree are not tried."""
LEAST_SHARE = 1e-6
"""Least share of the ceiling that is tried."""
EFFORTS = (Effort(0, 0), Effort(1, 0), Effort(0, 1), Effort(1, 1))
MOST_MONOMIALS = 70
"""Monomials of a sum of squares beyond which multipliers are not raised by themselves."""
STEP, STEPS = 4.0, 20
"""Factor from one level to the next where nothing bounds them, and the most of them."""
NOTHING = (
    "no level passes the exact check; another V may have one, or a larger, even multiplier_degree"
)

RISES = (
    "dV/dt > 0 as close to 0 as one likes: take another V, or 0 is no asymptotically stable"
    " equilibrium"
)


class Level(NamedTuple):
    """The largest level, 0 where none is proven, its proof, a point where E >= 0 exactly, and why
    there is no proof.
    """

    level: float
    proof: RegionProof | None
    point: Array | None = None
    why: str = ""


class LevelSearch:
    """Levels of one V, each candidate checked before it counts.

    E is the change of V, by time or from sample to sample. `most`: no higher level is wanted.
    """

    def __init__(
        self,
        V: SparsePolynomial,
        E: SparsePolynomial,
        multiplier_degree: int | None,
        solver: Solver,
        most: float = math.inf,
    ):
        self.V, self.E, self.solver = V, E, solver
        self.degree, self.most = multiplier_degree, most

    def found(self) -> Level:
        """Return the largest level that is proven."""
        if not self.V.terms or not self.E.terms:
            return Level(0.0, None, None, "V or dV/dt is 0 everywhere")
        finite = math.isfinite(self.most)
        T = round_coordinates(self.V, self.most if finite else 1.0)
        if rises_near_zero(self.E, T):
            return Level(0.0, None, None, RISES)
        level, z = ceiling(self.V, self.E, T)
        with task("largest level", len(EFFORTS)) as progress:
            if level > self.most:
                return self._below(self.most, 1.0, short(T), None, progress)
            if z is None:
                return self._unlimited(T)
            T = short(round_coordinates(self.V, level, T))
            level, z = ceiling(self.V, self.E, T)
            point = None if z is None else rising_point(self.E, T @ z)
            level = min(level, self.most)
            return self._below(level, 1.0 - CLOSEST, T, point, progress)

    def _below(
        self, level: float, first: float, T: Array, point: Array | None, progress: Task
    ) -> Level:
        search = RegionSearch(self.V, self.E, T, level, self.solver)
        if search.V is None:
            return Level(0.0, None, point, NOT_POSITIVE)
        best: tuple[float, RegionProof | None] = (0.0, None)
        for effort in self._efforts(search):
            share, proof = self._largest(search, effort, best[0], first)
            if proof is not None:
                best = share, proof
            progress.step(f"{best[0]:.4g} of the ceiling")
            if best[0] > ENOUGH:
                break
        why = "" if best[1] is not None else NOTHING
        return Level(best[0] * level, best[1], point, why)

    def _efforts(self, search: RegionSearch) -> Iterator[Effort]:
        """Yield degrees of multipliers, the ones asked for alone."""
        first = bases(search.W, search.E, EFFORTS[0])
        least = 2 * max(map(sum, first.s))
        if self.degree is not None:
            if self.degree < least:
                raise InputError(f"multiplier_degree: expected at least {least} for this f and V")
            yield Effort((self.degree - least) // 2, 0)
            return
        for k, effort in enumerate(EFFORTS):
            if not k or len(bases(search.W, search.E, effort).rest) <= MOST_MONOMIALS:
                yield effort

    def _largest(
        self, search: RegionSearch, effort: Effort, above: float, first: float
    ) -> tuple[float, RegionProof | None]:
        """Return the largest share of the ceiling that is proven, above one that is."""
        low, high, best, share = above, 1.0, None, first
        while share > LEAST_SHARE and high - low > CLOSE * high:
            proof = self._proven(search, share, effort)
            if proof is None:
                high = share
            else:
                low, best = share, proof
                if share == first:
                    break
            share = 0.5 * (low + high) if low > 0 else 0.5 * high
        return low, best

    def _proven(self, search: RegionSearch, share: float, effort: Effort) -> RegionProof | None:
        proof = search.at(share, effort)
        level = share * search.unit
        return proof if proof and not why_not(self.V, self.E, level, proof) else None

    def _unlimited(self, T: Array) -> Level:
        """Return the level where no point bounds it: all levels, or the last one of a climb."""
        search = RegionSearch(self.V, self.E, short(T), 1.0, self.solver)
        if search.V is None:
            return Level(0.0, None, None, NOT_POSITIVE)
        for effort in (EFFORTS[0], EFFORTS[2]):
            proof = self._proven(search, math.inf, effort)
            if proof is not None:
                return Level(math.inf, proof)
        best = self._climbed(T, STEP) or self._climbed(T, 1 / STEP)
        return best or Level(0.0, None, None, NOTHING)

    def _climbed(self, T: Array, factor: float) -> Level | None:
        """Return the last level upwards that is proven, or the first one downwards."""
        best = None
        for k in range(STEPS):
            own = RegionSearch(self.V, self.E, short(T), factor**k, self.solver)
            proof = self._proven(own, 1.0, EFFORTS[0])
            if proof is not None:
                best = Level(own.unit, proof)
            if (proof is None) == (factor > 1):
                break
        return best
