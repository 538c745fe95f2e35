"""`python -m evidence.sizes`: sizes of a first design, changed step by step by a stated rule until
nothing is missed of the specification sheet that a point design meets.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import symheli
import synthesis
from evidence.tables import DOCS, keep, markdown
from studies.controllers import starting
from studies.controllers.design_choices import (
    BACK_OFF,
    CONTROLS,
    NOISE_SHARE,
    SERVO_RATE,
    DesignChoices,
)
from studies.controllers.judged import travel_of
from studies.controllers.plant import baseline, design_plant
from symheli import Helicopter, LinearFamily, LPVStateSpace
from symheli.errors import SymheliError
from synthesis.design.lpv.point_schedule import hinf_at
from synthesis.sheet.evaluation import SpecificationTable, specifications
from synthesis.sheet.sheet import Sheet

PAGE, SECTION, PICTURE = DOCS / "howto" / "sizes.md", "steps of sizes", DOCS / "sizes.png"
VEHICLES = ("xcell60", "xcell_kahn_hudson", "yamaha_r50")
SPEEDS = (0.0, 6.5, 13.0)
"""Airspeeds at which the sheet is evaluated, m/s."""
STEPS = 5
"""Most changes of the sizes."""
COMMAND, SLOWER, DEVIATION = 2.0, 1.5, 0.7
"""Factors of a change: on the command of a slow axis; by which that of a fast axis is divided; on
the deviation of a slow axis.
"""
AXES = {
    "roll": ("d_lat", "v"),
    "pitch": ("d_lon", "u"),
    "yaw": ("d_ped", "r"),
    "heave": ("d_col", "w"),
}
"""Command and deviation of each axis of the sheet."""
SLOW = (
    "bandwidth",
    "disturbance rejection bandwidth",
    "equivalent delay",
    "inverse of the time constant",
)
"""Entries that a slow axis misses."""
UNTOUCHED = ("phase delay", "coupling", "coupling into yaw", "yaw rate at the stop")
"""Entries of which no size decides."""
FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Factors on the sizes of all commands in the picture."""

Entry = tuple[str, str]
"""Axis and name of an entry of the sheet."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """A vehicle and what its designs miss of the sheet at `SPEEDS`."""

    choices: DesignChoices
    met: set[tuple[Entry, float]] = field(default_factory=set)

    @classmethod
    def of(cls, vehicle: str) -> Trial:
        """Return that of the sizes of `symheli synthesize --write-config`."""
        return cls(choices=starting.for_vehicle(DesignChoices(vehicle=vehicle)))

    @cached_property
    def heli(self) -> Helicopter:
        """The equations, rotor speed held."""
        return Helicopter.load(self.choices.vehicle, governor="ideal")

    @cached_property
    def model(self) -> LPVStateSpace:
        """The model of the design."""
        return baseline(self.heli, self.choices)

    @cached_property
    def family(self) -> LinearFamily:
        """The exact linear models at `SPEEDS`."""
        return symheli.sweep(self.heli, SPEEDS, inputs=CONTROLS)

    @cached_property
    def sheet(self) -> Sheet:
        """The sheet for the rotor of the vehicle."""
        return Sheet.load().at_length(self.heli.vehicle.sections["main_rotor"]["radius"].value)

    def evaluated(
        self, controllers: Mapping[str, object], at: Sequence[float] = SPEEDS
    ) -> SpecificationTable:
        """Return the sheet of controllers behind servos and delay."""
        a = self.choices
        return specifications(
            self.family,
            controllers,
            self.sheet,
            at=at,
            servos=a.actuation,
            travel=travel_of(a),
            rate_limit=dict.fromkeys(a.controls, SERVO_RATE),
        )

    def points(self, choices: DesignChoices) -> None:
        """Add to `met` what the point designs of these sizes meet, each at its airspeed."""
        plant = design_plant(self.model, choices=choices)
        for v in SPEEDS:
            made = hinf_at(plant, [v], BACK_OFF).controller
            if made is None:
                continue
            table = self.evaluated({"": made.discretize(choices.period)}, [v])
            inside = (r for r in table.reached("") if r.specification.counts and r.margin >= 0)
            self.met.update(((r.specification.axis, r.specification.name), v) for r in inside)

    def scheduled(self, choices: DesignChoices) -> SpecificationTable:
        """Return the sheet of LPV output feedback of these sizes, Y of degree 2."""
        plant = design_plant(self.model, choices=choices)
        made = synthesis.output_feedback(plant, X=0, Y=2, back_off=choices.back_off)
        return self.evaluated({"": made.discretize(choices.period).model})


def missed(table: SpecificationTable) -> dict[tuple[Entry, float], float]:
    """Return the design margin, %, of each counted entry and airspeed that misses Level 1."""
    out: dict[tuple[Entry, float], float] = {}
    for k, v in enumerate(map(float, table.at)):
        for spec, values in zip(table.frozen, table.values[""], strict=True):
            if not spec.counts:
                continue
            value = float(values[k])
            margin = -math.inf if not table.stable[""][k] else spec.design_margin(value)
            if margin < 0:
                out[(spec.axis, spec.name), v] = margin
    return out


def changed(choices: DesignChoices, within: Mapping[Entry, float]) -> tuple[DesignChoices, str]:
    """Return the sizes after one step of the rule, and the change in words; `within`: what is
    missed and a point design meets, with its design margin, %.
    """
    sizes, words = dict(choices.sizes), []
    for axis, (command, deviation) in AXES.items():
        own = {n: m for (a, n), m in within.items() if a == axis and n not in UNTOUCHED}
        if not own:
            continue
        furthest = min(own, key=lambda name: own[name])
        if furthest in SLOW:
            most = travel_of(choices)[command]
            sizes[command] = min(COMMAND * sizes[command], most)
            sizes[deviation] *= DEVIATION
            words.append(f"{axis} faster ({furthest})")
        else:
            sizes[command] /= SLOWER
            words.append(f"{axis} slower ({furthest})")
    return replace(choices, sizes=sizes), "; ".join(words)


def probes(choices: DesignChoices) -> Iterator[DesignChoices]:
    """Yield sizes whose point designs tell what can be met: as given, quick, quiet, slow."""
    for commands, deviations, noise in (
        (1.0, 1.0, 1.0),
        (4.0, 0.5, NOISE_SHARE),
        (2.0, 0.5, NOISE_SHARE / 2),
        (0.5, 1.0, NOISE_SHARE),
    ):
        sizes = dict(choices.sizes)
        for command, deviation in AXES.values():
            sizes[command] *= commands
            sizes[deviation] *= deviations
        yield replace(choices, sizes=sizes, noise={y: noise * n for y, n in choices.noise.items()})


def steps(vehicle: str) -> Iterator[list[str]]:
    """Yield a row a step: vehicle, step, change, entries in Level 1, and missed though a point
    design meets them; stops where there is none of these.
    """
    trial = Trial.of(vehicle)
    for sizes in probes(trial.choices):
        trial.points(sizes)
    choices, change = trial.choices, "sizes of --write-config"
    for step in range(STEPS + 1):
        if step:
            trial.points(choices)
        try:
            table = trial.scheduled(choices)
        except SymheliError as error:
            yield [_name(vehicle), str(step), change, f"no design: {error.args[0]}", "", ""]
            return
        off = missed(table)
        within: dict[Entry, float] = {}
        for (entry, v), margin in off.items():
            if (entry, v) in trial.met:
                within[entry] = min(margin, within.get(entry, 0.0))
        every = {entry for entry, _ in off}
        counted = sum(s.counts for s in table.frozen)
        never = sorted(every - set(within))
        yield [
            _name(vehicle),
            str(step),
            change,
            f"{counted - len(every)} of {counted}",
            ", ".join(f"{a} {n} ({within[a, n]:.0f} %)" for a, n in sorted(within)) or "none",
            ", ".join(f"{a} {n}" for a, n in never) or "none",
        ]
        if not within:
            return
        following, change = changed(choices, within)
        if not change:
            return
        choices = following


def _name(vehicle: str) -> str:
    return Path(vehicle).stem


HEAD = (
    "vehicle",
    "step",
    "change",
    "in Level 1",
    "missed, met by a point design (margin)",
    "missed by the point designs too",
)


def picture(path: Path, vehicle: str = "xcell60") -> None:
    """Draw bandwidth, worst gain margin and control travel of each axis over a factor on
    the sizes of all commands, of point designs in the middle.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    trial = Trial.of(vehicle)
    drawn: dict[str, dict[str, list[float]]] = {}
    for factor in FACTORS:
        sizes = {n: s * (factor if n in CONTROLS else 1) for n, s in trial.choices.sizes.items()}
        quiet = {y: NOISE_SHARE * n for y, n in trial.choices.noise.items()}
        plant = design_plant(trial.model, choices=replace(trial.choices, sizes=sizes, noise=quiet))
        made = hinf_at(plant, [SPEEDS[1]], BACK_OFF).controller
        if made is None:
            raise SymheliError(f"no point design at {SPEEDS[1]:g} m/s for a factor of {factor:g}")
        table = trial.evaluated({"": made.discretize(trial.choices.period)}, [SPEEDS[1]])
        for r in table.reached(""):
            if r.specification.name in QUANTITIES:
                by = drawn.setdefault(r.specification.name, {})
                by.setdefault(r.specification.axis, []).append(r.value)
    figure, axes = plt.subplots(1, len(QUANTITIES), figsize=(9.5, 3.0), layout="constrained")
    for ax, (name, unit) in zip(axes, QUANTITIES.items(), strict=True):
        for axis, values in drawn[name].items():
            ax.semilogx(FACTORS, values, "o-", ms=3, label=axis)
        ax.set(title=name, ylabel=unit, xlabel="sizes of the commands, times")
        ax.set_xticks(FACTORS, [f"{f:g}" for f in FACTORS])
        ax.minorticks_off()
    axes[1].legend(fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)


QUANTITIES = {"bandwidth": "rad/s", "gain margin": "dB", "actuator effort": "% of travel"}
"""Entries of the picture and their units."""


def main(argv: Sequence[str] | None = None, show: Callable[[str], None] = print) -> int:
    """Print the table; --write: into the page, with its picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("vehicles", nargs="*", metavar="VEHICLE", help="packaged, or a file")
    parser.add_argument("--write", action="store_true", help=f"keep it in {PAGE.name}")
    arguments = parser.parse_args(argv)
    rows = []
    for vehicle in arguments.vehicles or VEHICLES:
        for row in steps(vehicle):
            rows.append(row)
            show(" | ".join(row))
    if arguments.write:
        picture(PICTURE)
        keep(PAGE, SECTION, markdown(HEAD, rows))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
