"""Motions from {V <= rho} that do not tend to zero: integrated, and again by another method."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import count
from types import SimpleNamespace
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
"""Size of a motion, in half widths of a box that holds {V <= rho} and times the range of the
coefficients there, at which it has left for good; and at which it has where the integrator cannot
go on, as in a finite escape time.
"""
SUDDEN = 1e-9
"""Part of the time of a motion in which it would grow by its own size, in a finite escape."""
TURNS, LEVEL = 8, 1e-2
"""Turns of a state from which on it circles, and how much smaller they may become, as steps of an
integrator miss a peak.
"""
CLOSE = 1e-6
"""Relative distance of an equilibrium at which a motion has come to rest."""
LONG = 100.0
"""Time of a motion, in times that the states need to move by their own size."""
MOST_RATES = 80_000
"""Values of f in all motions of a claim, beyond which no more is flown."""
NEAR = 0.05
"""Part of its first size to which a motion falls before it counts as one that tends to zero."""
METHODS = (("LSODA", 1e-9), ("Radau", 1e-8))
"""Integrators, of different families, and their relative tolerance."""
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
    rate, J, spent = compiled(f), jacobian(f), count()
    far = FAR * _range(f)
    for z in starts:
        exact = [Fraction(float(v)) for v in z]
        if value(region.V, exact) > claim.rho:
            continue
        first = _flown(rate, J, z, far, spent, *METHODS[0])
        if first is None or _flown(rate, J, z, far, spent, *METHODS[1]) is None:
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


class _Spent(Exception):
    """The work for the motions of a claim is done."""


def _range(f: Any) -> float:
    """Return the largest over the least coefficient: how far a motion may go out and come back."""
    sizes = [abs(c) for own in f for c in own.values()]
    return float(max(sizes) / min(sizes)) if sizes else 1.0


def _flown(
    rate: Callable[[Array], Array],
    J: Any,
    z: Array,
    far: float,
    spent: Iterator[int],
    method: Any,
    tolerance: float,
) -> tuple[Array, Array] | None:
    """Return (time, states) of a motion that does not tend to zero; None of one that may."""
    speed = float(np.abs(rate(z)).max())
    if speed == 0:
        return None
    horizon = LONG * float(np.abs(z).max()) / speed
    try:
        found = _integrated(rate, z, horizon, FAR, spent, method, tolerance)
        gone = len(found.t_events[0]) > 0
        if gone and far > FAR and not _sudden(rate, found):
            found = _integrated(rate, z, horizon, far, spent, method, tolerance)
            gone = len(found.t_events[0]) > 0
    except _Spent:
        return None
    escaped = gone or (found.status < 0 and _sudden(rate, found))
    # to the end of a long time it is no nearer than it began: it circles or rests elsewhere
    size = np.abs(found.y).max(axis=0)
    late = found.y[:, found.t > horizon / 2]
    stayed = found.status == 0 and late.size > 0 and np.abs(late).max(axis=0).min() >= size[0]
    stays = stayed and (_at_rest(rate, J, found.y[:, -1]) or _circles(late))
    return (found.t, found.y.T) if escaped or stays else None


def _integrated(
    rate: Callable[[Array], Array],
    z: Array,
    horizon: float,
    far: float,
    spent: Iterator[int],
    method: Any,
    tolerance: float,
) -> Any:
    """Return a motion until it is far out, near zero, or the time is over."""
    from scipy.integrate import solve_ivp

    seen: list[tuple[float, Array]] = []

    def gone(t: float, x: Array) -> float:
        seen.append((t, np.array(x)))
        return far - float(np.abs(x).max())

    def back(t: float, x: Array) -> float:
        return float(np.abs(x).max()) - NEAR * float(np.abs(z).max())

    def counted(t: float, x: Array) -> Array:
        if next(spent) > MOST_RATES:
            raise _Spent
        return rate(x)

    gone.terminal = back.terminal = True  # type: ignore[attr-defined]
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of a motion that ends in finite time
        try:
            return solve_ivp(counted, (0.0, horizon), z, method=method, rtol=tolerance,
                             atol=1e-12, events=[gone, back])  # fmt: skip
        except ValueError:  # the instant of an event is not found between two steps of an escape
            return _seen(seen, far)


def _seen(seen: Sequence[tuple[float, Array]], far: float) -> Any:
    """Return the steps of a motion up to the first one that is far out."""
    out = next((k for k, (_, x) in enumerate(seen) if np.abs(x).max() > far), None)
    kept = seen if out is None else seen[: out + 1]
    t, y = (np.array(each) for each in zip(*kept, strict=True))
    ends = [t[-1:] if out is not None else t[:0], t[:0]]
    return SimpleNamespace(t=t, y=y.T, t_events=ends, status=-1)


def _sudden(rate: Callable[[Array], Array], found: Any) -> bool:
    """Whether a motion that ends far out grows by its own size in no time."""
    x, t = found.y[:, -1], float(found.t[-1])
    size = float(np.abs(x).max())
    return size > OUT and SUDDEN * t * float(np.abs(rate(x)).max()) > size


def _at_rest(rate: Callable[[Array], Array], J: Any, x: Array) -> bool:
    """Whether an equilibrium is at x."""
    near = _newton(rate, J, x)
    return near is not None and bool(np.abs(near - x).max() <= CLOSE * np.abs(x).max())


def _circles(late: Array) -> bool:
    """Whether a state turns back and forth, to no smaller values: a motion may also creep."""
    for own in late:
        turns = np.flatnonzero(np.diff(np.sign(np.diff(own))) != 0)
        first, last = np.array_split(np.abs(own), 2)
        if len(turns) >= TURNS and last.max() >= (1 - LEVEL) * first.max() > 0:
            return True
    return False


def jacobian(f: Any) -> list[list[Any]]:
    """Return df_i/dx_j."""
    return [[derivative(own, j) for j in range(len(f))] for own in f]


def _resting(
    plant: PolynomialPlant, claim: RegionClaim, region: Region, f: Any, starts: Array
) -> Found | None:
    """Return an equilibrium of {V <= rho} other than zero, in rationals."""
    rate, J = compiled(f), jacobian(f)
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
