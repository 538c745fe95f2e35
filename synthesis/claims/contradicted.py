"""Motions that contradict a claim about vertices or a grid.

Exact ones: a model at rest, or a product of sampled models, whose eigenvalues are not where the
claim has them, by Routh's scheme on its characteristic polynomial; a sinusoid that a model at rest
amplifies more. Computed ones: a motion of p along which the state grows, or an input, from the
search for lower bounds, flown again here by other integrators.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import islice
from typing import Any, NamedTuple, cast

import numpy as np

from symheli.values.arrays import Array
from synthesis.certify.lower_bounds.lower_bound import (
    LowerBoundSearch,
    growing_trajectory,
    lower_bound,
)
from synthesis.claims.closed_loop import ClosedLoop, FrozenLoop, frozen_loops, without_gain
from synthesis.claims.lyapunov_claim import LyapunovClaim
from synthesis.claims.plants import GridPlant, VertexPlant, rationals
from synthesis.claims.reflown import energy_ratio, growth_along
from synthesis.claims.verdict import Counterexample, Place
from synthesis.numerics.linear.norm import norm
from synthesis.numerics.polynomial.spectrum import decays, solve

SEARCH = LowerBoundSearch(
    levels=8, dwells=9, starts=2, nodes=50, evaluations=15, steps=100, samples=20_000
)
"""Effort of the search for motions of p."""
MOST_COMPARED = 20
"""Models whose pairs are looked at for a common P."""
MOST_PAIRS = 10
"""Pairs of vertices between which switching is looked at, in continuous time."""
LONGEST_PRODUCT, BEAM = 12, 60
"""Length of the products of sampled models, and how many of each length are kept."""
NEAR = 1e-7
"""Distance of an eigenvalue from the limit, over its size, from which the exact scheme is asked."""


class Found(NamedTuple):
    """A contradiction of a claim: a sentence, the motion and the place, and whether it is exact."""

    reason: str
    motion: Counterexample | None
    place: Place | None
    exact: bool


def contradiction(plant: VertexPlant | GridPlant, claim: LyapunovClaim) -> Found | None:
    """Return what shows that the claim is false; None where nothing was found."""
    stable = without_gain(claim)
    frozen = list(frozen_loops(plant, claim))
    own = _at_rest(plant, stable, frozen) or _switched(plant, stable)
    if own is not None:
        return own
    if claim.kind != "l2 gain":
        return moving(ClosedLoop.of(plant, stable)[:MOST_PAIRS], stable)
    loops = ClosedLoop.of(plant, claim)[:MOST_PAIRS]
    return _amplified(plant, claim, frozen) or moving(loops, stable) or driven(loops, claim)


def _rate(claim: LyapunovClaim, dt: float | None) -> float:
    """Return the rate of the claim, continuous; sampled the factor of a sample."""
    rate = claim.bound if claim.kind == "decay rate" else 0.0
    return rate if dt is None else math.exp(rate * dt)


def _excess(A: Array, claim: LyapunovClaim, dt: float | None) -> float:
    """Return by how much the slowest eigenvalue misses the claim, over the size of A."""
    values = np.linalg.eigvals(A)
    if dt is None:
        size = np.abs(values).max() or 1.0
        return float((values.real.max() + _rate(claim, None)) / size)
    return float(np.abs(values).max() * _rate(claim, dt) - 1)


def _spare(claim: LyapunovClaim, excess: float, size: float) -> Fraction:
    """Return the rate by which an eigenvalue has to miss the claim: some for a decay rate, which an
    eigenvalue may reach.
    """
    return Fraction(0) if claim.kind == "stability" else Fraction(max(excess, 0.0) * size / 2)


def _at_rest(
    plant: VertexPlant | GridPlant, claim: LyapunovClaim, frozen: list[FrozenLoop]
) -> Found | None:
    numbers = [loop.A.astype(float) for loop in frozen]
    excess = [_excess(A, claim, plant.dt) for A in numbers]
    for k in sorted(range(len(frozen)), key=lambda k: -excess[k])[:20]:
        if excess[k] < -NEAR or (claim.kind == "decay rate" and excess[k] <= NEAR):
            return None
        size = float(np.abs(np.linalg.eigvals(numbers[k])).max()) if plant.dt is None else 1.0
        spare = _spare(claim, excess[k], size)
        if not decays(frozen[k].shifted(claim, plant.dt, spare), plant.dt is not None):
            reason = (
                f"The plant at rest at {frozen[k].words} contradicts it: its matrix has an"
                f" eigenvalue that does not decay{_asked(claim)}, by Routh's scheme in rationals."
            )
            return Found(reason, motion_at_rest(numbers[k], frozen[k].p, plant.dt), None, True)
    return None


def _asked(claim: LyapunovClaim) -> str:
    return f" as fast as {claim.bound:.9g} 1/s" if claim.kind == "decay rate" else ""


def motion_at_rest(A: Array, p: float | None, dt: float | None) -> Counterexample:
    """Return the motion of the slowest mode of one model, over some of its own times."""
    from scipy.linalg import expm

    values, vectors = cast(Any, np.linalg.eig(A))
    k = int((values.real if dt is None else np.abs(values)).argmax())
    x = np.real(vectors[:, k])
    x = x if np.linalg.norm(x) > 1e-6 else np.imag(vectors[:, k])
    x = x / np.abs(x).max()
    pace = max(float(np.abs(values[k])), 1e-12)
    time = np.linspace(0, 10 / pace, 41) if dt is None else np.arange(41.0) * dt
    own = A if dt is None else None
    states = [
        expm(own * t) @ x if own is not None else np.linalg.matrix_power(A, i) @ x
        for i, t in enumerate(time)
    ]
    at = None if p is None else np.full(len(time), p)
    return Counterexample(time, np.array(states), at)


def _switched(plant: VertexPlant | GridPlant, claim: LyapunovClaim) -> Found | None:
    """Return a product of sampled models, of vertices or points of a grid whose p may jump, that
    does not decay.
    """
    if plant.dt is None or (isinstance(plant, GridPlant) and not math.isinf(plant.rate)):
        return None
    loops = [loop for loop in frozen_loops(plant, claim) if _listed(plant, loop)]
    best = _product([loop.A.astype(float) * _rate(claim, plant.dt) for loop in loops])
    if best is None:
        return None
    order, radius = best
    M, factor = loops[order[0]].A, _exact_factor(claim, plant.dt)
    for k in order[1:]:
        M = loops[k].A @ M
    spare = Fraction(0) if claim.kind == "stability" else Fraction(max(radius - 1, 0) / 2)
    if decays(M * (factor ** len(order) * (1 - spare)), True):
        return None
    p = np.array([loops[k].p for k in order], dtype=float)
    words = ", ".join(loops[k].words for k in order)
    reason = (
        f"The plant repeats {words}; the product of these {len(order)} models has an eigenvalue of"
        f" modulus {radius:.9g}{_asked(claim)}, so that a state does not decay: shown by Routh's"
        " scheme in rationals."
    )
    models = [loops[k].A.astype(float) for k in order]
    return Found(reason, _repeated(models, p, plant.dt), None, True)


def _listed(plant: VertexPlant | GridPlant, loop: FrozenLoop) -> bool:
    return isinstance(plant, GridPlant) or loop.p is not None


def _exact_factor(claim: LyapunovClaim, dt: float) -> Fraction:
    if claim.kind != "decay rate":
        return Fraction(1)
    exponent = claim.bound * dt
    # below exp, however the exponent and exp are rounded
    return Fraction(math.exp(exponent) * (1 - 1e-15 * (2 + exponent)))


def _product(models: list[Array]) -> tuple[tuple[int, ...], float] | None:
    """Return the order of the product whose modulus per sample is largest, with its modulus; None
    where it is below one.
    """
    kept: list[tuple[tuple[int, ...], Array]] = [((), np.eye(len(models[0])))]
    best: tuple[float, float, tuple[int, ...]] = (-math.inf, 0.0, ())
    for length in range(1, LONGEST_PRODUCT + 1):
        longer = [((*order, k), A @ M) for order, M in kept for k, A in enumerate(models)]
        ranked = []
        for order, M in longer:
            radius = float(np.abs(np.linalg.eigvals(M)).max())
            pace = radius ** (1 / length)
            best = max(best, (round(pace, 12), radius, order), key=lambda each: each[0])
            ranked.append((float(np.linalg.norm(M)) + pace, order, M))
        ranked.sort(key=lambda each: -each[0])
        kept = [(order, M) for _, order, M in ranked[:BEAM]]
        if best[0] > 1 + 1e-6:
            break
    return (best[2], best[1]) if best[0] >= 1 - NEAR else None


def _repeated(models: list[Array], p: Array, dt: float) -> Counterexample:
    M = models[0]
    for A in models[1:]:
        M = A @ M
    values, vectors = np.linalg.eig(M)
    x = np.real(vectors[:, int(np.abs(values).argmax())])
    states = [x / np.abs(x).max()]
    count = max(1, 40 // len(models))
    for A in models * count:
        states.append(A @ states[-1])
    time = dt * np.arange(len(states))
    return Counterexample(time, np.array(states), np.r_[np.tile(p, count), p[:1]])


def moving(loops: Sequence[Any], claim: LyapunovClaim) -> Found | None:
    """Return a motion of p along which the state of a loop grows."""
    for loop in loops:
        cycle = growing_trajectory(loop, loop.scheduling.limit, SEARCH)
        found = None if cycle is None else growth_along(loop, cycle)
        if cycle is None or found is None:
            continue
        growth, motion = found
        reason = (
            f"Along a cycle of p of {cycle.time[-1]:.6g} s, repeated, the state grows"
            f" {growth:.6g}-fold a cycle{_beside(claim)}; a second integrator agrees."
        )
        return Found(reason, motion, None, False)
    return None


def _beside(claim: LyapunovClaim) -> str:
    return f" beside exp(-{claim.bound:.6g} t)" if claim.kind == "decay rate" else ""


def _amplified(
    plant: VertexPlant | GridPlant, claim: LyapunovClaim, frozen: list[FrozenLoop]
) -> Found | None:
    """Return a sinusoid that a model at rest amplifies more than the claim has it, exactly."""
    best: tuple[float, float, FrozenLoop] | None = None
    for loop in frozen:
        A, B, C, D = (M.astype(float) for M in (loop.A, loop.B, loop.C, loop.D))
        gain, omega = norm(A, B, C, D, plant.dt)
        if best is None or gain > best[0]:
            best = gain, omega, loop
    if best is None or not claim.bound <= best[0] < math.inf:
        return None
    gain, omega, loop = best
    if not _above(loop, omega, claim.bound, plant.dt):
        return None
    reason = (
        f"The plant at rest at {loop.words} amplifies a sinusoid of {omega:.6g} rad/s"
        f" {gain:.9g}-fold, computed in rationals: more than {claim.bound:.9g}."
    )
    return Found(reason, None, Place(loop.words, loop.p, None, gain / claim.bound - 1), True)


def _above(loop: FrozenLoop, omega: float, bound: float, dt: float | None) -> bool:
    """Whether |G u| > bound |u| at a frequency near this one, in rational arithmetic."""
    n, one = len(loop.A), rationals(np.eye(len(loop.A)))
    if not math.isfinite(omega):
        return False
    if dt is None:
        real, imaginary = Fraction(0), Fraction(omega)
    else:
        t = Fraction(math.tan(omega * dt / 2)) if omega * dt < 3.1 else Fraction(10**9)
        real, imaginary = (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)
    u = _worst_input(loop, complex(float(real), float(imaginary)))
    left = np.block(
        [[one * real - loop.A, -one * imaginary], [one * imaginary, one * real - loop.A]]
    )
    right = np.concatenate([loop.B @ u[0], loop.B @ u[1]])[:, None]
    x = solve(left, right)
    if x is None:
        return False
    y = [loop.C @ x[:n, 0] + loop.D @ u[0], loop.C @ x[n:, 0] + loop.D @ u[1]]
    energy = sum(v @ v for v in y) - Fraction(bound) ** 2 * sum(v @ v for v in u)
    return bool(energy > 0)


def _worst_input(loop: FrozenLoop, s: complex) -> tuple[Array, Array]:
    A, B, C, D = (M.astype(float) for M in (loop.A, loop.B, loop.C, loop.D))
    G = C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D
    v = np.linalg.svd(G)[2][0].conj()
    return rationals(v.real), rationals(v.imag)


def driven(loops: Sequence[Any], claim: LyapunovClaim) -> Found | None:
    """Return an input along a motion of p whose output has more energy than the claim allows."""
    for loop in loops:
        if loop.scheduling.limit == 0:
            continue
        found = lower_bound(loop, loop.scheduling.limit, search=SEARCH)
        if found.input is None or found.trajectory is None or not found.gain > claim.bound:
            continue
        ratio, motion = energy_ratio(loop, found.trajectory, found.input)
        if ratio > claim.bound:
            reason = (
                f"An input along a motion of p gives |y|/|u| = {ratio:.6g} from rest, flown again"
                f" in steps half as long: more than {claim.bound:.9g}."
            )
            return Found(reason, motion, None, False)
    return None


def no_common(plant: VertexPlant | GridPlant, claim: LyapunovClaim) -> str:
    """Return the sentence that names two models without any common x'Px, exactly; empty where none
    were found, and for sampled models.

    With A'P + PA < 0 of two matrices all A1 + s A2^-1, s >= 0, are stable; where A1 A2 has a
    negative real eigenvalue, one of them is singular. A decay rate may be met with equality: a
    slightly slower one is met strictly.
    """
    if plant.dt is not None:
        return ""
    stable = without_gain(claim)
    listed = (own for own in frozen_loops(plant, claim) if own.p is not None)
    loops = islice(listed, MOST_COMPARED)
    shifted = [(own, own.shifted(stable, None, _slower(own.A, claim))) for own in loops]
    for i, (first, A) in enumerate(shifted):
        for second, B in shifted[:i]:
            if _has_negative_eigenvalue(A @ B):
                return (
                    f"No constant P at all proves it: the product of the models at {second.words}"
                    f" and {first.words} has a negative real eigenvalue, by a change of sign of its"
                    " characteristic polynomial in rationals."
                )
    return ""


def _slower(A: Array, claim: LyapunovClaim) -> Fraction:
    """Return a rate, small for A, of a claim that may hold with equality; 0 of another."""
    size = max(map(abs, A.ravel()))
    return Fraction(size) / 2**20 if claim.kind == "decay rate" else Fraction(0)


def _has_negative_eigenvalue(M: Array) -> bool:
    """Whether det(s - M) changes sign at some s < 0, exactly; candidates from doubles."""
    from synthesis.numerics.polynomial.spectrum import polynomial

    values: Any = np.linalg.eigvals(M.astype(float))
    real = np.sort(values[np.abs(values.imag) <= 1e-9 * np.abs(values)].real)
    real = real[real < 0]
    c = polynomial(M)
    points = [2 * real[0], *(0.5 * (real[1:] + real[:-1])), 0.5 * real[-1]] if len(real) else []
    signs = [sum(v * Fraction(float(s)) ** k for k, v in enumerate(c)) > 0 for s in points]
    return len(set(signs)) > 1
