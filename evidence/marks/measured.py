"""How far identified models are from the exact ones, and how well they predict: flights of many
seeds, each identified with a simulator that is another vehicle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import symheli
from evidence.seeds import over_seeds, parser_of, seeds_of
from evidence.tables import DOCS, keep, parsed
from studies.known_kinematics.flights import aggressive, gentle, transition
from studies.known_kinematics.models import PAIRS, identified
from studies.known_kinematics.predictions import HORIZON, OUTPUTS, fits_of, states_of
from studies.known_kinematics.truth import SPEEDS, Truth, frozen_axes
from studies.output import as_json
from studies.setup.accelerating_baseline import along_the_command
from studies.setup.flights import TOP, autopilot_for
from symheli import FlightRecord, Helicopter
from symheli.values.arrays import Array

STATIC_SPEEDS = (0.0, 1.0, 2.0, 4.0, 7.0, 10.0, 13.0)
"""Airspeeds at which static gains are compared, m/s."""


@dataclass(frozen=True, kw_only=True)
class Marks:
    """Of one seed. `gaps`: worst nu-gap by axis and where; `stability`: airspeeds on which model
    and truth disagree; `static`: ratio of static gains by airspeed; fits in percent by output:
    `ahead` and `baseline` 1 s ahead against the noise-free states, `measured` against the measured
    ones, `closed_loop`.
    """

    seed: int
    gaps: dict[str, tuple[float, float]]
    stability: int
    static: dict[float, float]
    ahead: dict[str, float]
    baseline: dict[str, float]
    measured: dict[str, float]
    closed_loop: dict[str, float]


@dataclass(frozen=True)
class Setting:
    """What is identified, from what, and with which simulator."""

    truth: str = "xcell60"
    simulator: str = PAIRS["xcell60"]
    gentle: bool = False
    """Whether a gentle flight is identified besides."""

    def helicopters(self) -> tuple[Helicopter, Helicopter]:
        """Truth and simulator."""
        return (
            Helicopter.load(self.truth, governor="ideal"),
            Helicopter.load(self.simulator, governor="ideal"),
        )


def of_seed(setting: Setting, seed: int) -> Marks:
    """Fly, identify, judge."""
    heli, simulator = setting.helicopters()
    autopilot = autopilot_for(heli)
    flights = (aggressive, gentle) if setting.gentle else (aggressive,)
    training = [symheli.fly(heli, plan(seed, autopilot)) for plan in flights]
    model = identified(training, simulator)
    test = symheli.fly(heli, transition(seed, autopilot))
    truth = Truth.of(heli)
    models = frozen_axes(model, truth)
    beside = truth.compare(models)
    gaps = {name: one["model"].gap for name, one in beside.items()}
    clean = states_of(heli, test)
    return Marks(
        seed=seed,
        gaps={name: (float(g.max()), float(SPEEDS[g.argmax()])) for name, g in gaps.items()},
        stability=beside["all axes"].otherwise_stable("model"),
        static={v: truth.static_ratio(models, v) for v in STATIC_SPEEDS},
        ahead=fits_of(clean, model.predict(test, HORIZON)),
        baseline=fits_of(clean, baseline_of(heli, test)),
        measured=fits_of(test.columns(OUTPUTS), model.predict(test, HORIZON)),
        closed_loop=fits_of(clean, model.closed_loop(test)),
    )


def baseline_of(heli: Helicopter, record: FlightRecord) -> Array:
    """What the interpolated exact models over airspeed predict of a record, 1 s ahead from its
    measured states.
    """
    family = symheli.sweep(heli, np.linspace(0.0, TOP, 27))  # type: ignore[arg-type]
    lpv = family.interpolate("polynomial", 3)
    return along_the_command(lpv, heli).on(record).predict(OUTPUTS, HORIZON)


def table(setting: Setting, marks: Sequence[Marks], simulator_gaps: dict[str, float]) -> str:
    """Median and worst of every mark, with the mark."""
    lines = [
        f"Truth {setting.truth}, simulator {setting.simulator} (its own worst nu-gap:"
        f" {', '.join(f'{k} {v:.2f}' for k, v in simulator_gaps.items())}),"
        f" {len(marks)} seeds from {marks[0].seed} to {marks[-1].seed}"
        f"{', a gentle flight besides' * setting.gentle}.",
        "",
        "| | mark | median | worst (seed) | |",
        "|---|---|---|---|---|",
    ]
    limits = {"lateral": 0.05, "longitudinal": 0.05, "all axes": 0.10}
    for axis in marks[0].gaps:
        values = np.array([m.gaps[axis][0] for m in marks])
        lines.append(_row(f"worst nu-gap, {axis}", limits[axis], values, marks, 2 * limits[axis]))
    stable = np.array([m.stability for m in marks], float)
    lines.append(_row("airspeeds (of 27) where stability differs", 0.0, stable, marks, 0.0))
    for airspeed in marks[0].static:
        values = np.array([m.static[airspeed] for m in marks])
        off = np.abs(np.log(values))
        lines.append(
            f"| static gain at {airspeed:g} m/s, of the exact | "
            f"{'.6 to 1.6' if airspeed == 0 else 'printed' if airspeed < 2 else '.9 to 1.1'}"
            f" | {np.median(values):.3f} | {values[off.argmax()]:.3f}"
            f" ({marks[int(off.argmax())].seed}) | |"
        )
    goals = {"u": 94, "v": 65, "w": 94, "p": 95, "r": 75, "phi": 85, "theta": 94}
    for y in OUTPUTS:
        ahead, base, seen, loop = (
            np.array([getattr(m, kind)[y] for m in marks])
            for kind in ("ahead", "baseline", "measured", "closed_loop")
        )
        lines.append(
            f"| {y} 1 s ahead, % | {goals.get(y, 'printed')} | {np.median(ahead):.1f} |"
            f" {ahead.min():.1f} ({marks[int(ahead.argmin())].seed}) | baseline"
            f" {np.median(base):.1f}, behind it by {np.max(base - ahead):.1f} at most; of the"
            f" measured {np.median(seen):.1f}; recorded loop {np.median(loop):.1f},"
            f" {loop.min():.1f} |"
        )
    return "\n".join(lines)


def _row(name: str, mark: float, values: Array, marks: Sequence[Marks], worst: float) -> str:
    k = int(values.argmax())
    verdict = "met" if np.median(values) <= mark and values.max() <= worst else "MISSED"
    return (
        f"| {name} | {mark:g} | {np.median(values):.3f} | {values.max():.3f} ({marks[k].seed}) |"
        f" {verdict} |"
    )


def simulators_gaps(setting: Setting) -> dict[str, float]:
    """The worst nu-gap over airspeed of the simulator itself, by set of axes."""
    heli, simulator = setting.helicopters()
    own = Truth.of(heli).compare(Truth.of(simulator).models)
    return {name: float(one["model"].gap.max()) for name, one in own.items()}


def main() -> None:
    """Print the marks of a vehicle, and keep them in docs/identified.md."""
    parser = parser_of(__doc__, "0-20")
    parser.add_argument("--truth", default="xcell60", choices=sorted(PAIRS))
    parser.add_argument("--simulator", help="default: the other vehicle")
    parser.add_argument("--gentle", action="store_true", help="a gentle flight besides, of 230 s")
    options = parsed(parser, "identified.md", timed=False)
    setting = Setting(
        options.truth,
        options.simulator or PAIRS[options.truth],
        options.gentle,
    )
    calls = [partial(of_seed, setting, s) for s in seeds_of(options)]
    marks = list(over_seeds(options, calls))
    text = table(setting, marks, simulators_gaps(setting))
    print(as_json(_plain(marks)) if options.json else text)
    if options.write:
        keep(DOCS / "identified.md", setting.truth + ", two flights" * setting.gentle, text)


def _plain(marks: Sequence[Marks]) -> list[dict[str, Any]]:
    return [vars(m) | {"static": {f"{v:g}": g for v, g in m.static.items()}} for m in marks]
