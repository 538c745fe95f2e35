"""How near identified models come to the helicopter under real conditions: servos, delay and
governor, late sensors, steady wind, few samples, much noise.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np

from evidence.marks.coverage import at_points
from evidence.seeds import by_name, parser_of
from evidence.tables import DOCS, keep, kept_rows, markdown, parsed
from identification.judge import frozen_stability, structure_bias
from identification.model import KinematicModel
from studies.known_kinematics.conditions import (
    ALL,
    CONDITIONS,
    SENSORS_LATE,
    Instruments,
    RealCondition,
    frozen_all,
    wind_of,
)
from studies.known_kinematics.models import PAIRS
from studies.known_kinematics.truth import SPEEDS, Truth
from studies.output import as_json
from symheli import FlightRecord
from symheli.errors import DataWarning
from symheli.flight import SimulatedFlight

FOUND_WITHIN = 0.002
"""Error of a delay that counts as found, s."""

CALLS = 50
"""Draws of a call of stability."""

PARTS = ("actuators", "sensors", "wind")


@dataclass(frozen=True, kw_only=True)
class Marks:
    """Of one seed: worst nu-gap in all axes, the airspeed where (m/s), what was found of the
    actuators, the sensors and the wind, with its standard deviation, and at how many airspeeds
    stability is called not known, and wrongly.
    """

    seed: int
    gap: float
    airspeed: float
    found: dict[str, dict[str, tuple[float, float]]]
    calls: tuple[int, int] = (0, 0)


def of_seed(name: str, seed: int, truth: str = "xcell60") -> Marks:
    """Fly, identify, judge."""
    condition = CONDITIONS[name]
    heli, simulator = (condition.helicopter(vehicle) for vehicle in (truth, PAIRS[truth]))
    records = condition.flights(heli, seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        source = Instruments(SimulatedFlight(simulator))
        model = condition.identified(condition.structure(records[0]), records, source)
    exact = condition.truth(heli)
    gap = exact.compare(frozen_all(model))[ALL]["model"].gap
    return Marks(
        seed=seed,
        gap=float(gap.max()),
        airspeed=float(SPEEDS[gap.argmax()]),
        found={name: model.details[name] for name in PARTS if name in model.details},
        calls=stability_calls(model, records, source, exact, condition.truth(simulator)),
    )


def stability_calls(
    model: KinematicModel,
    records: Sequence[FlightRecord],
    source: Instruments | SimulatedFlight,
    truth: Truth,
    simulated: Truth,
) -> tuple[int, int]:
    """At how many of `SPEEDS` stability is called not known, and at how many wrongly, with the bias
    of the structure. `simulated`: the exact models of the simulator's vehicle.
    """
    there = at_points(model, simulated.models[ALL], range(len(SPEEDS)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        bias = structure_bias(model, records, source, there)
    points = [(float(v), 0.0)[: len(model.parameters)] for v in SPEEDS]
    calls = frozen_stability(model, points, draws=CALLS, bias=bias).calls
    exact = ["stable" if m.is_stable() else "unstable" for m in truth.models[ALL]]
    unknown = calls.count("not known")
    return unknown, sum(a != b for a, b in zip(calls, exact, strict=True)) - unknown


def row(name: str, marks: Sequence[Marks]) -> tuple[str, ...]:
    """Median, worst, mark, and how well the delay was found."""
    condition = CONDITIONS[name]
    gaps = np.array([m.gap for m in marks])
    worst = marks[int(gaps.argmax())]
    met = np.median(gaps) <= condition.mark and worst.gap <= 2 * condition.mark
    return (
        condition.about,
        f"{condition.mark:g}",
        f"{np.median(gaps):.3f}",
        f"{worst.gap:.3f} ({worst.seed})",
        "met" if met else "MISSED",
        _found(condition, marks),
        _called(marks),
        f"{marks[0].seed} to {marks[-1].seed}, {date.today():%d %B %Y}",
    )


def _called(marks: Sequence[Marks]) -> str:
    """Airspeeds where stability is not known, median and worst, and the sum of wrong calls."""
    unknown, wrong = np.array([m.calls for m in marks]).T
    return f"{np.median(unknown):.0f} ({unknown.max()}); {wrong.sum()}"


def _found(condition: RealCondition, marks: Sequence[Marks]) -> str:
    """How far the delays, and the winds, that were found are from the true ones."""
    late = SENSORS_LATE if condition.sensors else condition.flown.delay
    delays = [m.found[part]["delay"][0] for m in marks for part in PARTS[:2] if part in m.found]
    if delays:
        off = np.abs(np.array(delays) - late)
        within = int(np.sum(off <= FOUND_WITHIN))
        return (
            f"delay off by {1e3 * np.median(off):.2f} ms, at most {1e3 * off.max():.2f}"
            f" ({within} of {len(off)} within 2)"
        )
    winds = [m for m in marks if "wind" in m.found]
    if not winds:
        return ""
    errors, inside = [], 0
    for m in winds:
        found = np.array([m.found["wind"][name] for name in ("north", "east")])
        true = wind_of(m.seed, condition.wind)
        errors.append(float(np.hypot(*(found[:, 0] - true))))
        inside += int(np.sum(np.abs(found[:, 0] - true) <= 2.0 * found[:, 1]))
    return (
        f"wind off by {np.median(errors):.2f} m/s, at most {max(errors):.2f}; {inside} of"
        f" {2 * len(winds)} components within two deviations"
    )


HEAD = (
    "flight",
    "mark",
    "median",
    "worst (seed)",
    "",
    "found",
    f"stability not known, of {len(SPEEDS)} (worst); called wrongly",
    "seeds, day",
)


def table(
    truth: str, found: Mapping[str, Sequence[Marks]], shown: Sequence[Sequence[str]] = ()
) -> str:
    """A row a condition; of those that were not flown now the rows `shown` before stay."""
    rows = {each[0]: each for each in shown}
    rows |= {CONDITIONS[name].about: row(name, marks) for name, marks in found.items()}
    chosen = [rows[one.about] for one in CONDITIONS.values() if one.about in rows]
    return "\n".join(
        [
            f"Truth {truth}, instruments flown in {PAIRS[truth]}; worst nu-gap over airspeed, all"
            " axes.",
            "",
            markdown(HEAD, chosen),
        ]
    )


def main() -> None:
    """Print the marks of the conditions, and keep them in docs/identified.md."""
    parser = parser_of(__doc__, "0-20")
    parser.add_argument("--truth", default="xcell60", choices=sorted(PAIRS))
    parser.add_argument("--only", nargs="+", choices=CONDITIONS, help="default: every condition")
    options = parsed(parser, "identified.md", timed=False)
    found = by_name(options, of_seed, options.only or list(CONDITIONS))
    plain = {name: [vars(m) for m in of_name] for name, of_name in found.items()}
    print(as_json(plain) if options.json else table(options.truth, found))
    if options.write:
        page, section = DOCS / "identified.md", f"{options.truth} under real conditions"
        keep(page, section, table(options.truth, found, kept_rows(page, section)))


if __name__ == "__main__":
    from evidence.marks import (
        conditions,  # under its own name: its results are handed on and stored by it
    )

    conditions.main()
