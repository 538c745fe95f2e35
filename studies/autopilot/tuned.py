"""Margins and responses of an autopilot's loops around a calibrated helicopter over airspeed, with
their bands, before and after a change of gains.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

import symheli
from studies.autopilot.responses import Responses, closed_loops, responses
from symheli import Helicopter, Servo
from symheli.errors import InputError, TrimError
from symheli.flight import HelicopterLoops
from symheli.flight.ardupilot import AXES, COMMANDS
from symheli.lpv.tools import Actuation
from symheli.progress import tracked
from symheli.values.arrays import Array
from synthesis.design.loops.margins import margins, open_loop

CONTROLS = tuple(control for _, _, control in AXES.values())

LARGEST = 40.0
"""Margin, dB, above which a loop has as much as anyone asks for: larger ones are shown as this."""

DEVIATIONS = 3.0
"""Half width of a band in standard deviations of the drawn helicopters."""


class QuantityBand(NamedTuple):
    """Unit of a quantity, and the smallest half width of its band: what rounding, trims and a
    period of the loops leave.
    """

    unit: str
    least: float


QUANTITIES = {
    "gain": QuantityBand("dB", 0.1),
    "phase": QuantityBand("deg", 0.5),
    "bandwidth": QuantityBand("rad/s", 0.02),
    "peak": QuantityBand("dB", 0.1),
    "rejection": QuantityBand("rad/s", 0.02),
    "rejection_peak": QuantityBand("dB", 0.1),
    "overshoot": QuantityBand("%", 1.0),
    "rise": QuantityBand("s", 0.02),
    "settling": QuantityBand("s", 0.02),
}
"""Quantities with a band: two margins, then `Responses`."""

RESPOND = {
    control: (attitude or rate, command, f"{attitude or rate}_disturbance")
    for (rate, attitude, control), command in zip(AXES.values(), COMMANDS, strict=True)
}
"""Output of each loop, its command and its disturbance."""


@dataclass(frozen=True)
class LoopMargins:
    """The loop of `control` at `airspeed` (m/s), the others closed: margins of the loop broken at
    the control (dB, deg), `Responses` to the command of its attitude (of d_ped: of the yaw rate),
    and half widths of their bands. `stable`: of all drawn helicopters; None: of some. Responses of
    an unstable loop are NaN.
    """

    airspeed: float
    control: str
    stable: bool | None
    crossover: float
    gain: float
    gain_band: float
    phase: float
    phase_band: float
    bandwidth: float
    bandwidth_band: float
    peak: float
    peak_band: float
    rejection: float
    rejection_band: float
    rejection_peak: float
    rejection_peak_band: float
    overshoot: float
    overshoot_band: float
    rise: float
    rise_band: float
    settling: float
    settling_band: float

    def banded(self, name: str) -> tuple[float, float]:
        """Value and half width of the band of one of `QUANTITIES`."""
        return getattr(self, name), getattr(self, f"{name}_band")


def loop_margins(
    helicopters: Sequence[Helicopter],
    loops: HelicopterLoops,
    airspeeds: Sequence[float],
    *,
    servos: Mapping[str, Servo] | Actuation | None = None,
    delay: float = 0.0,
) -> list[LoopMargins]:
    """Return margins and responses of every loop at every airspeed: those of the first helicopter,
    with bands from the others, which are drawn from its uncertainty; without others the bands are
    their least. A drawn helicopter without a trim is left out: the one that flew has one.

    `delay` (s) is from command to servo, in whole periods of the loops. Raises `InputError` where
    it is not.
    """
    actuation, rows = Actuation.of(servos, delay, loops.dt), []
    for airspeed in tracked("margins", airspeeds):
        each = [_at(h, loops, airspeed, actuation) for h in helicopters]
        if each[0] is None:
            raise InputError(
                f"the helicopter has no trim at {airspeed:g} m/s: leave this airspeed out"
            )
        found = np.array([one for one in each if one is not None])
        for k, control in enumerate(CONTROLS):
            rows.append(_row(float(airspeed), control, found[:, k]))
    return rows


def _at(
    heli: Helicopter, loops: HelicopterLoops, airspeed: float, actuation: Actuation
) -> list[list[float]] | None:
    """Of each control: 1 where stable, crossover (rad/s), then `QUANTITIES`; None without a
    trim.
    """
    try:
        model = symheli.linearize(heli, symheli.trim(heli, airspeed=float(airspeed)))
    except TrimError:
        return None
    plant = actuation.discretize(model)
    closed = closed_loops(plant, loops)
    unknown = Responses(*[math.nan] * len(Responses._fields))
    reached = responses(closed, RESPOND) if closed.is_stable() else dict.fromkeys(CONTROLS, unknown)
    out = []
    for control in CONTROLS:
        found = margins(open_loop(plant, loops.linear, control))
        decibels = [abs(20 * math.log10(g)) if g > 0 else math.inf for g in found.gain]
        gain = min(*decibels, LARGEST) if found.stable else 0.0
        phase = min(math.degrees(found.phase), 180.0)
        crossover = max(found.crossover, default=0.0)
        out.append([float(found.stable), crossover, gain, phase, *reached[control]])
    return out


def _row(airspeed: float, control: str, found: Array) -> LoopMargins:
    """`found` (helicopters, 11): stable, crossover, quantities."""
    stable = bool(found[0, 0]) if np.all(found[:, 0] == found[0, 0]) else None
    spread = found[1:, 2:].std(axis=0) if len(found) > 1 else np.zeros(len(QUANTITIES))
    banded: dict[str, float] = {}
    for name, value, sd in zip(QUANTITIES, found[0, 2:], spread, strict=True):
        banded[name] = float(value)
        banded[f"{name}_band"] = max(DEVIATIONS * float(sd), QUANTITIES[name].least)
    return LoopMargins(airspeed, control, stable, float(found[0, 1]), **banded)
