"""Bad scheduling trajectories: a gain that no certificate may undercut, or growth that no certificate can deny.

Trapezoid waves within the range and the rate are the start: the Floquet multipliers of a coarse family from a table of
transition matrices. From the best of them an ascent on the whole trajectory, first for growth, then for the gain of the
periodic system. What is reported is growth beyond the error of the time steps, or |y|/|u| of an explicit input from rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import islice, zip_longest
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LPVStateSpace
from synthesis.ascent import GAIN, GROWTH, Objective, ascend, on_nodes
from synthesis.certificate import Trajectory
from synthesis.frozen import FrozenGain, frozen_gain
from synthesis.periodic import Lifted, multiplier, ratio_from_rest, worst_input
from synthesis.wave_family import WaveFamily
from synthesis.waves import Steps, steps

Array = np.ndarray


@dataclass(frozen=True)
class Search:
    """How hard to look for bad trajectories.

    `levels` values of p and `dwells` dwell times span the coarse family of waves; an ascent begins from the best `starts` of
    them, on about `nodes` nodes a cycle, with at most `evaluations` gradients each; a cycle lasts at most `cycles` of the
    slowest mode; `steps` bounds the time steps of a cycle, `samples` those of the explicit input.
    """

    levels: int = 12
    dwells: int = 13
    starts: int = 3
    nodes: int = 100
    evaluations: int = 40
    cycles: float = 3.0
    steps: int = 200
    samples: int = 150_000

    def __post_init__(self) -> None:
        least = {"levels": 2, "dwells": 1, "starts": 1, "nodes": 8, "evaluations": 1, "steps": 8, "samples": 8}
        wrong = [f"{name} >= {low}" for name, low in least.items() if getattr(self, name) < low]
        if wrong or not self.cycles > 0:
            raise InputError(f"expected {', '.join([*wrong, 'cycles > 0'])}, got {self}")


THOROUGH = Search()
"""The default: some seconds for five states."""


class LowerBound(NamedTuple):
    """`gamma`: no smaller L2 gain can be certified (inf: the state grows along `trajectory`, repeated).

    `trajectory` None: p constant, the frozen gain is the best found. `input` (n, nu): the input with |y| = gamma |u|, held
    from each time of the trajectory to the next; None where none was computed. `growth`: factor of the state in one cycle.
    """

    gamma: float
    trajectory: Trajectory | None
    input: Array | None = None
    growth: float = math.nan


def lower_bound(
    lpv: LPVStateSpace, rate: float | None = None, *, frozen: FrozenGain | None = None, search: Search | None = THOROUGH
) -> LowerBound:
    """A lower bound of the L2 gain over p(t) in range with |dp/dt| <= `rate` (default the model's own; inf: p may jump).

    Deterministic. With `search` None, or rate 0, the `frozen` gain. In continuous time the error of the time steps, judged
    by halving them, is taken off.
    """
    rate = lpv.scheduling.rate if rate is None else float(rate)
    frozen = frozen or frozen_gain(lpv)
    best = LowerBound(frozen.gamma, None)
    if search is None or rate == 0 or not math.isfinite(frozen.gamma):
        return best
    hunt = _Hunt(lpv, rate, search)
    cycles, growing = hunt.fastest()
    if growing is not None:
        return growing
    # slower ramps are allowed too, and now and then worse
    slower = (Trajectory(*wave.vertices()) for wave in WaveFamily(lpv, rate / 2, search).coarse())
    mixed = (c for pair in zip_longest(cycles, slower) for c in pair if c is not None)
    stable = list(islice((c for c in mixed if hunt.multiplier(c) < 1), max(search.starts, search.evaluations)))
    candidates = sorted(stable, key=hunt.gain, reverse=True)[: search.starts]
    for start in tuple(candidates):
        cycle, gain = hunt.ascend(start, GAIN)
        if math.isinf(gain) and hunt.grows(cycle):
            return hunt.growing(cycle)
        # beside the waves themselves: corners may have fallen between the nodes
        candidates.append(cycle)
    if not candidates:
        return best
    found = hunt.explicit(max(candidates, key=hunt.gain))
    return found if found.gamma > best.gamma else best


def growing_trajectory(lpv: LPVStateSpace, rate: float, search: Search | None = THOROUGH) -> Trajectory | None:
    """One cycle of a p(t) within the limits along which the free state grows, repeated; None where none was found."""
    if search is None or rate == 0:
        return None
    growing = _Hunt(lpv, rate, search).fastest()[1]
    return growing.trajectory if growing else None


class _Hunt:
    """The search along one model at one rate."""

    def __init__(self, lpv: LPVStateSpace, rate: float, search: Search):
        self.lpv, self.rate, self.search = lpv, rate, search
        self.family = WaveFamily(lpv, rate, search)

    def fastest(self) -> tuple[list[Trajectory], LowerBound | None]:
        """Cycles worth a look, those of the fastest growth first; and the verdict where one of them grows."""
        waves = [Trajectory(*wave.vertices()) for wave in self.family.coarse()]
        climbed: list[tuple[float, Trajectory]] = []
        for wave in waves[: self.search.starts]:
            if self.grows(wave):
                return [], self.growing(wave)
            cycle, growth = self.ascend(wave, GROWTH)
            if growth > 0 and self.grows(cycle):
                return [], self.growing(cycle)
            climbed.append((growth / float(cycle.time[-1]), cycle))
        climbed.sort(key=lambda pair: -pair[0])
        return [cycle for _, cycle in climbed] + waves, None

    def ascend(self, cycle: Trajectory, objective: Objective) -> tuple[Trajectory, float]:
        """The cycle a whole ascent leads to, and its measure."""
        start = on_nodes(cycle, self.search.nodes, self.lpv.dt)
        return ascend(self.lpv, self.rate, start, objective, self.family.longest_period, self.search.evaluations)

    def along(self, cycle: Trajectory, finer: int = 1, split: int = 1) -> Steps:
        """The model along one cycle."""
        longest = max(self.family.longest, float(cycle.time[-1]) / self.search.steps) / finer
        return steps(self.lpv, *cycle, longest, split)

    def multiplier(self, cycle: Trajectory, finer: int = 1) -> float:
        """Largest Floquet multiplier (modulus) of one cycle."""
        return multiplier(self.along(cycle, finer))

    def grows(self, cycle: Trajectory) -> bool:
        """Whether a multiplier exceeds one by more than the time steps can be wrong."""
        coarse, fine = self.multiplier(cycle, 2), self.multiplier(cycle, 4)
        return fine - abs(fine - coarse) > 1 + 1e-7

    def growing(self, cycle: Trajectory) -> LowerBound:
        """The verdict on a cycle along which the state grows."""
        return LowerBound(math.inf, cycle, None, self.multiplier(cycle, 4))

    def gain(self, cycle: Trajectory) -> float:
        """L2 gain of the periodic system, inf where it grows."""
        return worst_input(self.along(cycle))[0]

    def explicit(self, cycle: Trajectory) -> LowerBound:
        """|y|/|u| of an explicit input over many cycles from rest."""
        system = self.along(cycle, finer=2)
        lifted = Lifted.of(system)
        gain, angle, shape = worst_input(system, lifted)
        if math.isinf(gain):
            return LowerBound(0.0, None)
        growth = multiplier(system)
        count = int(np.clip(math.ceil(50.0 / max(1.0 - growth, 1e-3)), 8, max(8, self.search.samples // len(system.step))))
        window = np.sin(np.pi * (np.arange(count) + 0.5) / count)
        turn = np.exp(1j * angle * np.arange(count)) * window
        start = np.real(turn[:, None] * shape.reshape(1, -1))
        ratio, inputs = ratio_from_rest(lifted, start, rounds=6)
        inputs = inputs.reshape(-1, shape.shape[1])
        if self.lpv.dt is None:
            # the same input in steps half as long: what changes is the error of the steps, taken off
            halved = np.repeat(inputs, 2, axis=0).reshape(count, -1)
            half, _ = ratio_from_rest(Lifted.of(self.along(cycle, finer=2, split=2)), halved, rounds=1)
            ratio = min(ratio, half) - abs(ratio - half)
        period = float(cycle.time[-1])
        time = np.concatenate([system.time[:-1] + k * period for k in range(count)])
        p = np.tile(np.interp(system.time[:-1], *cycle), count)
        width = np.tile(np.diff(system.time), count) if self.lpv.dt is None else np.ones(len(time))
        return LowerBound(ratio, Trajectory(time, p), inputs / np.sqrt(width)[:, None], growth)
