"""Bad scheduling trajectories: a gain that no certificate may undercut, or growth that no certificate can deny.

The search covers trapezoid waves within the range and the rate: first the Floquet multipliers of a coarse family from a
table of transition matrices, then the gain of the periodic system, lifted over one period, by power iteration; the best
is refined by a pattern search. The number reported is |y|/|u| of an explicit input from rest. After Tierno, Murray, Doyle
and Gregory, "Numerically efficient robustness analysis of trajectory tracking for nonlinear systems", J. Guidance,
Control, and Dynamics 20 (1997), whose power iteration over a horizon is applied here along each wave.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice, zip_longest
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LPVStateSpace
from synthesis.certificate import Trajectory
from synthesis.frozen import FrozenGain, frozen_gain
from synthesis.waves import Steps, Wave, steps

Array = np.ndarray


@dataclass(frozen=True)
class Search:
    """How hard to look for bad trajectories.

    `levels` values of p and `dwells` dwell times span the coarse family; `evaluations` gains are then computed; a cycle
    lasts at most `cycles` of the slowest oscillation; `steps` bounds the time steps of a cycle.
    """

    levels: int = 12
    dwells: int = 13
    evaluations: int = 60
    cycles: float = 12.0
    steps: int = 200

    def __post_init__(self) -> None:
        if self.levels < 2 or self.dwells < 1 or self.evaluations < 1 or self.steps < 8 or not self.cycles > 0:
            raise InputError("expected levels >= 2, dwells >= 1, evaluations >= 1, steps >= 8 and cycles > 0")


THOROUGH = Search()
"""The default: one or two seconds for five states."""


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
    family = _Family(lpv, rate, search)
    waves, growing = _fastest(family)
    if growing is not None:
        return growing
    # slower ramps are allowed too, and now and then worse
    waves = [w for pair in zip_longest(waves, _Family(lpv, rate / 2, search).coarse()) for w in pair if w is not None]
    stable = list(islice((w for w in waves if family.growth(w) < 1), max(1, search.evaluations // 2)))
    if not stable:
        return best
    wave, gain = _climb(max(stable, key=family.gain), family.gain, family, search.evaluations)
    if math.isinf(gain) and family.grows(wave):
        return family.growing(wave)
    found = family.explicit(wave)
    return found if found.gamma > best.gamma else best


def growing_trajectory(lpv: LPVStateSpace, rate: float, search: Search | None = THOROUGH) -> Trajectory | None:
    """One cycle of a p(t) within the limits along which the free state grows, repeated; None where none was found."""
    if search is None or rate == 0:
        return None
    growing = _fastest(_Family(lpv, rate, search))[1]
    return growing.trajectory if growing else None


def _fastest(family: _Family) -> tuple[list[Wave], LowerBound | None]:
    """The waves worth a look, the one of the largest multiplier first; and the verdict where that one grows."""
    waves = family.coarse()
    if not waves:
        return [], None
    wave, growth = _climb(waves[0], family.growth, family, family.search.evaluations)
    if growth > 1 and family.grows(wave):
        return [], family.growing(wave)
    return [wave, *(w for w in waves if w != wave)], None


class _Family:
    """The waves within range and rate, and what the model does along one."""

    def __init__(self, lpv: LPVStateSpace, rate: float, search: Search):
        self.lpv, self.rate, self.search = lpv, rate, search
        s = lpv.scheduling
        self.grid = np.linspace(s.low, s.high, search.levels + 1)
        poles = np.linalg.eigvals(lpv.matrices(self.grid).A)
        if lpv.dt is not None:
            poles = np.log(np.where(poles == 0, 1e-12, poles)) / lpv.dt
        # the least damped oscillation sets the pace; without any, the slowest pole does
        damping = -poles.real / np.maximum(np.abs(poles), 1e-12)
        pace = np.abs(poles[np.arange(len(poles)), damping.argmin(axis=1)])
        self.slow, self.fast = 2 * math.pi / max(pace.min(), 1e-6), 2 * math.pi / pace.max()
        self.slow = min(self.slow, 20 * self.fast)
        self.longest = 0.5 / float(np.abs(poles).max())

    def wave(self, bottom: float, top: float, dwell_bottom: float, dwell_top: float, ramp: float = 0.0) -> Wave | None:
        """The wave with ramps of `ramp` s, or as steep as allowed; None where it is too long or too flat."""
        s, dt = self.lpv.scheduling, self.lpv.dt
        bottom, top = max(bottom, s.low), min(top, s.high)
        if top - bottom < 0.02 * (s.high - s.low):
            return None
        ramp = max(ramp, 0.0 if math.isinf(self.rate) else (top - bottom) / self.rate)
        if dt is not None:
            ramp = math.ceil(ramp / dt - 1e-9) * dt
            dwell_bottom, dwell_top = (max(1.0, round(d / dt)) * dt for d in (dwell_bottom, dwell_top))
        wave = Wave(bottom, top, max(dwell_bottom, 0.0), max(dwell_top, 0.0), ramp)
        return wave if 0 < wave.period <= self.search.cycles * self.slow else None

    def coarse(self) -> list[Wave]:
        """All waves on the grid of levels and dwell times, the one that grows fastest first, one a pair of levels."""
        dwell = np.linspace(0.0, 0.75 * self.slow, self.search.dwells)
        waits = [[self._transition(p, p, d) for d in dwell] for p in self.grid]
        rise = [self._ramp(a, b) for a, b in zip(self.grid[:-1], self.grid[1:], strict=True)]
        fall = [self._ramp(b, a) for a, b in zip(self.grid[:-1], self.grid[1:], strict=True)]
        found = []
        for i in range(len(self.grid)):
            up = down = np.eye(len(self.lpv.states))
            for j in range(i + 1, len(self.grid)):
                up, down = rise[j - 1] @ up, down @ fall[j - 1]
                if self.wave(self.grid[i], self.grid[j], 0.0, dwell[1] if len(dwell) > 1 else self.fast) is None:
                    break
                cycle = (np.array(waits[i]) @ down)[:, None] @ (np.array(waits[j]) @ up)[None]
                radius = np.abs(np.linalg.eigvals(cycle)).max(axis=-1)
                a, b = np.unravel_index(int(radius.argmax()), radius.shape)
                wave = self.wave(self.grid[i], self.grid[j], dwell[a], dwell[b])
                if wave is not None:
                    found.append((float(radius.max()), wave))
        return [wave for _, wave in sorted(found, key=lambda pair: -pair[0])]

    def _ramp(self, a: float, b: float) -> Array:
        return self._transition(a, b, 0.0 if math.isinf(self.rate) else abs(b - a) / self.rate)

    def _transition(self, a: float, b: float, duration: float) -> Array:
        if self.lpv.dt is not None:
            duration = math.ceil(duration / self.lpv.dt - 1e-9) * self.lpv.dt
        if duration <= 0 or duration > self.search.cycles * self.slow:
            return np.eye(len(self.lpv.states))
        return steps(self.lpv, np.array([0.0, duration]), np.array([a, b]), duration if a == b else duration / 6).transition

    def along(self, wave: Wave, finer: int = 1, split: int = 1) -> Steps:
        """The model along one cycle of the wave."""
        longest = max(self.longest, wave.period / self.search.steps) / finer
        return steps(self.lpv, *wave.vertices(), longest, split)

    def growth(self, wave: Wave, finer: int = 1) -> float:
        """Largest Floquet multiplier (modulus) of one cycle."""
        return float(np.abs(np.linalg.eigvals(self.along(wave, finer).transition)).max())

    def grows(self, wave: Wave) -> bool:
        """Whether a multiplier exceeds one by more than the time steps can be wrong."""
        coarse, fine = self.growth(wave, 2), self.growth(wave, 4)
        return fine - abs(fine - coarse) > 1 + 1e-7

    def growing(self, wave: Wave) -> LowerBound:
        """The verdict on a wave along which the state grows."""
        return LowerBound(math.inf, Trajectory(*wave.vertices()), None, self.growth(wave, 4))

    def gain(self, wave: Wave) -> float:
        """L2 gain of the periodic system, inf where it grows."""
        return _lifted(self.along(wave))[0]

    def explicit(self, wave: Wave) -> LowerBound:
        """|y|/|u| of an explicit input over many cycles from rest."""
        system = self.along(wave, finer=2)
        gain, angle, shape = _lifted(system)
        growth = float(np.abs(np.linalg.eigvals(system.transition)).max())
        if math.isinf(gain):
            return LowerBound(0.0, None)
        cycles = int(np.clip(math.ceil(8.0 / max(1.0 - growth, 1e-3)), 8, max(8, 12000 // len(system.step))))
        window = np.sin(np.pi * (np.arange(cycles) + 0.5) / cycles)
        turn = np.exp(1j * angle * np.arange(cycles)) * window
        start = np.real(turn[:, None, None] * shape[None])
        ratio, inputs = _power_iteration(system, start.reshape(-1, shape.shape[1]), rounds=6)
        if self.lpv.dt is None:
            # the same input in steps half as long: what changes is the error of the steps, taken off
            half, _ = _power_iteration(self.along(wave, finer=2, split=2), np.repeat(inputs, 2, axis=0), rounds=1)
            ratio = min(ratio, half) - abs(ratio - half)
        time = np.concatenate([system.time[:-1] + k * wave.period for k in range(cycles)])
        corner_time, corner_p = wave.vertices(cycles)
        p = np.interp(time, corner_time, corner_p)
        width = np.tile(np.diff(system.time), cycles) if self.lpv.dt is None else np.ones(len(time))
        return LowerBound(ratio, Trajectory(time, p), inputs / np.sqrt(width)[:, None], growth)


def _climb(wave: Wave, score: Callable[[Wave], float], family: _Family, evaluations: int) -> tuple[Wave, float]:
    """Pattern search over levels and dwell times, steps halved when none of them helps."""
    s = family.lpv.scheduling
    best, value = wave, score(wave)
    move = np.array([s.high - s.low, s.high - s.low, family.slow, family.slow, family.slow]) / 12.0
    spent = 0
    while spent < evaluations and move[0] > 0.004 * (s.high - s.low) and not math.isinf(value):
        improved = False
        for k in range(len(move)):
            for sign in (1.0, -1.0):
                point = np.array(best)
                point[k] += sign * move[k]
                trial = family.wave(*(float(v) for v in point))
                if trial is None or trial == best:
                    continue
                spent += 1
                new = score(trial)
                if new > value * (1 + 1e-9):
                    best, value, improved = trial, new, True
                    break
        if not improved:
            move *= 0.5
    return best, value


def _lifted(system: Steps, rounds: int = 15) -> tuple[float, float, Array]:
    """Gain of the periodic system, the phase advance per cycle (rad) of its worst input and that input (N, nu), complex.

    Over one cycle x(+) = F x + G v, y = H x + J v; the gain is the largest norm of J + H (z - F)^-1 G on |z| = 1.
    """
    n, N = system.states, len(system.step)
    m, r = system.step.shape[2] - n, system.step.shape[1] - n
    F, G = np.eye(n), np.zeros((n, N * m))
    H, J = np.empty((N * r, n)), np.empty((N * r, N * m))
    for k, M in enumerate(system.step):
        rows, columns = slice(k * r, (k + 1) * r), slice(k * m, (k + 1) * m)
        H[rows], J[rows] = M[n:, :n] @ F, M[n:, :n] @ G
        J[rows, columns] += M[n:, n:]
        F, G = M[:n, :n] @ F, M[:n, :n] @ G
        G[:, columns] += M[:n, n:]
    multipliers = np.linalg.eigvals(F)
    if np.abs(multipliers).max() >= 1:
        return math.inf, 0.0, np.zeros((N, m))
    leading = multipliers[np.argsort(-np.abs(multipliers))[:3]]
    angles = np.unique(np.round(np.abs(np.concatenate([np.angle(leading), [0.0, math.pi / 2, math.pi]])), 6))

    def norm(angle: float) -> tuple[float, Array]:
        # complex vectors as two real columns: a complex product would copy the large real matrices every time
        inverse = np.linalg.inv(np.exp(1j * angle) * np.eye(n) - F)
        v, value = np.random.default_rng(0).standard_normal((N * m, 2)), 0.0
        for _ in range(rounds):
            v = v / np.linalg.norm(v)
            y = J @ v + H @ _times(inverse, G @ v)
            value = float(np.linalg.norm(y))
            v = J.T @ y + G.T @ _times(inverse.conj().T, H.T @ y)
            if not np.any(v):
                break
        return value, v[:, 0] + 1j * v[:, 1]

    tried = [(*norm(float(angle)), float(angle)) for angle in angles]
    value, v, angle = max(tried, key=lambda item: item[0])
    return value, angle, v.reshape(N, m)


def _times(M: Array, v: Array) -> Array:
    """Complex M times complex v, v as real and imaginary columns."""
    w = M @ (v[:, 0] + 1j * v[:, 1])
    return np.column_stack([w.real, w.imag])


def _power_iteration(system: Steps, v: Array, rounds: int) -> tuple[float, Array]:
    """(|y|/|v|, v) after `rounds` of forward and adjoint passes from rest over len(v) steps of the repeated cycle."""
    n, N = system.states, len(system.step)
    forward, backward = list(system.step), [np.ascontiguousarray(M.T) for M in system.step]
    ratio, best = 0.0, v
    for _ in range(rounds):
        size = float(np.linalg.norm(v))
        if size == 0.0:
            break
        v = v / size
        outputs, x = [], np.zeros(n)
        for k, vk in enumerate(v):
            z = forward[k % N] @ np.concatenate([x, vk])
            x = z[:n]
            outputs.append(z[n:])
        new = math.sqrt(sum(float(y @ y) for y in outputs))
        if new > ratio:
            ratio, best = new, v
        gradient, costate = np.empty_like(v), np.zeros(n)
        for k in range(len(v) - 1, -1, -1):
            z = backward[k % N] @ np.concatenate([costate, outputs[k]])
            costate, gradient[k] = z[:n], z[n:]
        v = gradient
    return ratio, best
