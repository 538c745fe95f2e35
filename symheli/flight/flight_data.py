"""A flown flight as a record, and why it was lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symheli.flight.course import Clock, Course
from symheli.flight.disturbance import excitation_of
from symheli.flight.flown_conditions import flown_conditions
from symheli.flight.in_numpy import MAX_BANK
from symheli.flight.plan import FlightPlan
from symheli.helicopter import Helicopter
from symheli.records.flight_record import FlightRecord
from symheli.values.arrays import Array
from symheli.values.signal import Signal, indices

WIND = ("wind_n", "wind_e", "wind_d")


@dataclass(frozen=True, eq=False)
class FlightData:
    """One flight: its plan and course, `out` (kept, nx + 9) from the closed loop, and the control
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
        """Number of record samples of the flight."""
        flown = len(self.course.time) if self.lost < 0 else self.lost
        return -(-flown // self.clock.every)

    def columns(self) -> dict[str, Array]:
        """Every signal of the record (kept,) by name."""
        table = _table(self.heli, self.plan)
        blocks = {block: self._block(block) for block in dict.fromkeys(b for _, b, _ in table)}
        return {str(signal): blocks[block][:, i] for signal, block, i in table}

    def column(self, name: str) -> Array:
        """One signal (kept,) of the record."""
        table = _table(self.heli, self.plan)
        _, block, i = table[indices([name], [s for s, _, _ in table], "signal")[0]]
        return self._block(block)[:, i]

    def _block(self, name: str) -> Array:
        """Return the signals of one source, side by side (kept, ...)."""
        flown = slice(0, self.kept * self.clock.every, self.clock.every)
        time, p = self.course.time, self.course.p
        match name:
            case "out":
                return self.out[: self.kept]
            case "added":
                added = excitation_of(self.plan, self.course)
                return np.broadcast_to(added, (len(time), added.shape[1]))[flown]
            case "wind":
                return self.plan.wind.history(time, p[:, 0])[flown]
            case "command":
                return p[flown]
        return self.course.reference[flown]

    def record(self) -> FlightRecord | None:
        """Return the record until the end, or until the flight was lost; None where that is less
        than two samples.
        """
        if self.kept < 2:
            return None
        time = self.course.time[:: self.clock.every][: self.kept]
        values = np.column_stack(list(self.columns().values()))
        return FlightRecord(
            time,
            values,
            signals_of(self.heli, self.plan),
            note=self._note(),
            meta={"plan": self.plan, "flown": flown_conditions(self.heli, self.plan)},
        )

    def _note(self) -> str:
        note = (
            f"{self.heli.vehicle.title}, {self.heli.governor} governor, peak acceleration"
            f" {np.abs(self.course.p[:, 1]).max():.1f} m/s^2"
        )
        if self.plan.noise_db is not None:
            note += f", noise {self.plan.noise_db:g} dB below each signal, seed {self.plan.seed}"
        return note if self.lost < 0 else f"{note}; {self.cause()}"

    def cause(self) -> str:
        """Return when and how the flight was lost, and which limit was reached before."""
        k = self.lost
        text = (
            f"the flight was lost at {self.course.time[k]:.2f} s near {self.course.p[k, 0]:.1f} m/s"
        )
        nx, last = len(self.heli.states), self.out[max(self.kept - 1, 0)]
        signs = []
        for name, i in (("bank", 6), ("pitch", 7)):
            if 0.8 * MAX_BANK < abs(last[i]) < np.pi:  # as read: noise may say anything
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


ADVICE = "reduce excitation, noise, gusts, delay or acceleration, or use another controller"


def signals_of(heli: Helicopter, plan: FlightPlan) -> tuple[Signal, ...]:
    """Return the signals of the record of a plan, in order."""
    return tuple(signal for signal, _, _ in _table(heli, plan))


def _table(heli: Helicopter, plan: FlightPlan) -> list[tuple[Signal, str, int]]:
    """Return for each signal of a record its block and its column there."""
    nx = len(heli.states)
    table = [(s, "out", i) for i, s in enumerate((*heli.states, *heli.inputs))]
    table += [(Signal(f"e_{s}", s.unit), "added", i) for i, s in enumerate(heli.inputs)]
    if plan.servos is not None or plan.delay:
        commands = (Signal(f"{s}_command", s.unit) for s in heli.inputs)
        table += [(s, "out", nx + 4 + i) for i, s in enumerate(commands)]
    if not plan.wind.is_steady:
        table += [(Signal(name), "wind", i) for i, name in enumerate(WIND)]
    table += [(Signal("airspeed"), "out", nx + 8), (Signal("airspeed_command"), "command", 0)]
    table.append((Signal("acceleration_command", "m/s^2"), "command", 1))
    held = (Signal(f"{s}_reference", s.unit) for s in (*heli.states, *heli.inputs))
    return table + [(s, "reference", i) for i, s in enumerate(held)]
