"""A flown flight as a record, and why it was lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symheli.errors import UnknownNameError
from symheli.flight.course import Clock, Course
from symheli.flight.disturbance import excitation_of
from symheli.flight.loops import LEVEL
from symheli.flight.plan import FlightPlan
from symheli.helicopter import Helicopter
from symheli.records.flight_record import FlightRecord
from symheli.values.arrays import Array
from symheli.values.signal import UNITS

WIND = ("wind_n", "wind_e", "wind_d")


@dataclass(frozen=True, eq=False)
class FlightData:
    """One flight: its plan and course, `out` (kept, nx + 9) as the loop leaves it, and the control
    sample at which it was `lost`, or -1.
    """

    heli: Helicopter
    plan: FlightPlan
    clock: Clock
    course: Course
    out: Array
    lost: int

    @property
    def kept(self) -> int:
        """Record samples flown."""
        flown = len(self.course.time) if self.lost < 0 else self.lost
        return -(-flown // self.clock.every)

    def columns(self) -> dict[str, Array]:
        """Every signal of the record by name."""
        heli, plan, clock, n = self.heli, self.plan, self.clock, self.kept
        nx, own = len(heli.states), slice(0, n * clock.every, clock.every)
        inputs = tuple(map(str, heli.inputs))
        out = self.out[:n]
        columns = {str(s): out[:, i] for i, s in enumerate(heli.states)}
        columns |= {s: out[:, nx + i] for i, s in enumerate(inputs)}
        added = np.broadcast_to(excitation_of(plan, self.course), (len(self.course.time), 4))[own]
        columns |= {f"e_{s}": added[:, i] for i, s in enumerate(inputs)}
        if plan.servos is not None or plan.delay:
            columns |= {f"{s}_command": out[:, nx + 4 + i] for i, s in enumerate(inputs)}
        if not plan.wind.is_steady:
            wind = plan.wind.history(self.course.time, self.course.p[:, 0])[own]
            columns |= {name: wind[:, i] for i, name in enumerate(WIND)}
        columns |= {"airspeed": out[:, nx + 8], "airspeed_command": self.course.p[own, 0]}
        held = self.course.reference[own]
        names = (*map(str, heli.states), *inputs)
        return columns | {f"{s}_reference": held[:, i] for i, s in enumerate(names)}

    def column(self, name: str) -> Array:
        """One signal (kept,) of the record."""
        columns = self.columns()
        if name not in columns:
            raise UnknownNameError("signal", name, columns)
        return columns[name]

    def record(self) -> FlightRecord | None:
        """Everything until the end, or until it was lost; None where that is less than two
        samples.
        """
        if self.kept < 2:
            return None
        columns = self.columns()
        known = UNITS | {str(s): s.unit for s in self.heli.states}
        units = {name: known[_plain(name, known)] for name in columns}
        time = self.course.time[:: self.clock.every][: self.kept]
        record = FlightRecord.from_arrays(time, units, self._note(), **columns)
        object.__setattr__(record, "meta", {"plan": self.plan})
        return record

    def _note(self) -> str:
        note = (
            f"{self.heli.vehicle.title}, {self.heli.governor} governor, peak acceleration"
            f" {np.abs(self.course.p[:, 1]).max():.1f} m/s^2"
        )
        if self.plan.noise_db is not None:
            note += f", noise {self.plan.noise_db:g} dB below each signal, seed {self.plan.seed}"
        return note if self.lost < 0 else f"{note}; {self.cause()}"

    def cause(self) -> str:
        """When and how the flight was lost, and what was at its limit before."""
        k = self.lost
        text = (
            f"the flight was lost at {self.course.time[k]:.2f} s near {self.course.p[k, 0]:.1f} m/s"
        )
        nx, last = len(self.heli.states), self.out[max(self.kept - 1, 0)]
        signs = []
        for name, i in (("bank", 6), ("pitch", 7)):
            if abs(last[i]) > 0.8 * LEVEL:
                signs.append(f"{name} {np.degrees(last[i]):.0f} deg")
        second = self.out[max(0, self.kept - round(1 / self.plan.dt)) : self.kept, nx + 4 : nx + 8]
        share = (
            (np.abs(second) >= 0.999 * self.heli.travel).mean(axis=0) if len(second) else [0] * 4
        )
        signs += [
            f"{name} at its stop for {100 * part:.0f} % of the last second"
            for name, part in zip(self.heli.inputs, share, strict=True)
            if part > 0.1
        ]
        behind = last[nx + 8] - self.course.p[max(k - 1, 0), 0]
        if abs(behind) > 3.0:
            signs.append(
                f"airspeed {abs(behind):.0f} m/s {'above' if behind > 0 else 'below'} the command"
            )
        return text + (f" ({', '.join(signs)})" if signs else "")


ADVICE = "less excitation, noise, gusts, delay or acceleration, or another controller, please"


def _plain(name: str, known: dict[str, str]) -> str:
    if name in known:
        return name
    return name.removeprefix("e_").removesuffix("_command").removesuffix("_reference")
