"""The search for X(p), Y(p) and gains: which of them depends on p and of what degree, and the
distance from the least gamma, in a fixed order.

If X and Y both depend on p the controller neglects dp/dt. With N = -X its state estimates that of
the plant, and

    V = e' X e + x_k' (Y - X^-1)^-1 x_k,  e = x - x_k,

is the storage function that X and Y promise. Of the controller only the term -dX/dt X^-1 of A_k is
left out (`recovery`), so V proves the loop for a gamma that is larger the faster p moves.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symheli import Scheduling
from symheli.lpv.bases.function_space import tensor_grid
from symheli.progress import tracked
from symheli.values.arrays import Array
from synthesis.certify.statement.outcome import Attempt
from synthesis.design.lpv.existence import MATRIX_BOUNDS, Divisions, Existence, Solution
from synthesis.design.lpv.fitted import Fitted, cut_to_serve, fits
from synthesis.design.lpv.scaled_plant import ScaledPlant, scaled_plant_of
from synthesis.design.lpv.worst_optimum import FrozenOptimum
from synthesis.numerics.linear.norm import below
from synthesis.numerics.program.bases import DEGREES, Bases, used
from synthesis.numerics.program.cone_program import Solver

if TYPE_CHECKING:
    from synthesis.design.plant.plant import Plant


BACK_OFF = (1.02, 1.04, 1.01, 1.1, 1.2, 1.5)
"""Multiples of the least gamma at which X and Y are fixed, tried in turn."""
LEVEL_TOLERANCE = 1e-6
"""Relative excess of a frozen gain over the promised one that counts as rounding."""
UNKEPT = "frozen loops do not keep it"
RATE_UNMEASURED = "p moves too fast for gains without a measurement of dp/dt"
SHARP = "frozen loops keep it, no functions of p do"
FAR_ABOVE = 1.05
"""Ratio to the least gamma above which a note reports it, in proportion for a larger requested
back-off; before it, gains that change steeply become splines with as many knots as needed.
"""
MAX_RATE_LOSS = 1.05
"""Largest factor by which neglecting dp/dt in the gains may raise gamma."""
HOPELESS_RATE_LOSS = 1.1
"""Factor above which no other X and Y of this gamma are tried: they all vary about as fast with p.
"""
MAX_MISFIT = 0.3
"""Relative misfit above which functions of p are not considered."""
ACCURACY = 3e-3
"""Accuracy of the functions of p fitted to the gains, relative, entry by entry."""
POLYNOMIAL_MISFIT = 2e-2
"""Relative misfit up to which polynomials are preferred to splines."""
CHECK_POINTS = {1: 97, 2: 7}
"""Values of each parameter at which frozen loops are checked, in addition to those at which the
inequalities were imposed (more parameters: 3).
"""
CLOSE_TO_OPTIMUM = 1.01
"""Ratio of gamma to a lower bound for every controller up to which no further program is solved."""
NOTHING_KNOWN = FrozenOptimum()
MIN_IMPROVEMENT = 0.995
"""Factor by which a richer program must lower gamma to be preferred."""
MAX_UNIT_RATIO = 30.0
"""Ratio of gamma to the unit of performance beyond which the unit is changed."""


Gains = Callable[[Array], Array]
Loop = Callable[[ScaledPlant, Gains, Array], tuple[Array, ...]]
"""A, B, C, D (K, ..) of the loop to check, at p (K, m)."""


class Start(NamedTuple):
    """The least gamma of a shape; the plant of `existence` may have fewer states than `scaled`."""

    scaled: ScaledPlant
    existence: Existence
    found: Solution
    shape: Bases

    @property
    def gamma(self) -> float:
        """Gamma in the units of the plant; inf where none was found."""
        return self.scaled.channel * self.found.gamma


@dataclass(frozen=True, eq=False)
class ScaledDesign:
    """X and Y with the gamma they hold for, in these coordinates; `fit` are the gains (K, ..) at p
    (K, m), scaled, as functions of p.
    """

    scaled: ScaledPlant
    existence: Existence
    found: Solution
    fit: Fitted

    @property
    def gamma(self) -> float:
        """Gamma in the units of the plant."""
        return self.found.gamma * self.scaled.channel


Recover = Callable[[ScaledPlant, Existence, Solution], Gains]


def best(
    plant: Plant,
    every: Callable[[int], Sequence[Bases]],
    divisions: Divisions,
    solver: Solver,
    attempts: list[Attempt],
    worst: FrozenOptimum = NOTHING_KNOWN,
    states: int | None = None,
    bound: float = math.inf,
) -> Start:
    """Return the shape of the least gamma: of the lowest degree first, then of higher degrees while
    that lowers it, then with a larger bound on X and Y where the bound is active; for the first
    `states` of the scaled plant (default: all). No controller has a gamma below the `worst` frozen
    optimum. A shape is given up once its gamma is known not to be `MIN_IMPROVEMENT` below the least
    before it, at first `bound`.
    """
    floor = worst.level
    channel = floor if 0 < floor < math.inf else 1.0
    degrees = DEGREES.get(len(plant.parameters), (2,))
    starts: list[Start] = []

    def tried(
        shape: Bases, above: float, unit: float = channel, largest: float = MATRIX_BOUNDS[0]
    ) -> Start:
        return least(
            plant,
            shape,
            divisions,
            solver,
            attempts,
            unit,
            worst.p,
            above=above,
            largest=largest,
            states=states,
        )

    for shape in every(degrees[0]):
        lowest = min((each.gamma for each in starts), default=bound)
        starts.append(tried(shape, MIN_IMPROVEMENT * lowest))
        if starts[-1].gamma <= CLOSE_TO_OPTIMUM * floor:
            break
    chosen = min(range(len(starts)), key=lambda k: starts[k].gamma)
    start = starts[chosen]
    if math.isfinite(bound) and not math.isfinite(start.gamma):
        return start

    def worth(other: Start) -> bool:
        return other.gamma < MIN_IMPROVEMENT * start.gamma

    for degree in degrees[1:]:
        shape = every(degree)[chosen]
        if start.gamma <= CLOSE_TO_OPTIMUM * floor or shape.size == start.shape.size:
            break
        richer = tried(shape, MIN_IMPROVEMENT * start.gamma)
        more = worth(richer)
        start = richer if richer.gamma < start.gamma else start
        if not more and math.isfinite(start.gamma):
            break
    for largest in MATRIX_BOUNDS[1:]:
        if start.gamma <= CLOSE_TO_OPTIMUM * floor or not start.existence.bounded(start.found):
            break
        if not start.existence.could_fall(start.found, largest, MIN_IMPROVEMENT, solver):
            break
        wider = tried(start.shape, math.inf, start.gamma, largest)
        if not worth(wider):
            break
        start = wider
    return start


def least(
    plant: Plant,
    shape: Bases,
    divisions: Divisions,
    solver: Solver,
    attempts: list[Attempt],
    channel: float = 1.0,
    p: Array | None = None,
    *,
    above: float = math.inf,
    largest: float = MATRIX_BOUNDS[0],
    states: int | None = None,
) -> Start:
    """Return the least gamma of a shape, in a suitable unit of performance, at first `channel`; the
    inequalities are imposed at this p (m,), too, on the first `states` of the scaled plant. It is
    inf where it is not below `above`.
    """
    for _ in tracked(f"least gamma, {shape}", range(3)):
        own = scaled_plant_of(plant, channel)
        fewer = own if states is None else own.first(states)
        existence = Existence(fewer, shape.X, shape.Y, divisions, largest, p)
        found = existence.least_gamma(solver, above / channel)
        gamma = channel * found.gamma
        attempts.append(Attempt(f"least gamma, {shape}", 0.0, found.message, gamma))
        if not math.isfinite(found.gamma) or 1 / MAX_UNIT_RATIO < found.gamma < MAX_UNIT_RATIO:
            break
        channel = gamma
    return Start(own, existence, found, shape)


def settled(
    start: Start,
    back_off: Sequence[float],
    recover: Recover,
    solver: Solver,
    attempts: list[Attempt],
    loop: Loop | None = None,
    neglecting: bool = False,
) -> Iterator[ScaledDesign]:
    """Yield designs at these multiples of the least gamma, whose frozen `loop` keeps the level with
    the gains as functions of p; `neglecting`: the gains do not depend on dp/dt, which may raise
    gamma by `MAX_RATE_LOSS` at most.
    """
    scaled, existence, lowest, _ = start
    if not math.isfinite(lowest.gamma):
        return
    of_loop = loop or closed
    sharp: dict[float, tuple[Solution, Gains]] = {}

    def noted(factor: float, message: str, outcome: str) -> None:
        gamma = factor * lowest.gamma * scaled.channel
        attempts.append(Attempt(f"back-off {factor:g}", 0.0, f"{message}, {outcome}", gamma))

    def by_splines() -> Iterator[ScaledDesign]:
        while sharp:
            factor = max(sharp)
            found, gains = sharp.pop(factor)
            design, outcome = _tried(start, found, gains, of_loop, neglecting, with_knots)
            noted(factor, "knots added", outcome)
            if design is not None:
                yield design

    for factor in tracked("backing off", back_off):
        if factor > FAR_ABOVE:
            yield from by_splines()
        gamma = factor * lowest.gamma
        for found in tracked(f"at {factor:g} of the least gamma", existence.widest(gamma, solver)):
            design, outcome = None, UNKEPT
            # X and Y of a solver that stopped short may be nothing, or not positive
            with contextlib.suppress(np.linalg.LinAlgError):
                if np.any(found.coefficients):
                    gains = recover(existence.plant, existence, found)
                    design, outcome = _tried(start, found, gains, of_loop, neglecting, simplest)
                    if outcome == SHARP:
                        sharp.setdefault(factor, (found, gains))
            noted(factor, found.message, outcome)
            if design is not None:
                yield design
            if design is not None or outcome.startswith(RATE_UNMEASURED):
                break
    yield from by_splines()


def _tried(
    start: Start,
    found: Solution,
    gains: Gains,
    loop: Loop,
    neglecting: bool,
    fit_of: Callable[[ScaledPlant, Gains, Loop, Array, float], Fitted | None],
) -> tuple[ScaledDesign | None, str]:
    """Return the design of these gains, None where their loop does not keep gamma; and the outcome
    in words.
    """
    scaled, existence, *_ = start
    reached = found.gamma
    points = existence.points
    if not existence.fixed:
        points = check_points(existence.plant.parameters, points)
    if neglecting:
        looped = closed(existence.plant, gains, points)
        reached = max(reached, level_kept(existence.plant, existence, found, looped, points))
    further = reached / found.gamma
    if further > MAX_RATE_LOSS:
        outcome = RATE_UNMEASURED if further > HOPELESS_RATE_LOSS else "as dp/dt is not known"
        return None, f"{outcome}, {further:.3g} times as much"
    if not all(kept(scaled, gains, loop, points, reached * (1 + LEVEL_TOLERANCE))):
        return None, UNKEPT
    fit = fit_of(scaled, gains, loop, points, reached)
    if fit is None:
        return None, SHARP
    outcome = f"frozen loops keep it, functions of p within {fit.misfit:.1e}"
    return ScaledDesign(scaled, existence, found._replace(gamma=reached), fit), outcome


def simplest(
    scaled: ScaledPlant, gains: Gains, loop: Loop, points: Array, gamma: float
) -> Fitted | None:
    """Return the simplest functions that are accurate and keep gamma, else the most accurate that
    keep it, splines only where polynomials are far off; None without any.
    """
    every = list(fits(gains, scaled.parameters))
    polynomials = [fit for fit in every if fit.basis.degrees]
    near = any(fit.misfit <= POLYNOMIAL_MISFIT for fit in polynomials)
    accurate = [fit for fit in every if fit.misfit <= ACCURACY]
    rest = [fit for fit in (polynomials if near else every) if ACCURACY < fit.misfit <= MAX_MISFIT]
    for fit in (*accurate, *sorted(rest, key=lambda fit: fit.misfit)):
        if all(kept(scaled, fit, loop, points, gamma * (1 + LEVEL_TOLERANCE))):
            return fit
    return None


def with_knots(
    scaled: ScaledPlant, gains: Gains, loop: Loop, points: Array, gamma: float
) -> Fitted | None:
    """Return splines of one parameter, with knots added where gamma would not be kept without; None
    where the refinement does not end.
    """
    if len(scaled.parameters) != 1:
        return None
    limit = gamma * (1 + LEVEL_TOLERANCE)

    def serves(fit: Fitted, p: Array) -> Array:
        return np.fromiter(kept(scaled, fit, loop, p, limit), bool, len(p))

    fit = cut_to_serve(gains, scaled.parameters[0], serves)
    return fit if fit is not None and serves(fit, points).all() else None


def check_points(parameters: Sequence[Scheduling], more: Array | None = None) -> Array:
    """Return the points (K, m) at which frozen loops are checked, with `more`; a parameter that is
    the rate of another is zero there.
    """
    count = CHECK_POINTS.get(len(parameters), 3)
    p = tensor_grid([np.linspace(s.low, s.high, count) for s in parameters])
    p = p if more is None else np.vstack([p, more])
    rates = [s.name in {other.rate for other in parameters} for s in parameters]
    low, high = np.array([(s.low, s.high) for s in parameters]).T
    p[:, rates] = np.clip(0.0, low, high)[rates]
    return np.unique(p, axis=0)


def kept(scaled: ScaledPlant, gains: Gains, loop: Loop, p: Array, gamma: float) -> Iterator[bool]:
    """Yield for each p (K, m), scaled, whether the frozen loop is stable and its gain below
    gamma.
    """
    for A, B, C, D in zip(*loop(scaled, gains, p), strict=True):
        yield below(A, B, C, D, gamma, scaled.dt)


def closed(scaled: ScaledPlant, gains: Gains, p: Array) -> tuple[Array, ...]:
    """Return the plant under [A B; C D]."""
    plants, K = scaled.at(p), gains(p)
    k = K.shape[-1] - plants.C2.shape[-2]
    return plants.closed(K[:, :k, :k], K[:, :k, k:], K[:, k:, :k], K[:, k:, k:])


def level_kept(
    scaled: ScaledPlant,
    existence: Existence,
    found: Solution,
    loop: tuple[Array, ...],
    p: Array,
) -> float:
    """Return the least gamma, scaled, for which V proves the loop A, B, C, D (K, ..) at every p (K,
    m) and extreme dp/dt; inf where there is none.
    """
    X, Y = existence.X, existence.Y
    assert X is not None  # noqa: S101 - both move
    assert Y is not None  # noqa: S101
    x, y = (u.at(found.coefficients, p) for u in (X, Y))
    back = np.linalg.inv(x)
    w = np.linalg.inv(y - back)
    worst = 0.0
    matters = [a or b for a, b in zip(used(X.basis), used(Y.basis), strict=True)]
    for motion in scaled.motions(p, matters):
        dx, dy = (u.moving(found.coefficients, p, motion) for u in (X, Y))
        dw = -w @ (dy + back @ dx @ back) @ w
        worst = max(worst, _least_level(loop, _joined(x, w), _joined(dx, dw)))
    return worst


def _joined(x: Array, w: Array) -> Array:
    """Return [x -x; -x x + w] (K, 2n, 2n)."""
    return np.concatenate(
        [np.concatenate([x, -x], axis=2), np.concatenate([-x, x + w], axis=2)], axis=1
    )


def _least_level(loop: tuple[Array, ...], P: Array, moving: Array) -> float:
    """Return the least g of [A'P + PA + dP/dt, PB, C'; B'P, -g, D'; C, D, -g] <= 0, in coordinates
    where P is the identity.
    """
    A, B, C, D = loop
    try:
        R = np.linalg.inv(np.linalg.cholesky(P))
    except np.linalg.LinAlgError:
        return math.inf
    T = np.swapaxes(R, 1, 2)
    PA = R @ P @ A @ T
    flow = PA + np.swapaxes(PA, 1, 2) + R @ moving @ T
    into, out = R @ P @ B, C @ T
    values, vectors = np.linalg.eigh(flow)
    if not values.max() < 0:
        return math.inf
    sides = np.concatenate([np.swapaxes(into, 1, 2), out], axis=1) @ vectors
    nw, nz = B.shape[2], C.shape[1]
    corner = np.zeros((len(A), nw + nz, nw + nz))
    corner[:, :nw, nw:], corner[:, nw:, :nw] = np.swapaxes(D, 1, 2), D
    size = corner + (sides / -values[:, None, :]) @ np.swapaxes(sides, 1, 2)
    return float(np.linalg.eigvalsh(size).max())
