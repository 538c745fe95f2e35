"""What a pilot takes to the field: the planned flights as tables and as parameters of an autopilot,
what they are to teach, and whether what was flown taught it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identification.design import Experiment, Plan, compare_experiments
from studies.campaigns.experiments import CANDIDATES, Candidate, Comparison
from studies.setup.axes import CHOICES, SCHEDULING, Axis
from studies.setup.flights import AMPLITUDE, TOP, autopilot_for
from symheli import AirspeedSchedule, Excitation, FlightRecord, Helicopter, fly
from symheli.errors import InputError, SymheliError
from symheli.flight.excitation import FADE_IN, FADE_OUT
from symheli.logs.files import text
from symheli.progress import tracked
from symheli.values.whole_files import write_text

MIXER = {"d_lat": 10, "d_lon": 11, "d_ped": 12, "d_col": 13}
"""SID_AXIS of the mixer's inputs, at which ArduPilot's SystemID mode adds its sweep
(ardupilot.org/copter/docs/parameters.html#sid-axis): behind its controllers, so that the sweep is
what the helicopter gets beside their answer.
"""

SWEPT, SWEEP = (0.2, 5.0), 40.0
"""Band of a sweep (Hz) and its length (s): two cycles at the lowest frequency take 10 s of it."""

SPEEDS = (0.0, 0.5, 1.0)
"""Airspeeds of the sweeps, parts of the largest."""

SCHEMA = "symheli flight plan"

ENOUGH = 1.25
"""Median ratio of the standard errors flown to those planned up to which a record is enough: it
holds at least two thirds (1 / 1.25^2) of the planned information.
"""

WEAK = 2.0
"""Ratio from which a single coefficient is named."""

COVERED = 0.8
"""Part of the planned range of airspeed that a record has to cover."""

STEP = 0.02
"""s between the rows of a table, and the samples of a record that is held against the plan."""

PLAYER = '''\
#!/usr/bin/env python3
"""Play a table of this folder: python play.py FILE.csv [SPEED]

Writes a line "time,value,..." on standard output at the time of each row, for a program that adds
the values to the commands of a simulator or a test stand; it sends nothing to a vehicle by itself.
An autopilot plays the .param files on its own.
"""

import csv
import sys
import time


def main():
    with open(sys.argv[1], newline="") as file:
        rows = list(csv.reader(file))
    speed = float(sys.argv[2]) if len(sys.argv) > 2 else 1.0
    print(",".join(rows[0]), flush=True)
    start = time.monotonic()
    for row in rows[1:]:
        wait = float(row[0]) / speed - (time.monotonic() - start)
        if wait > 0:
            time.sleep(wait)
        print(",".join(row), flush=True)


if __name__ == "__main__":
    main()
'''


@dataclass(frozen=True)
class Sweeps:
    """Sweeps of an axis's inputs, one after the other, at a held airspeed (m/s); `amplitude` is a
    factor on that of the study.
    """

    axis: Axis
    airspeed: float
    amplitude: float = 1.0

    @property
    def name(self) -> str:
        """Description in words."""
        return f"sweep {SWEPT[0]:g}-{SWEPT[1]:g} Hz x{self.amplitude:g}, {self.airspeed:g} m/s"

    @property
    def excitation(self) -> Excitation:
        """Signals that are added to the inputs."""
        sizes = {name: self.amplitude * AMPLITUDE[name] for name in self.axis.inputs}
        return Excitation(sizes, "sweep", SWEPT, period=SWEEP)

    def fly(self, heli: Helicopter) -> FlightRecord:
        """The simulated flight, stabilised by the autopilot of the study."""
        seconds = SWEEP * len(self.axis.inputs)
        steady = AirspeedSchedule((self.airspeed,), (1.0,), (seconds,), self.airspeed, lead=0.0)
        autopilot = autopilot_for(heli)
        return fly(heli, steady, excitation=self.excitation, controller=autopilot, dt=STEP)

    def parameters(self, heli: Helicopter) -> Iterator[tuple[str, str]]:
        """(input, content of a file of parameters) for each input."""
        for name, size in self.excitation.amplitude.items():
            travel = float(heli.travel[heli.inputs.index(name)])
            values = {
                "SID_AXIS": MIXER[name],
                "SID_MAGNITUDE": round(size / travel, 4),
                "SID_F_START_HZ": SWEPT[0],
                "SID_F_STOP_HZ": SWEPT[1],
                "SID_T_FADE_IN": FADE_IN * SWEEP,
                "SID_T_REC": SWEEP,
                "SID_T_FADE_OUT": FADE_OUT * SWEEP,
            }
            head = (
                f"# {name}, trimmed at {self.airspeed:g} m/s: {size:g} rad of {travel:g} rad to"
                " either side. Check that 1 at the mixer is that travel on your helicopter, begin"
                " with half of SID_MAGNITUDE, and keep a hand on the mode switch."
            )
            lines = [f"{key},{value:g}" for key, value in values.items()]
            yield name, "\n".join([head, *lines, ""])


def sweeps(
    heli: Helicopter, axis: Axis, limits: dict[str, float]
) -> tuple[list[Sweeps], list[Experiment], dict[str, str]]:
    """The largest sweeps within `limits` {signal: largest absolute value, SI} at each airspeed,
    what each tells, and those that were lost, with the reason.
    """
    made, found, lost = [], [], {}
    for part in tracked("finding the largest sweeps", SPEEDS):
        for amplitude in (1.5, 1.0, 0.5, 0.25):
            sweep = Sweeps(axis, part * TOP, amplitude)
            try:
                record = sweep.fly(heli)
            except SymheliError as error:
                lost[sweep.name] = str(error)
                continue
            (one,) = compare_experiments(axis.structure(), {sweep.name: record}, limits)
            if one.allowed:
                made.append(sweep)
                found.append(one)
                break
    return made, found, lost


def write(
    folder: Path,
    vehicle: str,
    axis: Axis,
    found: Comparison,
    limits: dict[str, float],
    candidates: Sequence[Candidate] = CANDIDATES,
) -> tuple[list[Path], str]:
    """Write tables, parameters, a player and plan.json; return the paths, and what they hold in
    words.
    """
    heli = Helicopter.load(vehicle, governor="ideal")
    made, compared, lost = sweeps(heli, axis, limits)
    written = []
    for number, experiment in enumerate(found.plan.experiments, 1):
        candidate = next(c for c in candidates if c.name == experiment.name)
        time = np.arange(0.0, experiment.duration + STEP / 2, STEP)
        name = folder / f"{number}-{_file_name(experiment.name)}.csv"
        command = candidate.schedule(time)[0]
        written.append(_table(name, time, command, candidate.excitation(axis), heli))
    for sweep in made:
        stem = folder / _file_name(sweep.name)
        time = np.arange(0.0, SWEEP * len(axis.inputs), STEP)
        steady = np.full(len(time), sweep.airspeed)
        written.append(
            _table(stem.with_name(f"{stem.name}.csv"), time, steady, sweep.excitation, heli)
        )
        for name, content in sweep.parameters(heli):
            path = stem.with_name(f"{stem.name}-{name}.param")
            write_text(path, content)
            written.append(path)
    write_text(folder / "play.py", PLAYER)
    plan = {
        "schema": SCHEMA,
        "version": 1,
        "vehicle": vehicle,
        "axis": axis.name,
        "step": STEP,
        "airspeed": [0.0, TOP],
        "flights": [_data(one) for one in found.plan.experiments],
        "sweeps": [_data(one) for one in compared],
    }
    write_text(folder / "plan.json", json.dumps(plan, indent=1))
    written += [folder / "play.py", folder / "plan.json"]
    return written, _words(found.plan, compared, lost)


def _words(plan: Plan, compared: Sequence[Experiment], lost: dict[str, str]) -> str:
    best = float(np.median(plan.bounds))
    lines = []
    if compared:
        swept = Plan(tuple(compared), ()).bounds
        seen = np.isfinite(swept)
        lines.append(
            f"sweeps as SystemID flies them, {len(compared)} airspeeds from 0 to {TOP:g} m/s:"
            f" median standard error {np.median(swept[seen]) / best:.2f} of that of the plan;"
            f" {int((~seen).sum())} of {len(swept)} coefficients stay unknown, since the airspeed"
            " is held"
        )
    lines += [f"lost: {name}: {why}" for name, why in lost.items()]
    return "\n".join(lines)


def _table(
    path: Path, time: np.ndarray, airspeed: np.ndarray, excitation: Excitation, heli: Helicopter
) -> Path:
    """Write time (s), commanded airspeed (m/s) and what is added to each input: rad, and parts of
    its travel to either side.
    """
    signals = excitation(time)
    travel = dict(zip(map(str, heli.inputs), map(float, heli.travel), strict=True))
    head = ["t [s]", "airspeed_command [m/s]"]
    head += [f"e_{name} [rad]" for name in signals]
    head += [f"e_{name}_of_travel [1]" for name in signals]
    values = [time, airspeed, *signals.values(), *(s / travel[n] for n, s in signals.items())]
    lines = [",".join(f"{v:.6g}" for v in row) for row in zip(*values, strict=True)]
    write_text(path, "\n".join([",".join(head), *lines, ""]))
    return path


def _file_name(name: str) -> str:
    return re.sub(r"[^\w.-]+", "-", name.replace("m/s^2", "mps2").replace("m/s", "mps"))


def _data(one: Experiment) -> dict[str, Any]:
    return {"name": one.name, "seconds": one.duration, "factor": one.factor.tolist()}


@dataclass(frozen=True)
class FlownPlan:
    """What was flown against what was planned: the ratio of the standard errors (n,) for residuals
    of one size, by regressor that the plan determines, and the range of airspeed (m/s) that was
    covered and planned.
    """

    ratio: np.ndarray
    names: tuple[str, ...]
    seconds: float
    covered: tuple[float, float]
    planned: tuple[float, float]

    @property
    def part(self) -> float:
        """Part of the planned range of airspeed that was covered."""
        low, high = (np.clip(v, *self.planned) for v in self.covered)
        return float((high - low) / (self.planned[1] - self.planned[0]))

    @property
    def median(self) -> float:
        """Median ratio; infinite where half of the coefficients are unknown."""
        return float(np.median(self.ratio))

    @property
    def enough(self) -> bool:
        """Whether the records tell about what was planned, over about the airspeeds planned."""
        return self.median <= ENOUGH and self.part >= COVERED

    def __str__(self) -> str:
        weak = [n for n, r in zip(self.names, self.ratio, strict=True) if r > WEAK]
        more = self.median**2 - 1
        lines = [
            f"standard errors {self.median:.2f} times those planned (median, residuals of one"
            f" size), {self.ratio.min():.2f} to {self.ratio.max():.2f}",
            f"airspeed {self.covered[0]:.1f} to {self.covered[1]:.1f} m/s,"
            f" {100 * self.part:.0f} % of the planned {self.planned[0]:g} to {self.planned[1]:g}",
        ]
        if weak:
            lines.append(
                f"{len(weak)} of {len(self.names)} coefficients more than {WEAK:g} times less"
                f" certain: {', '.join(weak[:6])}{', ...' if len(weak) > 6 else ''}"
            )
        if self.enough:
            return "\n".join(["this is enough", *lines])
        if self.median > ENOUGH and np.isfinite(more):
            lines.append(f"fly about {more * self.seconds:.0f} s more of the same kind")
        if self.part < COVERED:
            lines.append("fly the airspeeds that are missing")
        return "\n".join(["this is not enough", *lines])


def flown(plan: Path, records: Sequence[FlightRecord], *, sweeps: bool = False) -> FlownPlan:
    """Hold records against a plan.json, its flights or its sweeps.

    Records have its signals at its step; the commanded airspeed may be missing where the measured
    one is there, and then schedules in its place.

    Raises `InputError` for a file that is no plan, and for records of other signals or steps.
    """
    what = "sweeps" if sweeps else "flights"
    try:
        content = json.loads(text(plan))
        axis = next(a for a in CHOICES.values() if a.name == content["axis"])
        step, (low, high) = float(content["step"]), map(float, content["airspeed"])
        if content["schema"] != SCHEMA or content["version"] != 1 or not content[what]:
            raise ValueError(content["schema"])
        flights = tuple(
            Experiment(str(f["name"]), float(f["seconds"]), np.array(f["factor"], float), {})
            for f in content[what]
        )
    except (ValueError, KeyError, TypeError, StopIteration) as error:
        raise InputError(
            f"{plan}: expected the plan.json that symheli experiment --write wrote ({error!r})"
        ) from error
    structure = axis.structure()
    if any(len(f.factor) != len(structure.regressor_names) for f in flights):
        raise InputError(f"{plan}: written for another structure; write the plan once more")
    held = {f"record {i}": _fitting(r, axis, step) for i, r in enumerate(records, 1)}
    compared = compare_experiments(structure, held, {})
    planned = Plan(flights, ()).bounds
    speed = np.concatenate([held_one[SCHEDULING] for held_one in held.values()])
    excited = np.isfinite(planned)
    return FlownPlan(
        Plan(compared, ()).bounds[excited] / planned[excited],
        tuple(n for n, wanted in zip(structure.regressor_names, excited, strict=True) if wanted),
        sum(one.duration for one in compared),
        (float(np.nanmin(speed)), float(np.nanmax(speed))),
        (low, high),
    )


def _fitting(record: FlightRecord, axis: Axis, step: float) -> FlightRecord:
    names = {*map(str, record.signals)}
    if SCHEDULING not in names and "airspeed" in names:
        record = record.with_signals({SCHEDULING: "m/s"}, **{SCHEDULING: record["airspeed"]})
    needed = [*axis.outputs, *axis.inputs, SCHEDULING]
    if missing := [name for name in needed if name not in {*map(str, record.signals)}]:
        raise InputError(
            f"the record lacks {', '.join(missing)}; name the columns in a signal map, --map"
        )
    if abs(record.dt - step) > 1e-3 * step:
        raise InputError(
            f"the record has steps of {record.dt:g} s, the plan of {step:g} s: what they tell does"
            f" not compare; read it with dt = {step:g} in the signal map"
        )
    return record.select(needed)
