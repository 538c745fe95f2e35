"""Whether a terminal set and cost are what they are said to be, in exact arithmetic.

With A + BK of every vertex: an ellipsoid x'Px <= c is not left where P - A'PA >= 0, and a'x <= b
holds in it where c a'P^-1 a <= b^2. A polytope Hx <= h lies in a'x <= b where a = H'y with y >= 0
and h'y <= b. The cost falls where P - A'PA - Q - K'RK >= 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import combinations, islice
from typing import Any, NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.claims.plants import LimitedPlant, as_fraction, rationals
from synthesis.claims.terminal_claim import TerminalClaim
from synthesis.claims.verdict import FALSE, NOT_BY_THIS, PROVEN, UNDECIDED, Counterexample, Place
from synthesis.numerics.polynomial.direction import not_positive
from synthesis.numerics.polynomial.exact import positive_definite
from synthesis.numerics.polynomial.spectrum import below_root, solve

TIGHT = 1e-7
"""Part of a limit up to which a row of H counts as one that the maximum touches."""
MOST_BASES = 500
"""Choices of rows that are tried as those of a maximum."""
FACTORS = (1e-12, 1e-9, 1e-6, 1e-4, 1e-2)
"""By how much more P is tried as a terminal cost where P itself is not one."""


class Outcome(NamedTuple):
    """Answer, reason, place and motion."""

    answer: str
    reason: str = ""
    place: Place | None = None
    motion: Counterexample | None = None


class Row(NamedTuple):
    """A condition a'x <= b on the whole set: what it is, of which vertex (None: of all)."""

    name: str
    a: Array
    b: Any
    vertex: int | None


def holds(plant: LimitedPlant, claim: TerminalClaim) -> bool:
    """Whether the claim is proven, in rational arithmetic."""
    return judged(plant, claim).answer == PROVEN


def judged(plant: LimitedPlant, claim: TerminalClaim) -> Outcome:
    """Return what is the case."""
    claim.fit(plant)
    if claim.P is not None and not positive_definite(rationals(claim.P)):
        return Outcome(NOT_BY_THIS, "P is not positive definite.")
    within = _ellipsoid if claim.level is not None else _polytope
    return within(plant, claim) or _cost(plant, claim) or Outcome(PROVEN)


def closed(plant: LimitedPlant, claim: TerminalClaim) -> list[Array]:
    """Return A + BK of every vertex, in rationals."""
    K = rationals(claim.K)
    return [rationals(A) + rationals(B) @ K for A, B in zip(plant.A, plant.B, strict=True)]


def limits(plant: LimitedPlant, claim: TerminalClaim) -> Iterator[Row]:
    """Yield the limits of the plant as conditions on x."""
    K = rationals(claim.K)
    for i, (a, b) in enumerate(zip(rationals(plant.H_x), rationals(plant.h_x), strict=True)):
        yield Row(f"limit {i + 1} of the states", a, b, None)
    for i, (a, b) in enumerate(zip(rationals(plant.H_u), rationals(plant.h_u), strict=True)):
        yield Row(f"limit {i + 1} of the inputs", a @ K, b, None)


def rows(plant: LimitedPlant, claim: TerminalClaim) -> list[Row]:
    """Return all conditions on a polytope: limits, and that its successor lies in it."""
    found = list(limits(plant, claim))
    for k, A in enumerate(closed(plant, claim)):
        for i, (a, b) in enumerate(zip(rationals(claim.H), rationals(claim.h), strict=True)):
            found.append(Row(f"row {i + 1} of H after a step", a @ A, b, k))
    return found


def _ellipsoid(plant: LimitedPlant, claim: TerminalClaim) -> Outcome | None:
    P, c = rationals(claim.P), as_fraction(claim.level)
    for row in limits(plant, claim):
        along = solve(P, row.a[:, None])
        assert along is not None  # noqa: S101 - P is positive definite
        reach = row.a @ along[:, 0]
        if c * reach > row.b**2:
            x = along[:, 0] * below_root(c / reach)
            return _violated(row, x, row.a @ x)
    for k, A in enumerate(closed(plant, claim)):
        found = not_positive(P - A.T @ P @ A)
        if found is not None and found[0] < 0:
            x = found[1] * below_root(c / (found[1] @ P @ found[1]))
            return _left(plant, k, x, A @ x, (A @ x) @ P @ (A @ x) / c - 1)
    return None


def _violated(row: Row, x: Array, value: Any) -> Outcome:
    short = float((value - row.b) / (abs(row.b) or 1))
    if value <= row.b:
        return Outcome(UNDECIDED, f"{row.name}: the set touches it, to {short:.3g} of it")
    place = Place(row.name, None, x.astype(float), short)
    reason = f"A state of the set violates {row.name}: {float(value):.9g} > {float(row.b):.9g}."
    return Outcome(FALSE, reason, place, None)


def _left(plant: LimitedPlant, vertex: int, x: Array, after: Array, excess: Any) -> Outcome:
    which = f" of vertex {vertex + 1}" if len(plant.A) > 1 else ""
    motion = Counterexample(np.arange(2.0), np.stack([x, after]).astype(float), None)
    if excess <= 0:
        return Outcome(UNDECIDED, f"the set is left{which}, by less than the digits of a root tell")
    place = Place(f"the boundary{which}", None, x.astype(float), float(excess))
    return Outcome(FALSE, "A state of the set has its successor outside.", place, motion)


def _polytope(plant: LimitedPlant, claim: TerminalClaim) -> Outcome | None:
    for row in rows(plant, claim):
        found = highest(rationals(claim.H), rationals(claim.h), row.a, row.b)
        if found.y is not None:
            continue
        if found.x is None:
            return Outcome(UNDECIDED, f"{row.name}: {found.why}")
        if row.vertex is None:
            return _violated(row, found.x, row.a @ found.x)
        A = closed(plant, claim)[row.vertex]
        excess = (row.a @ found.x - row.b) / (abs(row.b) or 1)
        return _left(plant, row.vertex, found.x, A @ found.x, excess)
    return None


class Highest(NamedTuple):
    """Whether a'x <= b on a polytope: y >= 0 that proves it, or an x of it with a'x > b."""

    y: Array | None
    x: Array | None
    why: str = ""


def highest(H: Array, h: Array, a: Array, b: Any) -> Highest:
    """Return what decides whether a'x <= b holds where H x <= h, in rationals: the rows that the
    maximum of a linear program in doubles touches.
    """
    from scipy.optimize import linprog

    n = len(a)
    if not any(a):
        return Highest(np.array([Fraction(0)] * len(h), dtype=object), None)
    numbers = H.astype(float), h.astype(float)
    found: Any = linprog(-a.astype(float), *numbers, bounds=(None, None), method="highs")
    if found.x is None:
        return Highest(None, None, "the set is not bounded, or the linear program failed")
    slack = numbers[1] - numbers[0] @ found.x
    size = np.abs(numbers[0]) @ np.abs(found.x) + numbers[1]
    tight = np.flatnonzero(slack <= TIGHT * np.where(size > 0, size, 1.0))
    weight = -np.asarray(found.ineqlin.marginals)
    tight = sorted(tight.tolist(), key=lambda k: -weight[k])
    for basis in islice(combinations(tight, n), MOST_BASES):
        own = list(basis)
        y = solve(H[own].T, a[:, None])
        if y is None or any(v < 0 for v in y[:, 0]):
            continue
        if h[own] @ y[:, 0] <= b:
            whole = np.array([Fraction(0)] * len(h), dtype=object)
            whole[own] = y[:, 0]
            return Highest(whole, None)
        x = solve(H[own], h[own][:, None])
        if x is not None and all(H @ x[:, 0] <= h):
            return Highest(None, x[:, 0])
    few = _few(H, h, a, b, tight)
    return _inner(H, h, a, b, found.x) if few is None else Highest(few, None)


def _few(H: Array, h: Array, a: Array, b: Any, tight: list[int]) -> Array | None:
    """Return y >= 0 of fewer rows than states, as of a set that is not bounded; None: not found."""
    sizes = range(1, min(len(a), len(tight) + 1))
    for basis in islice((own for k in sizes for own in combinations(tight, k)), MOST_BASES):
        own = list(basis)
        y = solve(H[own] @ H[own].T, (H[own] @ a)[:, None])
        if y is None or any(v < 0 for v in y[:, 0]) or any(H[own].T @ y[:, 0] != a):
            continue
        if h[own] @ y[:, 0] <= b:
            whole = np.array([Fraction(0)] * len(h), dtype=object)
            whole[own] = y[:, 0]
            return whole
    return None


def _inner(H: Array, h: Array, a: Array, b: Any, near: Array) -> Highest:
    """Return a point a little inside, where it has a'x > b."""
    for less in (1e-12, 1e-9, 1e-6):
        x = rationals(near * (1 - less))
        if all(H @ x <= h) and a @ x > b:
            return Highest(None, x)
    return Highest(None, None, "undecided, the set touches it to the last digits")


def _cost(plant: LimitedPlant, claim: TerminalClaim) -> Outcome | None:
    if claim.Q is None:
        return None
    P, K = rationals(claim.P), rationals(claim.K)
    stage = rationals(claim.Q) + K.T @ rationals(claim.R) @ K
    for k, A in enumerate(closed(plant, claim)):
        found = not_positive(P - A.T @ P @ A - stage)
        if found is None or found[0] == 0:
            continue
        value, x = found
        short = float(-value / (x @ P @ x))
        words = f"vertex {k + 1} (the cost falls)" if len(plant.A) > 1 else "the cost"
        place = Place(words, None, x.astype(float), short)
        more = next((f for f in FACTORS if _falls(plant, claim, 1 + f)), None)
        reason = "The terminal cost falls by less than the stage cost in one direction."
        if more is not None:
            reason += f" {1 + more!r} P as terminal cost does fall by as much."
        return Outcome(NOT_BY_THIS, reason, place)
    return None


def _falls(plant: LimitedPlant, claim: TerminalClaim, factor: float) -> bool:
    """Whether the cost falls with a multiple of P, rounded to doubles as one who follows it has."""
    P, K = rationals(factor * claim.P), rationals(claim.K)
    stage = rationals(claim.Q) + K.T @ rationals(claim.R) @ K
    forms = (not_positive(P - A.T @ P @ A - stage) for A in closed(plant, claim))
    return all(found is None or found[0] == 0 for found in forms)
