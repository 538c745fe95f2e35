"""Whether V = x'Px proves a claim about vertices or a grid; if not, where and by how much."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from symheli.values.tracking import tracked
from synthesis.claims.inequality import POSITIVE, Required, parts, value_at
from synthesis.claims.lyapunov_claim import LyapunovClaim
from synthesis.claims.plants import GridPlant, VertexPlant
from synthesis.claims.verdict import NOT_BY_THIS, PROVEN, UNDECIDED, Place
from synthesis.numerics.polynomial.definite import Miss, first_miss
from synthesis.numerics.polynomial.direction import not_positive

Plant = VertexPlant | GridPlant
ROUNDS, GROWTH = 24, 4.0
"""Bisections of the bound that a P does prove, and the factor of its first steps."""
MOST_WORK = 20_000
"""Entries of all inequalities together up to which that bound is looked for."""


def holds(plant: Plant, claim: LyapunovClaim) -> bool:
    """Whether the claim is proven by its P, in rational arithmetic."""
    if _jumps(plant, claim):
        return False
    return all(_missed(part, claim) is None for part in parts(plant, claim))


def _missed(part: Required, claim: LyapunovClaim) -> Miss | None:
    """Return where a part fails. A decay rate is proven where V falls just as fast, of a vertex."""
    miss = first_miss(-part.form)
    if miss is None or claim.kind != "decay rate" or part.vertex is None or part.name == POSITIVE:
        return miss
    found = not_positive(value_at(part.form, miss.point))
    return None if found is None or found[0] == 0 else miss


def judged(plant: Plant, claim: LyapunovClaim) -> tuple[str, str, Place | None]:
    """Return the answer about this P alone, the reason and the place."""
    if _jumps(plant, claim):
        return UNDECIDED, JUMPS, None
    flat: tuple[str, str, Place | None] | None = None
    every = tracked("checking in rational arithmetic", parts(plant, claim), _count(plant, claim))
    for part in every:
        miss = _missed(part, claim)
        if miss is None:
            continue
        place = _place(part, miss)
        if place is None:
            flat = flat or (UNDECIDED, _not_shown(part, miss), None)
        elif place.short > 0:
            return NOT_BY_THIS, f"{part.name}: the inequality does not hold.", place
        else:
            flat = (UNDECIDED, f"{part.name}: {EQUAL}", place)
    return flat or (PROVEN, "", None)


JUMPS = (
    "P depends on p, and p may jump, so that V may rise at a jump. The rate of p would decide: give"
    " rate"
)
EQUAL = (
    "the inequality holds with equality in one direction, and is not strict. V does not rise there;"
    " whether it falls is not decided. A bound a little weaker would decide, or another P"
)


def _count(plant: Plant, claim: LyapunovClaim) -> int:
    """Return about how many inequalities there are."""
    models, functions = len(plant.A), len(claim.fitting(plant)[0])
    return functions * (models + 1) if isinstance(plant, VertexPlant) else 3 * models


def _jumps(plant: Plant, claim: LyapunovClaim) -> bool:
    """Whether P moves with a p that may jump, in continuous time."""
    P, _ = claim.fitting(plant)
    own = isinstance(plant, GridPlant) and plant.dt is None and math.isinf(plant.rate)
    return own and len(P) > 1 and bool(np.any(P != P[0]))


def _place(part: Required, miss: Miss) -> Place | None:
    """Return where a part fails; None where it was only not shown."""
    if not miss.certain:
        return None
    M = value_at(part.form, miss.point)
    found = not_positive(M)
    if found is None:
        return None
    form, x = found
    size = sum(v * v * abs(M[i, i]) for i, v in enumerate(x)) or sum(v * v for v in x)
    p = float(miss.point[0]) if part.vertex is None else float(part.vertex + 1)
    words = part.words or f"p = {p:.9g}"
    x = np.array([float(v) for v in x])
    return Place(f"{words} ({part.name})", p, x / np.abs(x).max(), float(-form / size))


def _not_shown(part: Required, miss: Miss) -> str:
    where = part.words or f"near p = {float(miss.point[0]):.9g}"
    return f"{part.name}: undecided {where}, within the boxes that are looked at; more would decide"


def proven_bound(plant: Plant, claim: LyapunovClaim) -> float:
    """Return the best bound that this P does prove, to about a millionth; NaN where there is none
    or the claim has none.
    """
    if claim.kind == "stability" or _work(plant) > MOST_WORK:
        return math.nan

    def proven(bound: float) -> bool:
        return holds(plant, replace(claim, bound=bound))

    sense = 1.0 if claim.kind == "l2 gain" else -1.0
    good, bad = _bracket(proven, claim.bound, sense)
    if math.isnan(good):
        return math.nan
    for _ in range(ROUNDS):
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if proven(middle) else (good, middle)
    return good


def _bracket(proven: Any, bound: float, sense: float) -> tuple[float, float]:
    """Return a bound that is proven and one that is not."""
    if sense < 0:
        return (0.0, bound) if proven(0.0) else (math.nan, bound)
    bad, good = bound, bound * 1.001 or 1e-6
    for _ in range(12):
        if proven(good):
            return good, bad
        bad, good = good, good * GROWTH
    return math.nan, bad


def _work(plant: Plant) -> int:
    size = plant.states + plant.B.shape[2]
    return len(plant.A) * size * size
