"""Margins of an autopilot's loops around a calibrated helicopter over airspeed, with their bands,
before and after a change of gains.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

import symheli
from symheli import Helicopter, Servo
from symheli.errors import InputError, TrimError
from symheli.flight import HelicopterLoops
from symheli.progress import tracked
from symheli.values.arrays import Array
from synthesis.loops.actuated import actuated
from synthesis.loops.margins import loop, margins

CONTROLS = ("d_lat", "d_lon", "d_ped")

LARGEST = 40.0
"""Margin, dB, above which a loop has as much as anyone asks for: larger ones are shown as this."""

DEVIATIONS = 3.0
"""Half width of a band in standard deviations of the drawn helicopters."""

LEAST = (0.1, 0.5)
"""Smallest half width of a band, dB and degrees: what rounding and trims leave."""


@dataclass(frozen=True)
class LoopMargins:
    """The loop broken at `control`, the others closed, at `airspeed` (m/s): margins (dB, deg) and
    half widths of their bands. `stable`: of all drawn helicopters; None: of some.
    """

    airspeed: float
    control: str
    stable: bool | None
    gain: float
    gain_band: float
    phase: float
    phase_band: float
    crossover: float


def loop_margins(
    helicopters: Sequence[Helicopter],
    loops: HelicopterLoops,
    airspeeds: Sequence[float],
    *,
    servos: Mapping[str, Servo] | None = None,
    delay: float = 0.0,
) -> list[LoopMargins]:
    """Return the margins of every loop at every airspeed: those of the first helicopter, with bands
    from the others, which are drawn from its uncertainty; without others the bands are their least.
    A drawn helicopter without a trim is left out: the one that flew has one.

    `delay` (s) is from command to servo, in whole periods of the loops. Raises `InputError` where
    it is not.
    """
    if not (math.isfinite(delay) and delay >= 0):
        raise InputError(f"delay: expected seconds >= 0, got {delay:g}")
    rows = []
    for airspeed in tracked("margins", airspeeds):
        each = [_at(h, loops, airspeed, servos, delay) for h in helicopters]
        if each[0] is None:
            raise InputError(
                f"the helicopter has no trim at {airspeed:g} m/s: leave this airspeed out"
            )
        found = np.array([one for one in each if one is not None])
        for k, control in enumerate(CONTROLS):
            rows.append(_row(float(airspeed), control, found[:, k]))
    return rows


def _at(
    heli: Helicopter,
    loops: HelicopterLoops,
    airspeed: float,
    servos: Mapping[str, Servo] | None,
    delay: float,
) -> list[tuple[float, float, float, float]] | None:
    """Of each control: 1 where stable, gain margin (dB), phase margin (deg), crossover (rad/s);
    None without a trim.
    """
    try:
        model = symheli.linearize(heli, symheli.trim(heli, airspeed=float(airspeed)))
    except TrimError:
        return None
    plant = actuated(model, servos, delay, loops.dt)
    out = []
    for control in CONTROLS:
        found = margins(loop(plant, loops.linear, control))
        decibels = [abs(20 * math.log10(g)) if g > 0 else math.inf for g in found.gain]
        gain = min(*decibels, LARGEST) if found.stable else 0.0
        phase = min(math.degrees(found.phase), 180.0)
        out.append((float(found.stable), gain, phase, max(found.crossover, default=0.0)))
    return out


def _row(airspeed: float, control: str, found: Array) -> LoopMargins:
    """`found` (helicopters, 4): stable, gain, phase, crossover."""
    first, others = found[0], found[1:]
    spread = others.std(axis=0) if len(others) else np.zeros(4)
    stable = bool(first[0]) if np.all(found[:, 0] == first[0]) else None
    return LoopMargins(
        airspeed=airspeed,
        control=control,
        stable=stable,
        gain=float(first[1]),
        gain_band=max(DEVIATIONS * float(spread[1]), LEAST[0]),
        phase=float(first[2]),
        phase_band=max(DEVIATIONS * float(spread[2]), LEAST[1]),
        crossover=float(first[3]),
    )
