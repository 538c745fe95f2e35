"""Robust output feedback whose goal is the worst-case gain: descent on the gain of the worst
members, from a controller of D-K iteration on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import linalg

from symheli import LFT, LinearModel
from symheli.errors import InputError
from symheli.lpv import connect
from symheli.progress import task
from symheli.values.arrays import Array
from symheli.values.summary import summarized
from synthesis.design.plant.generalized import Generalized, sampled_controller
from synthesis.design.tuning.descent import Point, bfgs
from synthesis.design.tuning.peaks import Active, LoopPeaks, Value, gathered
from synthesis.numerics.linear.norm import to_continuous
from synthesis.robust.design_plant import MAX_PROVEN_STATES, Asked, DesignPlant
from synthesis.robust.members import first_members, of_member
from synthesis.robust.worst_case_gain import WorstCaseGain, worst_case_gain, worst_member

STEPS, STANDSTILL = 400, 1e-6
"""Steps of BFGS at most from each set of members, and its standstill."""
STABILISING = 200
"""Steps of BFGS at most on the pole, where a first controller does not stabilise all members."""
ROUNDS = 12
"""How often a worst member is added."""
NEAR = 2e-4
"""Relative excess of the worst member over those of the search that counts as none."""
WIDER = 2
"""States by which a controller is made larger."""
GAINED = 2e-3
"""Relative decrease of the worst gain for which more states are kept."""
LARGER = 1
"""How often a controller is made larger."""
CELLS = 32
"""Parts of the ranges in which the gain is proven, at most."""
PACES, APART = (1.0, 1.3, 0.77, 1.7, 0.6), 0.1
"""Paces of the clock in mean paces, and the relative distance from poles that is enough."""
DECAY, READ = 0.3, 0.02
"""Sizes of the first random entries of new states: among each other, and where they are read."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FullLoops(LoopPeaks):
    """Members around a controller of which every entry is free, from sample to sample of a
    bilinear clock: there the entries of controllers of any speed are of one size.
    """

    shape: tuple[int, int]

    @classmethod
    def of(cls, members: Sequence[Generalized], states: int, clock: Clock) -> FullLoops:
        """Return the loops of members and a controller of so many states."""
        order = max(len(P.A) for P in members)
        wide = [_with_delays(_of_order(clock.plant(P), order), states) for P in members]
        P = Generalized(*(np.stack(each) for each in zip(*wide, strict=True)))
        channel = np.arange(P.B1.shape[-1]), np.arange(P.C1.shape[-2]), 1.0
        shape = P.B2.shape[-1], P.C2.shape[-2]
        return cls(open=gathered(P), channels=(channel,), dt=1.0, shape=shape)

    def matrix(self, x: Array) -> Array:
        """The one matrix (A B; C D) of the controller for every member."""
        return np.broadcast_to(x.reshape(self.shape), (len(self.open.A), *self.shape))

    def pulled(self, condition: int, left: Array, right: Array) -> Array:
        """See `LoopPeaks.pulled`."""
        return np.real(np.outer(left, right)).ravel()


def _of_order(P: Generalized, order: int) -> Generalized:
    """Return a sampled plant with more states, that are zero and take no part."""
    more = order - len(P.A)
    tall, wide = ((0, more), (0, 0)), ((0, 0), (0, more))
    return P._replace(
        A=np.pad(P.A, (0, more)),
        B1=np.pad(P.B1, tall),
        B2=np.pad(P.B2, tall),
        C1=np.pad(P.C1, wide),
        C2=np.pad(P.C2, wide),
    )


def _with_delays(P: Generalized, states: int) -> Generalized:
    """Return a sampled plant with so many delays, whose inputs are controls and whose states are
    measured: a constant gain on it is a controller of that order.
    """
    n, k = len(P.A), states
    eye = np.eye(k)

    def corner(M: Array, first: Array) -> Array:
        return np.block(
            [
                [first, np.zeros((len(first), M.shape[1]))],
                [np.zeros((len(M), first.shape[1])), M],
            ]
        )

    left = np.zeros((n, k))
    return Generalized(
        np.block([[P.A, left], [left.T, 0 * eye]]),
        np.vstack([P.B1, np.zeros((k, P.B1.shape[1]))]),
        np.block([[left, P.B2], [eye, np.zeros((k, P.B2.shape[1]))]]),
        np.hstack([P.C1, np.zeros((len(P.C1), k))]),
        np.block([[left.T, eye], [P.C2, np.zeros((len(P.C2), k))]]),
        P.D11,
        np.hstack([np.zeros((len(P.D12), k)), P.D12]),
        np.vstack([np.zeros((k, P.D21.shape[1])), P.D21]),
        corner(P.D22, 0 * eye),
    )


@dataclass(frozen=True, eq=False)
class GainDesign:
    """A controller u = K y with the worst-case gain of its loop over all constant parameters and
    blocks as they are stated.

    Parameters
    ----------
    controller : LinearModel or None
        K from measurements to controls, with positive feedback; None where no design was found.
    gain : WorstCaseGain or None
        Both bounds of the loop with their proof, a statement that is saved and verified by itself;
        None of a loop of more than 24 states, and without a controller.
    levels : tuple of float
        Worst gains found, of each controller that was better than those before.
    reasons : tuple of str
        Why there is no controller.
    loop : LFT, optional
        The closed loop, of which `gain` is.
    """

    controller: LinearModel | None
    gain: WorstCaseGain | None
    levels: tuple[float, ...]
    reasons: tuple[str, ...] = ()
    loop: LFT | None = None

    __repr__ = summarized

    @classmethod
    def proven(cls, asked: Asked, K: LinearModel, levels: tuple[float, ...]) -> GainDesign:
        """Return the design of a controller, with the proof of its loop."""
        model, controls, measurements, blocks = asked
        w = [u for u in model.inputs if u not in controls]
        z = [y for y in model.outputs if y not in measurements]
        loop = connect(model, K, inputs=w, outputs=z)
        small = len(loop.states) <= MAX_PROVEN_STATES
        gain = worst_case_gain(loop, blocks, cells=CELLS) if small else None
        return cls(K, gain, levels, (), loop)

    @property
    def verified(self) -> bool:
        """Whether the gain is proven."""
        return self.gain is not None and self.gain.verified


class Clock(NamedTuple):
    """The bilinear map s = pace (z - 1)/(z + 1), which keeps norms and stability."""

    pace: float

    @classmethod
    def of(cls, plant: DesignPlant) -> Clock:
        """Return that of a sampled model itself; else one near the mean pace, `APART` from the
        poles: an unstable pole at the pace has no place on the circle.
        """
        if plant.loop.dt is not None:
            return cls(1.0)
        poles = np.concatenate([np.linalg.eigvals(P.A) for P in first_members(plant)])
        paces = [plant.pace * factor for factor in PACES]
        apart = [float(np.abs(poles / pace - 1).min(initial=1.0)) for pace in paces]
        return cls(paces[int(np.argmax(np.minimum(apart, APART)))])

    def sampled(self, A: Array, B: Array, C: Array, D: Array) -> tuple[Array, Array, Array, Array]:
        """Return a continuous model from sample to sample."""
        found = sampled_controller(A / self.pace, B / self.pace, C, D)
        if found is None:
            raise InputError(f"a pole is at {self.pace:g} rad/s, the pace of the search, itself")
        return found

    def plant(self, P: Generalized) -> Generalized:
        """Return a continuous plant from sample to sample."""
        return Generalized.split(*self.sampled(*P.joined), P.B2.shape[1], len(P.C2))

    def continuous(
        self, A: Array, B: Array, C: Array, D: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Return the continuous model of a sampled one."""
        A, B, C, D = to_continuous(A, B, C, D)
        return self.pace * A, self.pace * B, C, D


class Tuned(NamedTuple):
    """A controller, the worst gain found of its loop, and the members that decide."""

    gain: float
    numbers: Array
    K: LinearModel
    members: tuple[Generalized, ...]


def tuned(
    plant: DesignPlant, x: Array, states: int, members: Sequence[Generalized]
) -> Tuned | None:
    """Return the controller of so many states with the least worst gain that descent finds from
    these numbers on; None where none stabilises the members.
    """
    every, clock = list(members), Clock.of(plant)
    best: Tuned | None = None
    for _ in range(ROUNDS):
        found = _descended(FullLoops.of(every, states, clock), x)
        if found is None:
            break
        x, value = found
        made = _model(plant, x, states, clock)
        worst = worst_member(plant.closed(made))
        if best is None or worst.gain < best.gain:
            best = Tuned(worst.gain, x, made, tuple(every))
        if worst.gain <= math.exp(value) * (1 + NEAR):
            break
        every.append(of_member(plant, worst))
    return best


def _descended(loops: FullLoops, x: Array) -> tuple[Array, float] | None:
    """Return the numbers at the end of a descent, and the logarithm of the gain there."""
    known: Active | None = None

    def function(x: Array, limit: float = math.inf) -> Value:
        nonlocal known
        value, active = loops.gain(x, known, limit)
        known = active if math.isfinite(active.gain) else known
        return value

    at = function(x)
    if not math.isfinite(at.value):
        pole = Point(x, loops.pole(x))
        x = bfgs(lambda x, _: loops.pole(x), pole, STABILISING, -1e-3).x
        at = function(x)
    if not math.isfinite(at.value):
        return None
    end = bfgs(function, Point(x, at), STEPS, standstill=STANDSTILL)
    return end.x, end.value


def _numbers(A: Array, B: Array, C: Array, D: Array) -> Array:
    """Return the entries of a controller whose states are in balanced units, in which they are read
    as much as they are driven.
    """
    A, (unit, _) = linalg.matrix_balance(A, permute=False, separate=True)
    B, C = B / unit[:, None], C * unit
    into, out = np.linalg.norm(B), np.linalg.norm(C)
    size = math.sqrt(into / out) if into > 0 and out > 0 else 1.0
    return np.block([[A, B / size], [C * size, D]]).ravel()


def _model(plant: DesignPlant, x: Array, states: int, clock: Clock) -> LinearModel:
    M = x.reshape(states + len(plant.controls), states + len(plant.measurements))
    parts = M[:states, :states], M[:states, states:], M[states:, :states], M[states:, states:]
    names = [f"k{i + 1}" for i in range(states)]
    return LinearModel(*clock.continuous(*parts), names, plant.measurements, plant.controls)


def _larger(x: Array, shape: tuple[int, int], rng: np.random.Generator) -> Array:
    """Return the numbers of a controller with `WIDER` more states, which are driven by the
    measurements and hardly read.
    """
    nu, ny = shape
    n, k = round((math.sqrt((nu - ny) ** 2 + 4 * len(x)) - nu - ny) / 2), WIDER
    M, N = x.reshape(n + nu, n + ny), READ * rng.standard_normal((n + k + nu, n + k + ny))
    old, new = np.r_[:n, n + k : n + k + nu], np.r_[:n, n + k : n + k + ny]
    N[np.ix_(old, new)] = M
    N[n : n + k] = rng.standard_normal((k, n + k + ny))
    N[n : n + k, n : n + k] *= DECAY
    return N.ravel()


def least_gain(
    plant: DesignPlant, start: LinearModel, states: int | None
) -> tuple[Tuned | None, tuple[float, ...]]:
    """Return the controller of the least worst gain that is found from this one on, and the worst
    gains on the way, that never rise. None of `states`: as many as the start, and two more where
    these gain something.
    """
    rng, clock = np.random.default_rng(0), Clock.of(plant)
    shape = len(plant.controls), len(plant.measurements)
    more = LARGER if states is None else max(0, math.ceil((states - len(start.A)) / WIDER))
    with task("tuning the controller", 1 + more) as progress:
        x = _numbers(*clock.sampled(start.A, start.B, start.C, start.D))
        best = tuned(plant, x, len(start.A), first_members(plant))
        levels = [] if best is None else [best.gain]
        for _ in range(more if best is not None else 0):
            progress.step(f"{levels[-1]:.5g}")
            assert best is not None  # noqa: S101 - the range is empty
            wider = _larger(best.numbers, shape, rng)
            found = tuned(plant, wider, len(best.K.A) + WIDER, best.members)
            if found is None or found.gain > best.gain * (1 - GAINED):
                break
            best = found
            levels.append(best.gain)
    return best, tuple(levels)


def require_goal(goal: str) -> None:
    """Raise `InputError` for a goal that is none."""
    if goal not in ("mu", "gain"):
        raise InputError(f'goal: expected "mu" or "gain", got {goal!r:.40}')
