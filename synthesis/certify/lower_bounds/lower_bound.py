"""Worst scheduling trajectories: lower bounds on the gain, or growth that disproves stability.

Trapezoid waves within the range and the rate are the start: the Floquet multipliers of a coarse
family from a table of transition matrices, and for the gain waves of many periods. From the best of
them ascents on the whole trajectory and on the corners of a wave (`corners`), first for growth,
then for the gain of the periodic system. What is reported is growth beyond the error of the time
steps, or |y|/|u| of an explicit input from rest.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import zip_longest
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.progress import tracked
from symheli.values.arrays import Array
from symheli.values.numbers import whole
from symheli.values.summary import summarized
from synthesis.certify.lower_bounds.ascent import (
    GAIN,
    GROWTH,
    Corners,
    Objective,
    ascend,
    climb,
    on_nodes,
)
from synthesis.certify.lower_bounds.frozen import FrozenGain, frozen_gain
from synthesis.certify.lower_bounds.paths import (
    Budget,
    Scheduled,
    TransitionMatrices,
    WaveFamily,
    samples,
    steps,
)
from synthesis.certify.lower_bounds.periodic import Lifted, multiplier, ratio_from_rest, worst_input
from synthesis.certify.statement.rates import Rate, rates
from synthesis.certify.statement.trajectory import SchedulingTrajectory


@dataclass(frozen=True)
class LowerBoundSearch:
    """Effort of the search for bad trajectories.

    Parameters
    ----------
    levels, dwells : int
        Values of p and dwell times that span the coarse family of waves.
    starts : int
        An ascent begins from the best so many of them.
    nodes : int
        Of a cycle in an ascent, about.
    evaluations : int
        Gradients of an ascent, at most.
    cycles : float
        A cycle lasts at most so many of the slowest mode or, for the gain, as long as a slow p
        takes to cross its range.
    steps : int
        Time steps of a cycle, at most.
    samples : int
        Of the explicit input, at most.
    seconds : float
        Wall time at most, for all lines through a box together: no limit. The result of a search
        that it ends depends on the machine.

    Raises
    ------
    InputError
        For a number out of range.

    Examples
    --------
    >>> LowerBoundSearch(starts=1, seconds=2.0).starts
    1
    """

    levels: int = 12
    dwells: int = 13
    starts: int = 3
    nodes: int = 100
    evaluations: int = 40
    cycles: float = 3.0
    steps: int = 200
    samples: int = 150_000
    seconds: float = math.inf

    def __post_init__(self) -> None:
        least = {
            "levels": 2,
            "dwells": 1,
            "starts": 1,
            "nodes": 8,
            "evaluations": 1,
            "steps": 8,
            "samples": 8,
        }
        for name, low in least.items():
            whole(getattr(self, name), name, low)
        if not self.cycles > 0 or not self.seconds > 0:
            raise InputError(f"expected cycles > 0 and seconds > 0, got {self}")


THOROUGH = LowerBoundSearch()
"""Default effort: some seconds for five states."""


class LowerBound(NamedTuple):
    """`gain`: no smaller L2 gain can be certified (inf: the state grows along `trajectory`,
    repeated).

    `trajectory` None: p constant, the frozen gain is the best found; in discrete time it has one p
    a sample. `input` (n, nu): the input with |y| = gain |u|, held from each time of the trajectory
    to the next; None where none was computed. `growth`: factor of the state in one cycle; None
    without a trajectory.
    """

    gain: float
    trajectory: SchedulingTrajectory | None
    input: Array | None = None
    growth: float | None = None

    __repr__ = summarized


def lower_bound(
    lpv: Scheduled,
    rate: Rate = None,
    *,
    frozen: FrozenGain | None = None,
    search: LowerBoundSearch | None = THOROUGH,
) -> LowerBound:
    """Compute a lower bound on the L2 gain, from the worst trajectory of p that is found.

    Deterministic unless `search.seconds` end it. In continuous time the error of the time
    steps, judged by halving them, is taken off.

    Parameters
    ----------
    lpv : LPVStateSpace or LFT of one parameter
        The model.
    rate : float, optional
        Largest |dp/dt|, units of p per second; by default the model's own, math.inf: p may jump.
    frozen : FrozenGain, optional
        Where it is known already.
    search : LowerBoundSearch or None
        How hard to look; with None, or rate 0, the frozen gain is the bound.

    Returns
    -------
    LowerBound
        `gain`, no smaller gain can be certified; the trajectory and the input that show it.

    Raises
    ------
    InputError
        For a rate that is not >= 0.

    See Also
    --------
    synthesis.l2_gain : worst-case gain while p moves
    synthesis.frozen_gain : the worst frozen model

    References
    ----------
    Margaliot, "Stability analysis of switched systems using variational principles: an
    introduction", Automatica 42 (2006), for the ascents.

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> lower_bound(lag, search=None).gain
    1.0
    """
    (limit,) = rates((lpv.scheduling,), rate)
    frozen = frozen or frozen_gain(lpv)
    best = LowerBound(frozen.gain, None)
    if search is None or limit == 0 or not math.isfinite(frozen.gain):
        return best
    hunt = _TrajectorySearch(lpv, limit, search)
    cycles, growing = hunt.fastest()
    if growing is not None:
        return growing
    near, spread = (
        hunt.ranked(hunt.near()),
        hunt.ranked(wave.cycle() for wave in hunt.family.spread(frozen.p)),
    )
    # of the spread the best alone: long cycles begin high and have less room to rise
    tops = [*sorted([*hunt.ranked(cycles), *near], key=_first)[-search.starts :], *spread[-1:]]
    # the starts stay beside what they lead to: corners may fall between the nodes
    found = list(tops)
    ascents = hunt.improved(tops, [*near[-1:], *spread[-1:]])
    for cycle in tracked("searching for gain", ascents):
        if hunt.grows(cycle):
            return hunt.growing(cycle)
        found += hunt.ranked([cycle])
    if not found:
        return best
    explicit = hunt.explicit(max(found, key=_first)[1])
    return explicit if explicit.gain > best.gain else best


def growing_trajectory(
    lpv: Scheduled, rate: float, search: LowerBoundSearch | None = THOROUGH
) -> SchedulingTrajectory | None:
    """Return one cycle of a p(t) within the limits along which the free state grows if repeated;
    None where none was found.
    """
    if search is None or rate == 0:
        return None
    growing = _TrajectorySearch(lpv, rate, search).fastest()[1]
    return growing.trajectory if growing else None


def along_cycle(
    lpv: Scheduled, cycle: SchedulingTrajectory, search: LowerBoundSearch
) -> LowerBound:
    """Return the bound of one cycle, repeated: growth, or the gain of an explicit input
    from rest.
    """
    hunt = _TrajectorySearch(lpv, lpv.scheduling.limit, search)
    return hunt.growing(cycle) if hunt.grows(cycle) else hunt.explicit(cycle)


class _TrajectorySearch:
    """The search along one model at one rate."""

    def __init__(self, lpv: Scheduled, rate: float, search: LowerBoundSearch):
        self.lpv, self.rate, self.search = lpv, rate, search
        self.budget = Budget(search.seconds)
        self.family = WaveFamily(lpv, rate, search)

    def fastest(self) -> tuple[list[SchedulingTrajectory], LowerBound | None]:
        """Return cycles along which the state grows fast, the fastest last; and the lower bound
        where the state grows along one of them.
        """
        reached: list[tuple[float, SchedulingTrajectory]] = []
        for cycle in tracked("searching for growth", self._steepening()):
            if self.budget.over and reached:
                break
            if self.grows(cycle):
                return [], self.growing(cycle)
            reached.append(
                (math.log(max(self.multiplier(cycle), 1e-300)) / float(cycle.time[-1]), cycle)
            )
        return [cycle for _, cycle in sorted(reached, key=_first)[-self.search.starts :]], None

    def improved(
        self,
        tops: list[tuple[float, SchedulingTrajectory]],
        waves: list[tuple[float, SchedulingTrajectory]],
    ) -> Iterator[SchedulingTrajectory]:
        """Yield the results of ascents of the gain: on the nodes of the `tops`, on the corners of
        the `waves`; as long as there is time.
        """
        for _, cycle in tops:
            if not self.budget.over:
                yield self.ascend(cycle, GAIN)
        for _, cycle in waves:
            if not self.budget.over:
                yield from self.climb(cycle, GAIN)

    def _steepening(self) -> Iterator[SchedulingTrajectory]:
        waves = [wave.cycle() for wave in self.family.coarse()[: self.search.starts]]
        yield from waves
        for wave in waves[:1]:
            yield from self.climb(wave, GROWTH)
        for wave in waves:
            yield self.ascend(wave, GROWTH)

    def near(self) -> list[SchedulingTrajectory]:
        """Return waves of fast growth, and slower ones, which are sometimes worse."""
        slower = (
            self.rate / 2
            if math.isfinite(self.rate)
            else 4 * self.lpv.scheduling.radius / self.family.slow
        )
        families = (self.family.coarse(), WaveFamily(self.lpv, slower, self.search).coarse())
        mixed = [
            wave.cycle() for pair in zip_longest(*families) for wave in pair if wave is not None
        ]
        return mixed[: max(self.search.starts, self.search.evaluations)]

    def ranked(
        self, cycles: Iterable[SchedulingTrajectory]
    ) -> list[tuple[float, SchedulingTrajectory]]:
        """Return gains of the repeated cycles, the largest last, without those along which the
        state grows.
        """
        # one at least, so that there is something to improve
        gains = (
            (self.gain(cycle), cycle)
            for k, cycle in enumerate(tracked("ranking trajectories", list(cycles)))
            if k == 0 or not self.budget.over
        )
        return sorted(((gain, cycle) for gain, cycle in gains if math.isfinite(gain)), key=_first)

    def climb(
        self, wave: SchedulingTrajectory, objective: Objective
    ) -> Iterator[SchedulingTrajectory]:
        """Yield the cycles at the end of ascents on the corners of a wave: two corners, and for
        growth four; none in discrete time.
        """
        if self.lpv.dt is not None:
            return
        period = self.limit(wave)
        longest = max(self.family.longest, period / self.search.steps)
        corners = Corners.of(wave)
        for again in (False, True)[: 1 + objective.a_second]:
            start = corners.twice() if again else corners
            corners = climb(
                self.lpv,
                self.rate,
                start,
                objective,
                longest,
                period,
                self.search.evaluations // 2,
                self.budget,
            )
            yield corners.cycle(self.rate)

    def ascend(self, cycle: SchedulingTrajectory, objective: Objective) -> SchedulingTrajectory:
        """Return the cycle at the end of an ascent on all nodes."""
        limit = self.limit(cycle)
        # nodes as close in a slow cycle, as far as the time steps allow
        nodes = self.search.nodes * min(
            limit / self.family.longest_period, self.search.steps / self.search.nodes
        )
        start = on_nodes(cycle, max(self.search.nodes, round(nodes)), self.lpv.dt)
        return ascend(
            self.lpv, self.rate, start, objective, limit, self.search.evaluations, self.budget
        )[0]

    def limit(self, cycle: SchedulingTrajectory) -> float:
        """Return the longest period an ascent may give this cycle, s: for a slow one, the time for
        p to cross its range and come back.
        """
        return (
            self.family.longest_period
            if cycle.time[-1] <= self.family.longest_period
            else self.family.slowest_period
        )

    def along(
        self, cycle: SchedulingTrajectory, finer: int = 1, split: int = 1
    ) -> TransitionMatrices:
        """Return the model along one cycle."""
        longest = max(self.family.longest, float(cycle.time[-1]) / self.search.steps) / finer
        return steps(self.lpv, *cycle, longest, split)

    def multiplier(self, cycle: SchedulingTrajectory, finer: int = 1) -> float:
        """Return the largest Floquet multiplier (modulus) of one cycle."""
        return multiplier(self.along(cycle, finer))

    def grows(self, cycle: SchedulingTrajectory) -> bool:
        """Whether a multiplier exceeds one by more than the error of the time steps."""
        coarse, fine = self.multiplier(cycle, 2), self.multiplier(cycle, 4)
        return fine - abs(fine - coarse) > 1 + 1e-7

    def growing(self, cycle: SchedulingTrajectory) -> LowerBound:
        """Return the lower bound of a cycle along which the state grows."""
        shown = cycle if self.lpv.dt is None else samples(cycle, self.lpv.dt)
        return LowerBound(math.inf, shown, None, self.multiplier(cycle, 4))

    def gain(self, cycle: SchedulingTrajectory) -> float:
        """Return the L2 gain of the periodic system, inf where it grows."""
        return worst_input(self.along(cycle))[0]

    def explicit(self, cycle: SchedulingTrajectory) -> LowerBound:
        """Return |y|/|u| of an explicit input over many cycles from rest."""
        system = self.along(cycle, finer=2)
        lifted = Lifted.of(system)
        gain, angle, shape = worst_input(system, lifted)
        if math.isinf(gain):
            return LowerBound(0.0, None)
        growth = multiplier(system)
        count = int(
            np.clip(
                math.ceil(50.0 / max(1.0 - growth, 1e-3)),
                8,
                max(8, self.search.samples // len(system.step)),
            )
        )
        window = np.sin(np.pi * (np.arange(count) + 0.5) / count)
        turn = np.exp(1j * angle * np.arange(count)) * window
        start = np.real(turn[:, None] * shape.reshape(1, -1))
        ratio, inputs = ratio_from_rest(lifted, start, rounds=6)
        inputs = inputs.reshape(-1, shape.shape[1])
        if self.lpv.dt is None:
            # the same input in steps half as long: what changes is the error of the steps, taken
            # off
            halved = np.repeat(inputs, 2, axis=0).reshape(count, -1)
            half, _ = ratio_from_rest(
                Lifted.of(self.along(cycle, finer=2, split=2)), halved, rounds=1
            )
            ratio = min(ratio, half) - abs(ratio - half)
        if self.lpv.dt is not None:
            p = np.tile(samples(cycle, self.lpv.dt).p, count)
            return LowerBound(
                ratio, SchedulingTrajectory(self.lpv.dt * np.arange(len(p)), p), inputs, growth
            )
        width = np.tile(np.diff(system.time), count)
        return LowerBound(
            ratio, *_flown(cycle, system.time, count, inputs / np.sqrt(width)[:, None]), growth
        )


def _first(pair: tuple[float, SchedulingTrajectory]) -> float:
    return pair[0]


def _flown(
    cycle: SchedulingTrajectory, at: Array, count: int, held: Array
) -> tuple[SchedulingTrajectory, Array]:
    """Return the repeated cycle, and the input held from each time to the next; where p jumps, one
    time with both values.
    """
    start = np.interp(at[:-1], *cycle)
    # the value a step ends with: of two at the same time interpolation takes the later one,
    # backwards the earlier
    end = np.interp(-at[1:], -cycle.time[::-1], cycle.p[::-1])
    jumping = bool(np.any(np.diff(cycle.time) == 0))
    jumps = np.flatnonzero(jumping & (np.abs(end - np.roll(start, -1)) > 1e-9 * np.ptp(cycle.p)))
    time, p = np.insert(at[:-1], jumps + 1, at[jumps + 1]), np.insert(start, jumps + 1, end[jumps])
    each = held.reshape(count, len(start), -1)
    time = np.concatenate([time + k * at[-1] for k in range(count)])
    return SchedulingTrajectory(time, np.tile(p, count)), np.insert(
        each, jumps + 1, each[:, jumps], axis=1
    ).reshape(len(time), -1)
