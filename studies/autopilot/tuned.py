"""Margins and responses of an autopilot's loops around a calibrated helicopter over airspeed, with
their bands, before and after a change of gains.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

import symheli
from symheli import Helicopter, LinearModel, Servo
from symheli.errors import InputError, TrimError
from symheli.flight import HelicopterLoops
from symheli.flight.ardupilot import AXES, COMMANDS, MEASURED
from symheli.lpv import connect
from symheli.lpv.tools import Actuation
from symheli.progress import tracked
from synthesis.design.loops.loop_measures import LoopMeasures
from synthesis.design.loops.margins import margins, open_loop
from synthesis.design.loops.responses import Responses, responses

CONTROLS = tuple(control for _, _, control in AXES.values())

DEVIATIONS = 3.0
"""Half width of a band in standard deviations of the drawn helicopters."""


LEAST = {
    "gain": 0.1,
    "phase": 0.5,
    "bandwidth_3db": 0.02,
    "peak": 0.1,
    "rejection": 0.02,
    "rejection_peak": 0.1,
    "overshoot": 1.0,
    "rise": 0.02,
    "settling": 0.02,
}
"""Smallest half width of the band of each quantity, in its unit: what rounding, trims and a period
of the loops leave. Two margins, then `Responses`.
"""

RESPOND = {
    control: (attitude or rate, command, f"{attitude or rate}_disturbance")
    for (rate, attitude, control), command in zip(AXES.values(), COMMANDS, strict=True)
}
"""Output of each loop, its command and its disturbance."""


@dataclass(frozen=True)
class LoopAt:
    """The loop of `control` at `airspeed` (m/s), the others closed: margins where it is broken at
    the control, `Responses` to the command of its attitude (of d_ped: of the yaw rate), and their
    bands. Stable means: of all drawn helicopters; None: of some.
    """

    airspeed: float
    control: str
    measures: LoopMeasures

    @property
    def stable(self) -> bool | None:
        """Whether the loops are stable; None where that is not known."""
        return self.measures.stable

    def as_dict(self) -> dict[str, object]:
        """Every number by name, the half width of its band as `<name>_band`."""
        out: dict[str, object] = {"airspeed": self.airspeed, "control": self.control}
        out |= {"stable": self.stable, "crossover": self.measures["crossover"]}
        for name in LEAST:
            out[name], out[f"{name}_band"] = self.measures.banded(name)
        return out


def closed_loops(plant: LinearModel, loops: HelicopterLoops) -> LinearModel:
    """The plant, sampled at the period of the loops, under them: phi, theta (rad) and r (rad/s) by
    their commands and by disturbances of the same, in that order.
    """
    K = loops.commanded
    outputs = [attitude or rate for rate, attitude, _ in AXES.values()]
    disturbances = {y: f"{y}_disturbance" for y in outputs}
    return connect(
        plant.select(inputs=K.outputs, outputs=MEASURED),
        K,
        inputs=(*COMMANDS, *disturbances.values()),
        outputs=outputs,
        sums={y: {y: 1.0, d: 1.0} for y, d in disturbances.items()},
    )


def loop_margins(
    helicopters: Sequence[Helicopter],
    loops: HelicopterLoops,
    airspeeds: Sequence[float],
    *,
    servos: Mapping[str, Servo] | Actuation | None = None,
    delay: float = 0.0,
) -> list[LoopAt]:
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
        found = zip(*(one for one in each if one is not None), strict=True)
        for control, own in zip(CONTROLS, found, strict=True):
            rows.append(LoopAt(float(airspeed), control, _banded(own)))
    return rows


def _at(
    heli: Helicopter, loops: HelicopterLoops, airspeed: float, actuation: Actuation
) -> list[LoopMeasures] | None:
    """Numbers of the loop of each control; None without a trim."""
    try:
        model = symheli.linearize(heli, symheli.trim(heli, airspeed=float(airspeed)))
    except TrimError:
        return None
    plant = actuation.discretize(model)
    closed = closed_loops(plant, loops)
    unknown = Responses(*[math.nan] * len(Responses._fields))
    reached = responses(closed, RESPOND) if closed.is_stable() else dict.fromkeys(CONTROLS, unknown)
    return [
        LoopMeasures.of(margins(open_loop(plant, loops.linear, control)), reached[control])
        for control in CONTROLS
    ]


def _banded(found: Sequence[LoopMeasures]) -> LoopMeasures:
    """Numbers of the first helicopter with bands from the others."""
    first, *drawn = found
    bands = {}
    for name, least in LEAST.items():
        spread = float(np.std([one[name] for one in drawn])) if drawn else 0.0
        bands[name] = max(DEVIATIONS * spread, least)
    alike = all(one.stable == first.stable for one in drawn)
    return replace(first, stable=first.stable if alike else None, bands=bands)
