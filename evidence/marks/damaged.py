"""What damages of a log cost each method: the aggressive flight as loggers leave it, read again,
identified, and held against the model of the undamaged log.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

import symheli
from evidence.marks.conditions import stability_calls
from evidence.seeds import by_name, parser_of
from evidence.tables import DOCS, keep, kept_rows, markdown, parsed
from identification import fit
from identification.methods import FilterError, InstrumentalVariables, Method
from studies.known_kinematics.conditions import ALL
from studies.known_kinematics.flights import aggressive
from studies.known_kinematics.models import PAIRS, structure
from studies.known_kinematics.truth import AXES, SPEEDS, Truth, frozen_axes
from studies.output import as_json
from studies.setup.flights import autopilot_for
from symheli import FlightRecord, Helicopter
from symheli.flight import SimulatedFlight
from symheli.values.arrays import Array
from symheli.values.kinematics import RIGID_BODY

Damage = Callable[[FlightRecord, np.random.Generator], FlightRecord]
"""From a record to the samples that its log holds."""

BURST, LOST = 8, 0.05
"""Mean number of rows lost at once; share of all rows that is lost."""

CLOCK = 0.01
"""Largest error of a stamp, as a part of a step."""

GAP = 5.0
"""s."""

EVERY, FROZEN = 30.0, 1.0
"""Time from one frozen spell to the next, and its length, s."""

STATES = tuple(map(str, RIGID_BODY))
SLOW = STATES[:3]
"""Signals of a sensor with half the rate: the velocities."""

COST = 1.2
"""Largest nu-gap, as a multiple of that of the undamaged log."""


def rows_lost(record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
    """Bursts of rows are missing, 5 % of all."""
    there = np.ones(len(record), bool)
    while there.mean() > 1 - LOST:
        first = int(rng.integers(1, len(record) - 1))
        there[first : first + int(rng.geometric(1 / BURST))] = False
    return record.rows(there)


def jitter(record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
    """Stamps up to 1 % of a step off."""
    off = CLOCK * record.dt * rng.uniform(-1, 1, len(record))
    return replace(record, time=record.time + off)


def gap(record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
    """Nothing was logged for 5 s."""
    start = rng.uniform(0.2, 0.8) * record.time[-1]
    return record.rows((record.time < start) | (record.time >= start + GAP))


def frozen(record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
    """One sensor stands still for a second, another one every 30 s."""
    values, names = record.values.copy(), list(map(str, record.signals))
    for start in np.arange(rng.uniform(1.0, EVERY / 2), record.time[-1] - FROZEN, EVERY):
        k = int(start / record.dt)
        i = names.index(STATES[int(rng.integers(len(STATES)))])
        values[k : k + round(FROZEN / record.dt), i] = values[k, i]
    return replace(record, values=values)


def half_rate(record: FlightRecord, _: np.random.Generator) -> FlightRecord:
    """Velocities have a new value every second row, and repeat it in between."""
    columns = {name: record[name].copy() for name in SLOW}
    for column in columns.values():
        column[1::2] = column[: 2 * (len(column) // 2) : 2]
    return _with_velocities(record, columns)


def more_noise(record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
    """Velocities have sqrt(2) times the noise: at 50 Hz they tell as much as at 25 Hz with the
    noise they have.
    """
    size = 10 ** (-record.meta["plan"].noise_db / 20)
    own = {name: size * record[name].std() for name in SLOW}
    columns = {n: record[n] + own[n] * rng.standard_normal(len(record)) for n in SLOW}
    return _with_velocities(record, columns)


def _with_velocities(record: FlightRecord, columns: Mapping[str, Array]) -> FlightRecord:
    """The record with other velocities, its signals in their order."""
    units = {str(s): s.unit for s in record.signals if str(s) in SLOW}
    return record.with_signals(units, **columns).select(list(map(str, record.signals)))


DAMAGES: Mapping[str, tuple[str, Damage]] = {
    "rows": ("5 % of the rows lost, in bursts of 8 on average", rows_lost),
    "jitter": ("stamps up to 1 % of a step off", jitter),
    "gap": ("a gap of 5 s", gap),
    "frozen": ("every 30 s one sensor frozen for 1 s", frozen),
    "25 Hz": ("velocities at 25 Hz in a log at 50 Hz", half_rate),
    "noise": ("for comparison: velocities at 50 Hz with sqrt(2) times the noise", more_noise),
}
COMPARED = "noise"
"""No damage of a log: as much is told of the velocities as at half the rate."""

CHEAP = {"least squares": "ls", "ridge": "ridge", "recursive least squares": "rls"}
METHODS = (*CHEAP, "instrumental variables", "filter error")
WHOLE = "none"


def method_named(name: str, source: SimulatedFlight) -> Method | str:
    """A method with its instruments."""
    flown = {
        "instrumental variables": lambda: InstrumentalVariables(source),
        "filter error": lambda: FilterError(source),
    }
    return CHEAP[name] if name in CHEAP else flown[name]()


@dataclass(frozen=True, kw_only=True)
class Marks:
    """Of one seed: worst nu-gap in all axes by damage, of the undamaged log as "none"; airspeeds
    where stability is called wrongly; what was said of the log.
    """

    seed: int
    gaps: dict[str, float]
    wrong: dict[str, int]
    said: dict[str, list[str]]


def read_again(record: FlightRecord, folder: Path) -> FlightRecord:
    """The record as it is read from its log, with the plan that was flown."""
    path = record.to_csv(folder / "log.csv")
    return replace(FlightRecord.from_csv(path).mended(), meta=record.meta)


@lru_cache(maxsize=1)
def _logs(truth: str, seed: int) -> tuple[dict[str, FlightRecord], dict[str, list[str]]]:
    """The flight of a seed with each damage, as it is read again, and what is said of it."""
    heli = Helicopter.load(truth, governor="ideal")
    record = symheli.fly(heli, aggressive(seed, autopilot_for(heli)))
    logs, said = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        for i, name in enumerate((WHOLE, *DAMAGES)):
            damage = DAMAGES[name][1] if name in DAMAGES else None
            rng = np.random.default_rng([seed, i])
            logged = record if damage is None else damage(record, rng)
            with warnings.catch_warnings(record=True) as heard:
                warnings.simplefilter("always")
                logs[name] = read_again(logged, Path(folder))
            said[name] = [str(w.message) for w in heard]
    return logs, said


def of_seed(
    name: str, seed: int, truth: str = "xcell60", *, damages: Sequence[str] = tuple(DAMAGES)
) -> Marks:
    """Fly, damage, read, identify by the method of this name, judge."""
    logs, said = _logs(truth, seed)
    logs = {damage: logs[damage] for damage in (WHOLE, *damages)}
    heli, simulator = (Helicopter.load(n, governor="ideal") for n in (truth, PAIRS[truth]))
    exact, other = (Truth.of(vehicle, {ALL: AXES[ALL]}) for vehicle in (heli, simulator))
    source = SimulatedFlight(simulator)
    gaps, wrong = {}, {}
    for damage, record in logs.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model = fit(structure(), record, method=method_named(name, source))
        found: Array = exact.compare(frozen_axes(model, exact))[ALL]["model"].gap
        gaps[damage] = float(found.max())
        if model.covariance is not None and name not in CHEAP:
            wrong[damage] = stability_calls(model, [record], source, exact, other)[1]
    return Marks(seed=seed, gaps=gaps, wrong=wrong, said=said)


HEAD = (
    "method",
    "damage",
    "undamaged: median, worst",
    "damaged",
    "ratio of medians",
    "largest of a seed",
    "",
    "stability called wrongly",
    "seeds, day",
)


def row(name: str, damage: str, marks: Sequence[Marks]) -> tuple[str, ...]:
    """What a damage costs a method."""
    whole, gaps = (np.array([m.gaps[d] for m in marks]) for d in (WHOLE, damage))
    ratio = float(np.median(gaps) / np.median(whole))
    worst = int((gaps / whole).argmax())
    wrong = [sum(m.wrong.get(d, 0) for m in marks) for d in (WHOLE, damage)]
    return (
        name,
        DAMAGES[damage][0],
        f"{np.median(whole):.3f}, {whole.max():.3f}",
        f"{np.median(gaps):.3f}, {gaps.max():.3f}",
        f"{ratio:.2f}",
        f"{gaps[worst] / whole[worst]:.2f} ({marks[worst].seed})",
        "" if damage == COMPARED else "met" if ratio <= COST else "MISSED",
        "" if name in CHEAP else f"{wrong[0]}, {wrong[1]} of {len(SPEEDS) * len(marks)}",
        f"{marks[0].seed} to {marks[-1].seed}, {date.today():%d %B %Y}",
    )


def table(
    truth: str, found: Mapping[str, Sequence[Marks]], shown: Sequence[Sequence[str]] = ()
) -> str:
    """A row a damage and method; of methods that were not tried now the rows `shown` before
    stay.
    """
    rows = {(each[0], each[1]): each for each in shown}
    for name, marks in found.items():
        rows |= {(name, DAMAGES[d][0]): row(name, d, marks) for d in marks[0].gaps if d != WHOLE}
    order = [(name, about) for name in METHODS for about, _ in DAMAGES.values()]
    return "\n".join(
        [
            f"Truth {truth}, instruments flown in {PAIRS[truth]}; worst nu-gap over airspeed, all"
            " axes. Stability: airspeeds of all seeds, undamaged and damaged.",
            "",
            markdown(HEAD, [rows[key] for key in order if key in rows]),
        ]
    )


def main() -> None:
    """Print what damages cost, and keep it in docs/identified.md."""
    parser = parser_of(__doc__, "0-20")
    parser.add_argument("--truth", default="xcell60", choices=sorted(PAIRS))
    parser.add_argument("--only", nargs="+", choices=METHODS, help="default: every method")
    parser.add_argument("--damage", nargs="+", choices=DAMAGES, help="default: every damage")
    options = parsed(parser, "identified.md", timed=False)
    call = partial(of_seed, damages=tuple(options.damage or DAMAGES))
    found = by_name(options, call, options.only or list(METHODS))
    plain = {name: [vars(m) for m in marks] for name, marks in found.items()}
    print(as_json(plain) if options.json else table(options.truth, found))
    if options.write:
        page, section = DOCS / "identified.md", f"{options.truth} damaged logs"
        keep(page, section, table(options.truth, found, kept_rows(page, section)))


if __name__ == "__main__":
    from evidence.marks import damaged  # under its own name: its results are handed on

    damaged.main()
