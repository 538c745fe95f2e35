"""Whether V proves that {V <= rho} is a region of attraction of x' = f(x), in exact arithmetic.

It is one where {V <= rho} is bounded and V > 0 > dV/dt at every x of it other than zero. Nothing
more is needed: every component of {V <= rho} holds a least V, and dV/dx is zero there, so that it
is x = 0; there is one component, no motion leaves it, and every motion in it tends to zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.claims.monomials import Monomials, added, along, compiled, in_units, scaled, value
from synthesis.claims.plants import PolynomialPlant
from synthesis.claims.polar import (
    FAILS,
    MOST_CELLS,
    TOUCHES,
    Open,
    faces,
    first_open,
    inside,
    outside,
)
from synthesis.claims.region_claim import RegionClaim
from synthesis.claims.verdict import NOT_BY_THIS, PROVEN, UNDECIDED, Place

RAYS = 100
"""Directions along which the size of {V <= rho} is looked up."""
ROOM = (Fraction(17, 16), Fraction(2), Fraction(8))
"""Factors of that size that are tried for a box that holds it."""
MOST_COEFFICIENTS, MOST_WORK = 300_000, 60_000_000
"""Bernstein coefficients of a polynomial, and of all boxes together, beyond which nothing more is
looked at.
"""
ROUNDS = 12
"""Bisections of the level that V does prove."""
FEWER = 1000
"""Boxes that are looked at for each of them."""


class Region(NamedTuple):
    """V and dV/dt in units of a box that is shown to hold {V <= rho}."""

    V: Monomials
    slope: Monomials
    units: tuple[Fraction, ...]


def holds(plant: PolynomialPlant, claim: RegionClaim) -> bool:
    """Whether the claim is proven by its V, in rational arithmetic."""
    return judged(plant, claim)[0] == PROVEN


def judged(
    plant: PolynomialPlant, claim: RegionClaim, cells: int = MOST_CELLS
) -> tuple[str, str, Place | None]:
    """Return the answer about this V alone, the reason and the place."""
    n, size = len(plant.states), coefficients(plant, claim)
    if size > MOST_COEFFICIENTS:
        return UNDECIDED, TOO_LARGE, None
    region = region_of(plant, claim)
    if region is None:
        return UNDECIDED, UNBOUNDED, None
    seen = _sampled(plant, claim, region)
    if seen is not None:
        return NOT_BY_THIS, RISES, seen
    if not region.slope:
        return UNDECIDED, "dV/dt is zero everywhere: V does not fall. Another V would decide", None
    left = min(cells, MOST_WORK // size)
    for face in faces(n):
        found, looked = first_open(_tensors(region, claim.rho, face), _settled, _at_corner, left)
        left -= looked
        if found is None:
            continue
        x = face.point(found.point, region.units)
        if found.certain:
            return NOT_BY_THIS, RISES, _place(plant, claim, x)
        return UNDECIDED, _open(found, x), None
    return PROVEN, "", None


def coefficients(plant: PolynomialPlant, claim: RegionClaim) -> int:
    """Return the most Bernstein coefficients of a polynomial that is looked at."""
    V = claim.function(plant.states)
    F = [*V, *along(V, plant.fields)]
    sizes = sorted(max(e[i] for e in F) + 1 for i in range(len(plant.states)))
    return math.prod(sizes[1:]) * (max(map(sum, F)) + 1)


TOO_LARGE = (
    "the polynomials have too many Bernstein coefficients for this exact check. Fewer states, or a"
    " lower degree, would decide"
)
UNBOUNDED = (
    "no box was shown to hold {V <= rho}: it may be unbounded. A V whose highest terms are positive"
    " in every direction would decide"
)
RISES = "V is not positive, or does not fall, at a state of {V <= rho}."


def _open(found: Open, x: Sequence[Fraction]) -> str:
    near = "[" + ", ".join(f"{float(v):.6g}" for v in x) + "]"
    if found.point[-1] < Fraction(1, 1000):
        return (
            f"undecided next to zero, in the direction {near}: the lowest terms of V or of -dV/dt"
            " are not positive there. A V whose dV/dt is negative, not just semidefinite, would"
            " decide"
        )
    return (
        f"undecided near x = {near}: dV/dt is zero there or nearly so. Where it is zero, V does not"
        " rise, and whether it falls on is not looked at. A smaller rho or another V would decide"
    )


def _tensors(region: Region, rho: Fraction, face: Any) -> list[Array]:
    """Return V over its lowest power of r, -dV/dt likewise, and V - rho."""
    n = len(region.units)
    level = added(region.V, {(0,) * n: -rho})
    fall = scaled(region.slope, Fraction(-1))
    return [inside(region.V, face), inside(fall, face), inside(level, face, lowered=False)]


def _settled(positive: list[bool]) -> bool:
    V, fall, beyond = positive
    return beyond or (V and fall)


def _at_corner(signs: list[int], point: tuple[Fraction, ...]) -> int:
    V, fall, beyond = signs
    if point[-1] == 0 or beyond > 0:
        return 0
    return FAILS if V <= 0 or fall < 0 else TOUCHES if fall == 0 else 0


def _below(signs: list[int], point: tuple[Fraction, ...]) -> int:
    return FAILS if signs[0] <= 0 else 0


def region_of(plant: PolynomialPlant, claim: RegionClaim) -> Region | None:
    """Return V and dV/dt in units of a box that is shown to hold {V <= rho}, None where none is."""
    V = claim.function(plant.states)
    slope = along(V, plant.fields)
    size = _size(V, claim.rho, len(plant.states))
    if size is None:
        return None
    for room in ROOM:
        units = tuple(v * room for v in size)
        own = in_units(V, units)
        if _held(own, claim.rho):
            return Region(own, in_units(slope, units), units)
    return None


def _held(V: Monomials, rho: Fraction) -> bool:
    """Whether V > rho everywhere outside the unit box, in rational arithmetic."""
    n = len(next(iter(V)))
    beyond = added(V, {(0,) * n: -rho})
    for face in faces(n):
        found, _ = first_open([outside(beyond, face)], all, _below, 2000)
        if found is not None:
            return False
    return True


def _size(V: Monomials, rho: Fraction, n: int) -> tuple[Fraction, ...] | None:
    """Return rationals near the largest |x_i| in {V <= rho}, from rays; None where a ray never
    leaves it.
    """
    axes = [_reach(V, rho, np.eye(n)[i]) for i in range(n)]
    if None in axes:
        return None
    scale = np.array(axes, dtype=float)
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(RAYS, n)) * scale
    most = scale.copy()
    for d in directions:
        r = _reach(V, rho, d)
        if r is None:
            return None
        most = np.maximum(most, r * np.abs(d))
    return tuple(_round(v) for v in most)


def _round(v: float) -> Fraction:
    """Return v in few binary digits."""
    mantissa, exponent = np.frexp(v)
    return Fraction(round(float(mantissa) * 256), 256) * Fraction(2) ** int(exponent)


def _reach(V: Monomials, rho: Fraction, d: Array) -> float | None:
    """Return the largest r with V(r d) = rho, None where there is none."""
    most = max(map(sum, V))
    c = np.zeros(most + 1)
    for e, own in V.items():
        c[sum(e)] += float(own / rho) * float(np.prod(d ** np.array(e)))
    c[0] = -1.0
    # r in units in which the terms are about one
    sizes = [abs(v) ** (1 / k) for k, v in enumerate(c) if k and v]
    if not sizes:
        return None
    unit = 1 / max(sizes)
    roots: Any = np.roots((c * unit ** np.arange(most + 1))[::-1])
    real = roots[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)].real
    return float(real.max()) * unit if len(real) else None


def samples(region: Region, rho: Fraction, count: int = RAYS) -> Array:
    """Return states (K, n) of {V <= rho}, in units of the box: on rays, up to the level."""
    n, rng = len(region.units), np.random.default_rng(1)
    found = []
    for d in [*np.eye(n), *-np.eye(n), *rng.normal(size=(count, n))]:
        r = _reach(region.V, rho, d)
        if r is not None:
            found += [r * (1 - 1e-12) * share * d for share in (1.0, 0.98, 0.9, 0.7, 0.4)]
    return np.array(found).reshape(-1, n)


def rising(plant: PolynomialPlant, claim: RegionClaim, region: Region) -> Array:
    """Return states (K, n) of {V <= rho}, in units of the box, the ones where V rises fastest
    first.
    """
    z = samples(region, claim.rho)
    return z[np.argsort(-compiled([region.slope])(z)[:, 0])]


def _sampled(plant: PolynomialPlant, claim: RegionClaim, region: Region) -> Place | None:
    """Return a state of {V <= rho} at which V rises, found in doubles and checked exactly."""
    for z in rising(plant, claim, region)[:3]:
        own = [Fraction(float(v)) for v in z]
        V, slope = value(region.V, own), value(region.slope, own)
        if any(own) and claim.rho >= V and (V <= 0 or slope > 0):
            x = [u * v for u, v in zip(region.units, own, strict=True)]
            return _place(plant, claim, x)
    return None


def _place(plant: PolynomialPlant, claim: RegionClaim, x: Sequence[Fraction]) -> Place:
    V = claim.function(plant.states)
    slope = along(V, plant.fields)
    level, rise = value(V, x), value(slope, x)
    terms = sum((abs(c * _power(x, e)) for e, c in slope.items()), Fraction(0))
    words = f"V = {float(level):.6g}, dV/dt = {float(rise):.6g}"
    short = float(rise / terms) if terms else 0.0
    return Place(words, None, np.array([float(v) for v in x]), short)


def _power(x: Sequence[Fraction], e: Sequence[int]) -> Fraction:
    found = Fraction(1)
    for v, k in zip(x, e, strict=True):
        found *= v**k
    return found


def proven_level(plant: PolynomialPlant, claim: RegionClaim) -> float:
    """Return the largest level that V is found to prove, to about 1e-4 of itself; NaN where none
    is.
    """
    good, bad = None, claim.rho
    for _ in range(ROUNDS):
        middle = Fraction(float((good + bad) / 2 if good is not None else bad / 4))
        if judged(plant, claim.at_level(middle), FEWER)[0] == PROVEN:
            good = middle
        else:
            bad = middle
    return float("nan") if good is None else float(good)
