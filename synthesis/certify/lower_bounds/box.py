"""Lower bounds over a box: frozen models all over it, and trajectories along straight lines through
it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy import linalg

from symheli import LPVStateSpace
from symheli.progress import tracked
from symheli.values.arrays import Array
from synthesis.certify.lower_bounds.frozen import FrozenGain, grid_of, worst_over
from synthesis.certify.lower_bounds.lines import Line, alone, directions, growing_on, shared
from synthesis.certify.lower_bounds.lower_bound import LowerBoundSearch, lower_bound
from synthesis.certify.lower_bounds.paths import Budget, WaveFamily, samples, steps
from synthesis.certify.lower_bounds.periodic import multiplier
from synthesis.certify.lower_bounds.supplied import frozen_level, supplied
from synthesis.certify.lower_bounds.tied import tied_lower_bound
from synthesis.certify.statement.demand import Demand
from synthesis.certify.statement.kind import L2_GAIN, STABILITY, Kind
from synthesis.certify.statement.trajectory import SchedulingTrajectory
from synthesis.numerics.linear.balance import balance
from synthesis.numerics.linear.norm import (
    gain_at_poles,
    norm,
    stable,
    surely_unstable,
    to_continuous,
)
from synthesis.numerics.polynomial.motion import Motion
from synthesis.numerics.polynomial.pieces import Pieces

Measure = Callable[[Array, Array, Array, Array], float]

WAVES = 30
"""Number of waves examined along each line for peaks and slow decay, those of the fastest growth
first; for peaks also waves of many periods.
"""


class Worst(NamedTuple):
    """The worst value of a measure and where it occurs: `p` (m,) frozen, or `trajectory`."""

    value: float
    p: tuple[float, ...] | None = None
    trajectory: SchedulingTrajectory | None = None


def measure(demand: Demand, dt: float | None) -> Measure:
    """Return the measure of a frozen model, larger is worse: its gain, or minus its decay rate
    (1/s), also for stability.
    """
    if demand.kind == L2_GAIN:
        return lambda A, B, C, D: norm(A, B, C, D, dt)[0]
    if demand.kind.indexed:
        return lambda A, B, C, D: frozen_level(A, B, C, D, dt, demand.kind)
    if demand.of_gramian:
        return lambda A, B, C, D: of_gramian(A, B, C, D, dt, demand.kind)
    return lambda A, B, C, D: -frozen_decay(A, dt)


def frozen_decay(A: Array, dt: float | None) -> float:
    """Return the decay rate of the slowest mode, 1/s; negative where it grows."""
    poles = np.linalg.eigvals(A)
    return (
        float(-poles.real.max())
        if dt is None
        else -math.log(max(float(np.abs(poles).max()), 1e-300)) / dt
    )


def of_gramian(A: Array, B: Array, C: Array, D: Array, dt: float | None, kind: Kind) -> float:
    """Return max |y(t)| over inputs of unit energy: sqrt of the largest eigenvalue of C X C' (+ D
    D'), X the controllability Gramian; of a kind of `rows` the root of its trace.

    inf where the model is not stable. Source: Rotea (1993); discrete time by the same argument.
    """
    if not stable(np.linalg.eigvals(A), dt):
        return math.inf
    d = balance(np.abs(A), B, C)
    A, B, C = A * d / d[:, None], B / d[:, None], C * d
    # the bilinear change keeps the Gramian
    F, G = (A, B) if dt is None else to_continuous(A, B, C, D)[:2]
    X = linalg.solve_continuous_lyapunov(F, -G @ G.T)
    size = C @ X @ C.T + (D @ D.T if dt is not None else 0.0)
    return math.sqrt(_size(size, kind))


def _size(covariance: Array, kind: Kind) -> float:
    """Return the largest variance in any direction, or of a kind of `rows` that of all outputs."""
    if kind.facets.rows:
        return max(float(np.trace(covariance)), 0.0)
    return max(float(np.linalg.eigvalsh(0.5 * (covariance + covariance.T)).max(initial=0.0)), 0.0)


def worst_by(demand: Demand, model: Pieces) -> Worst:
    """Return the worst frozen model by the measure of the inequality."""
    rough = partial(gain_at_poles, dt=model.dt) if demand.kind == L2_GAIN else None
    return worst_frozen(model, measure(demand, model.dt), rough)


def worst_frozen(model: Pieces, size: Measure, rough: Callable[..., Array] | None = None) -> Worst:
    """Return the worst frozen model over the box; the searches start from the highest peaks of
    `rough` on a grid, the measure of a stack of matrices or something close to it, or of `size`.
    """
    axes = _axes(model)
    free = [i for i, axis in enumerate(axes) if len(axis) > 1]

    def whole(q: Array) -> Array:
        p = np.array([axis[0] for axis in axes])
        p[free] = q
        return p

    def at(q: Array) -> float:
        return size(*(M[0] for M in model.at(whole(q)[None])))

    values = None if rough is None else rough(*model.at(grid_of(axes)))
    value, q = worst_over(at, [axes[i] for i in free], values)
    return Worst(value, tuple(map(float, whole(q))))


def unstable_at(model: Pieces, suspect: tuple[float, ...]) -> tuple[float, ...] | None:
    """Return a p, the suspect first, at which the frozen model is unstable beyond rounding; None
    where there is none on the grid.
    """
    points = np.vstack([suspect, grid_of(_axes(model))])
    return next(
        (
            tuple(map(float, p))
            for p, A in zip(points, model.at(points).A, strict=True)
            if surely_unstable(A, model.dt)
        ),
        None,
    )


def _axes(model: Pieces) -> list[Array]:
    rest = Motion.of(model.parameters).at_rest()
    count = {1: 61, 2: 15, 3: 7}.get(len(model.parameters) - len(rest), 3)
    return [
        np.array([0.0]) if i in rest else np.unique(np.r_[np.linspace(s.low, s.high, count), b])
        for i, (s, b) in enumerate(zip(model.parameters, model.breaks, strict=True))
    ]


def worst_moving(
    model: LPVStateSpace,
    demand: Demand,
    frozen: Worst,
    search: LowerBoundSearch | None,
) -> Worst:
    """Return the worst found along p that moves on lines through the box within its rates; `frozen`
    where nothing is worse.

    Gains and minus decay rates: inf (gain) or a value >= 0 (decay) means a trajectory along which
    the state grows.
    """
    best = frozen
    if demand.motion.tied:
        return worst_tied(model, demand, frozen, search)
    lines = [line for line in _lines(model, demand.rates) if line.rate > 0]
    near = frozen.p[0] if len(model.parameters) == 1 and frozen.p else 0.0
    for line, share in shared(lines, search):
        if demand.kind == L2_GAIN:
            known = FrozenGain(frozen.value, near, math.nan)
            found = lower_bound(line.model, line.rate, frozen=known, search=share)
            value, trajectory = found.gain, found.trajectory
        elif demand.kind.indexed:
            value, trajectory = supplied(line.model, line.rate, share, demand.kind)
        elif demand.of_gramian:
            value, trajectory = _peaks(line.model, line.rate, share, demand.kind)
        else:
            value, trajectory = _slowest(line.model, line.rate, share)
        if trajectory is not None and value > best.value:
            best = Worst(value, None, line.in_box(trajectory))
        if math.isinf(best.value):
            break
    return best


def growing(
    model: LPVStateSpace, demand: Demand, search: LowerBoundSearch | None
) -> SchedulingTrajectory | None:
    """Return a p(t) on such a line along which the state grows, None where none was found."""
    if demand.motion.tied:
        return worst_tied(model, demand, Worst(0.0), search).trajectory
    return growing_on(_lines(model, demand.rates), search)


def worst_tied(
    model: LPVStateSpace, demand: Demand, frozen: Worst, search: LowerBoundSearch | None
) -> Worst:
    """Return the worst found along cycles within rate and jerk limits; for gains and growth
    only.
    """
    if search is None or demand.kind not in (L2_GAIN, STABILITY):
        return frozen
    found = tied_lower_bound(model, demand.motion, search)
    if found is None or not found.gain > frozen.value:
        return frozen
    if demand.kind == STABILITY and not math.isinf(found.gain):
        return frozen
    return Worst(found.gain, None, found.trajectory)


def _peaks(
    line: LPVStateSpace, rate: float, search: LowerBoundSearch, kind: Kind
) -> tuple[float, SchedulingTrajectory | None]:
    """Return the energy-to-peak or H2 gain along waves: the Gramian of inputs held over each step,
    from rest over some cycles.
    """
    family = WaveFamily(line, rate, search)
    best: tuple[float, SchedulingTrajectory | None] = (0.0, None)
    # where A does not depend on p, growth ranks nothing
    budget = Budget(search.seconds)
    for wave in tracked("searching for peaks", (*family.coarse()[:WAVES], *family.spread())):
        if budget.over:
            break
        cycle = SchedulingTrajectory(*wave.vertices())
        system = steps(line, cycle.time, cycle.p, max(family.longest, wave.period / search.steps))
        shown = cycle if line.dt is None else samples(cycle, line.dt)
        after = np.interp(system.time[1:], *cycle) if line.dt is None else np.roll(shown.p, -1)
        C, D = line.matrices(np.clip(after, line.scheduling.low, line.scheduling.high))[2:]
        n, X, peak = system.states, np.zeros((system.states, system.states)), 0.0
        cycles = max(3, min(20, math.ceil(2 * family.slow / wave.period)))
        for k in range(cycles * len(system.step)):
            j = k % len(system.step)
            Phi, Gamma = system.step[j, :n, :n], system.step[j, :n, n:]
            X = Phi @ X @ Phi.T + Gamma @ Gamma.T
            size = C[j] @ X @ C[j].T + (D[j] @ D[j].T if line.dt is not None else 0.0)
            peak = max(peak, _size(size, kind))
        # the time steps are good to about 1e-4
        value = math.sqrt(peak) * (1 - 1e-4 * (line.dt is None))
        if value > best[0]:
            best = value, shown
    return best


def _slowest(
    line: LPVStateSpace, rate: float, search: LowerBoundSearch
) -> tuple[float, SchedulingTrajectory | None]:
    """Return minus the slowest decay, 1/s, over whole cycles of waves, by Floquet multipliers, less
    the error of the time steps.
    """
    family = WaveFamily(line, rate, search)
    best: tuple[float, SchedulingTrajectory | None] = (-math.inf, None)
    budget = Budget(search.seconds)
    for wave in tracked("searching for slow decay", family.coarse()[:WAVES]):
        if budget.over:
            break
        cycle = SchedulingTrajectory(*wave.vertices())
        longest = max(family.longest, wave.period / search.steps)
        rates = [
            math.log(max(multiplier(steps(line, cycle.time, cycle.p, longest / finer)), 1e-300))
            / wave.period
            for finer in ((2, 4) if line.dt is None else (1, 1))
        ]
        value = rates[1] - abs(rates[1] - rates[0])
        if value > best[0]:
            best = value, cycle if line.dt is None else samples(cycle, line.dt)
    return best


def _lines(model: LPVStateSpace, rates: Sequence[float]) -> Iterator[Line]:
    """Yield the diagonals and axes of the box as models of one parameter within the rates."""
    if len(model.parameters) == 1:
        yield Line(model.with_rate(rates[0]), rates[0], lambda p: p)
        return
    model = model.with_rate(rates)
    low, high = np.array(model.box).T
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    for d in directions(len(low)):
        rate = min(r / h for r, h, used in zip(rates, half, d, strict=True) if used)
        own = model.along(middle - d * half, middle + d * half).with_rate(rate)
        yield Line(own, rate, lambda s, d=d: alone(middle + np.multiply.outer(s, d * half)))
