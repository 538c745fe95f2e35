"""Motions from {V <= rho} that do not tend to zero: integrated, and again by another method."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np

from symheli.values.arrays import Array
from synthesis.claims.contradicted import Found, motion_at_rest
from synthesis.claims.monomials import compiled, derivative, in_units, scaled, value
from synthesis.claims.plants import PolynomialPlant
from synthesis.claims.region import Region, region_of, rising
from synthesis.claims.region_claim import RegionClaim
from synthesis.claims.verdict import Counterexample
from synthesis.numerics.polynomial.spectrum import decays

STARTS = 12
"""States from which a motion is integrated."""
FAR, OUT = 1e3, 30.0
"""Size of a motion, in half widths of a box that holds {V <= rho}, at which it has left for good;
and at which it has where the integrator cannot go on, as in a finite escape time.
"""
LONG = 1e4
"""Time of a motion, in times that the states need to move by their own size."""
NEAR = 0.05
"""Part of its first size to which a motion falls before it counts as one that tends to zero."""
METHODS = (("LSODA", 1e-9), ("Radau", 1e-11))
"""Integrators, of different families, and their relative tolerance."""
MOST_STEPS = 20_000
"""Steps of an integrator after which a motion is left."""
SMALL = 10**6
"""Largest denominator, in units of the box, of an equilibrium that is tried in rationals."""


def departure(plant: PolynomialPlant, claim: RegionClaim) -> Found | None:
    """Return a motion or an equilibrium that contradicts the claim; None where none was found."""
    region = region_of(plant, claim)
    if region is None:
        return None
    f = [scaled(in_units(own, region.units), 1 / u)
         for own, u in zip(plant.fields, region.units, strict=True)]  # fmt: skip
    if all(sum(e) <= 1 for own in f for e in own):
        return None if _linear_decays(f) else _unstable(plant)
    starts = rising(plant, claim, region)[:STARTS]
    return _resting(plant, claim, region, f, starts) or _left(f, claim, region, starts)


def _linear(f: Any) -> Array:
    n = range(len(f))
    return np.array([[own.get(tuple(int(i == j) for i in n), Fraction(0)) for j in n] for own in f])


def _linear_decays(f: Any) -> bool:
    return decays(_linear(f), False)


def _unstable(plant: PolynomialPlant) -> Found:
    A = _linear(plant.fields).astype(float)
    reason = (
        "The equations are linear, and an eigenvalue does not decay: exactly, by Routh's scheme."
    )
    return Found(reason, motion_at_rest(A, None, None), None, True)


def _left(f: Any, claim: RegionClaim, region: Region, starts: Array) -> Found | None:
    rate = compiled(f)
    for z in starts:
        exact = [Fraction(float(v)) for v in z]
        if value(region.V, exact) > claim.rho:
            continue
        first = _flown(rate, z, *METHODS[0])
        if first is None or _flown(rate, z, *METHODS[1]) is None:
            continue
        time, states = first
        units = np.array([float(u) for u in region.units])
        kept = np.unique(np.linspace(0, len(time) - 1, 40).astype(int))
        motion = Counterexample(time[kept], states[kept] * units, None)
        reason = (
            f"A motion from V = {float(value(region.V, exact)):.6g} <= rho does not tend to zero:"
            f" at t = {time[-1]:.6g} it is {float(np.abs(states[-1]).max()):.2g} times as far out"
            " as {V <= rho} reaches; a second integrator agrees."
        )
        return Found(reason, motion, None, False)
    return None


def _flown(
    rate: Callable[[Array], Array], z: Array, method: str, tolerance: float
) -> tuple[Array, Array] | None:
    """Return (time, states) of a motion that does not tend to zero; None of one that may."""
    speed, first = float(np.abs(rate(z)).max()), float(np.abs(z).max())
    if speed == 0:
        return None
    horizon = LONG * first / speed
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of a motion that ends in finite time
        time, states, status = _stepped(rate, z, horizon, method, tolerance)
    size = np.abs(states).max(axis=1)
    if size[-1] <= NEAR * first:
        return None
    escaped = size[-1] >= FAR or (status == "failed" and size[-1] > OUT)
    # to the end of a long time it is no nearer than it began: it circles or rests elsewhere
    late = size[time > horizon / 2]
    stayed = status == "finished" and len(late) > 0 and bool(late.min() >= first)
    return (time, states) if escaped or stayed else None


def _stepped(
    rate: Callable[[Array], Array], z: Array, horizon: float, method: str, tolerance: float
) -> tuple[Array, Array, str]:
    """Return times and states until the motion is near zero, far out or at the horizon, and the
    status of the integrator: "running", "finished", or "failed" where it cannot go on.
    """
    from scipy import integrate

    kind: Any = getattr(integrate, method)
    solver = kind(lambda t, x: rate(x), 0.0, z, horizon, rtol=tolerance, atol=1e-12)
    times, states = [0.0], [z]
    while solver.status == "running" and len(times) < MOST_STEPS:
        solver.step()
        if not np.all(np.isfinite(solver.y)):
            return np.array(times), np.array(states), "failed"
        times.append(float(solver.t))
        states.append(solver.y.copy())
        if not NEAR * np.abs(z).max() < np.abs(solver.y).max() < FAR:
            break
    return np.array(times), np.array(states), str(solver.status)


def _resting(
    plant: PolynomialPlant, claim: RegionClaim, region: Region, f: Any, starts: Array
) -> Found | None:
    """Return an equilibrium of {V <= rho} other than zero, in rationals."""
    rate = compiled(f)
    J = [[derivative(own, j) for j in range(len(f))] for own in f]
    for z in starts:
        near = _newton(rate, J, z)
        if near is None or not np.abs(near).max() > 1e-3 * np.abs(z).max():
            continue
        x = [Fraction(float(v) * float(u)).limit_denominator(SMALL)
             for v, u in zip(near, region.units, strict=True)]  # fmt: skip
        V = claim.function(plant.states)
        if any(x) and value(V, x) <= claim.rho and not any(value(own, x) for own in plant.fields):
            numbers = np.array([float(v) for v in x])
            words = ", ".join(map(str, x))
            reason = f"x = ({words}) is an equilibrium with V = {value(V, x)} <= rho: it stays."
            motion = Counterexample(np.array([0.0, 1.0]), np.array([numbers, numbers]), None)
            return Found(reason, motion, None, True)
    return None


def _newton(rate: Callable[[Array], Array], J: Any, z: Array) -> Array | None:
    own = z.copy()
    for _ in range(50):
        slope = np.array([[value(d, list(own)) for d in row] for row in J], dtype=float)
        step = np.linalg.lstsq(slope, rate(own), rcond=None)[0]
        own = own - step
        if not np.all(np.isfinite(own)) or np.abs(own).max() > OUT:
            return None
        if np.abs(step).max() <= 1e-15 * np.abs(own).max():
            break
    return own
