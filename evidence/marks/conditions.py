"""How near identified models come to the helicopter under real conditions: servos, delay and
governor, late sensors, steady wind, few samples, much noise.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

import symheli
from evidence.seeds import over_seeds, parser_of, seeds_of
from evidence.tables import DOCS, keep, markdown, parsed
from identification import Actuators, FilterError, KinematicARX, KinematicModel, fit
from studies.known_kinematics.flights import aggressive
from studies.known_kinematics.models import INPUTS, PAIRS, structure
from studies.known_kinematics.truth import AXES, SPEEDS, FrozenAxes, Truth, frozen
from studies.output import as_json
from studies.transition.flights import NOISE_DB, TOP, autopilot_for
from studies.transition.guarantees import PERIOD
from symheli import DataWarning, FlightPlan, FlightRecord, Helicopter, SimulatedFlight
from symheli.flight import XCELL_SERVOS, gain_scheduled_lqr
from symheli.values.kinematics import VELOCITIES

ALL = "all axes"
HALF = 75.0
"""Length of half a flight, s."""

FOUND_WITHIN = 0.002
"""Error of a delay that counts as found, s."""

ASSUMED, UNSURE = 0.03, 0.02
"""Delay before the flight, and its standard deviation, s."""

LAGS = {"d_lon": 2, "d_lat": 2, "d_col": 1, "d_ped": 1}
"""Of mean deflections: flapping stands behind the cyclic controls alone. A second lag of the others
would pass for a delay.
"""


@dataclass(frozen=True)
class Condition:
    """One kind of flight, what its identification is told, and the largest nu-gap asked for.

    Parameters
    ----------
    about : str
        In a table.
    mark : float
        Of the median; the worst may be twice it.
    servos : bool
        Servos of the X-Cell, 20 ms, and an engine whose governor does not hold the rotor.
    late : int
        Samples from a command to the servo, or the rotor.
    decimated : int
        Of so many samples one is logged.
    noise_db, longest : float
        Of the sensors; of the flight, s.
    told : Actuators, optional
        What is known of them.
    """

    about: str
    mark: float
    servos: bool = False
    late: int = 0
    decimated: int = 1
    noise_db: float = NOISE_DB
    longest: float = 150.0
    told: Actuators | None = None

    @property
    def period(self) -> float:
        """Time between two rows of the log, s."""
        return PERIOD * self.decimated

    def helicopter(self, name: str) -> Helicopter:
        """A vehicle with the engine of the condition."""
        return Helicopter.load(name, governor="pi" if self.servos else "ideal")

    def plan(self, heli: Helicopter, seed: int) -> FlightPlan:
        """The flight for identification."""
        autopilot = (
            gain_scheduled_lqr(heli, 0.0, TOP, PERIOD, servos=XCELL_SERVOS)
            if self.servos
            else autopilot_for(heli)
        )
        plan = aggressive(
            seed, autopilot, noise_db=self.noise_db, servos=self.servos, longest=self.longest
        )
        return replace(plan, delay=self.late * PERIOD)

    def logged(self, record: FlightRecord) -> FlightRecord:
        """What of a flight is in the log."""
        return record.rows(slice(None, None, self.decimated))

    def structure(self, record: FlightRecord) -> KinematicARX:
        """That of the study, from the commands where something stands between them and the
        rotor.
        """
        plain = structure()
        if self.told is None:
            return plain
        names = {u: f"{u}_command" if f"{u}_command" in record.signals else u for u in INPUTS}
        return replace(
            plain,
            inputs=tuple(names.values()),
            na=dict(zip(VELOCITIES, plain.na, strict=True)),
            nb={names[u]: n for u, n in LAGS.items()},
            actuators=self.told,
            rotor_speed="Om" if self.servos else None,
        )

    def truth(self, heli: Helicopter) -> Truth:
        """Exact linearizations of what was flown, from the commands, at the period of the log."""
        servos = XCELL_SERVOS if self.servos else None
        late = self.late // self.decimated
        return Truth.of(heli, {ALL: AXES[ALL]}, period=self.period, servos=servos, late=late)


FASTER = 1.2
"""Bandwidth of the servos that the identification is told, of the true one, where it is to find
it.
"""

WRONG_SERVOS = {
    u: replace(
        s,
        natural_frequency=FASTER * s.natural_frequency,
        zero=s.zero and FASTER * s.zero,
        pole=s.pole and FASTER * s.pole,
    )
    for u, s in XCELL_SERVOS.items()
}
NOT_QUITE = partial(Actuators, delay=ASSUMED, delay_deviation=UNSURE)

CONDITIONS: Mapping[str, Condition] = {
    "ideal": Condition("nothing in between, 50 Hz, 30 dB", 0.10),
    "servos": Condition(
        "servos, 20 ms, governor; servos known, delay found", 0.12, True, 1, told=NOT_QUITE(XCELL_SERVOS)
    ),
    "bandwidth": Condition(
        "the same; bandwidth and delay found",
        0.12,
        True,
        1,
        told=NOT_QUITE(WRONG_SERVOS, bandwidth_deviation=0.2),
    ),
    "delay": Condition("commands 40 ms late, delay found", 0.12, late=2, told=NOT_QUITE()),
    "25 Hz": Condition(
        "logged at 25 Hz, commanded at 50 Hz, said so", 0.10, decimated=2, told=Actuators(period=PERIOD)
    ),
    "25 Hz, untold": Condition("logged at 25 Hz, commanded at 50 Hz, not said", 0.10, decimated=2),
    "20 dB": Condition("20 dB of noise", 0.12, noise_db=20.0),
    "half": Condition("half a flight", 0.10, longest=HALF),
}


@dataclass(frozen=True, kw_only=True)
class Marks:
    """Of one seed: worst nu-gap in all axes, the airspeed where (m/s), and what was found of the
    actuators, with its standard deviation.
    """

    seed: int
    gap: float
    airspeed: float
    actuators: dict[str, tuple[float, float]]


def of_seed(name: str, seed: int, truth: str = "xcell60") -> Marks:
    """Fly, identify, judge."""
    condition = CONDITIONS[name]
    heli, simulator = (condition.helicopter(vehicle) for vehicle in (truth, PAIRS[truth]))
    record = condition.logged(symheli.fly(heli, condition.plan(heli, seed)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        model = fit(
            condition.structure(record), record, method=FilterError(SimulatedFlight(simulator))
        )
    gap = condition.truth(heli).compare(frozen_all(model))[ALL]["model"].gap
    return Marks(
        seed=seed,
        gap=float(gap.max()),
        airspeed=float(SPEEDS[gap.argmax()]),
        actuators=dict(model.details.get("actuators", {})),
    )


def frozen_all(model: KinematicModel) -> FrozenAxes:
    """The model in all axes at `SPEEDS`."""
    return {ALL: tuple(frozen(model, AXES[ALL], float(v)) for v in SPEEDS)}


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
        _delays(condition, marks),
        f"{len(marks)}",
    )


def _delays(condition: Condition, marks: Sequence[Marks]) -> str:
    """How far the delays that were found are from the true one."""
    found = [m.actuators["delay"][0] for m in marks if "delay" in m.actuators]
    if not found:
        return ""
    off = np.abs(np.array(found) - condition.late * PERIOD)
    within = int(np.sum(off <= FOUND_WITHIN))
    return f"{1e3 * np.median(off):.2f}, {1e3 * off.max():.2f} ({within} of {len(off)} within 2)"


HEAD = (
    "flight",
    "mark",
    "median",
    "worst (seed)",
    "",
    "delay off by, ms: median, worst",
    "seeds",
)


def table(truth: str, found: Mapping[str, Sequence[Marks]]) -> str:
    """A row a condition."""
    rows = [row(name, marks) for name, marks in found.items()]
    return "\n".join(
        [
            f"Truth {truth}, instruments flown in {PAIRS[truth]}; worst nu-gap over airspeed, all"
            " axes.",
            "",
            markdown(HEAD, rows),
        ]
    )


def main() -> None:
    """Print the marks of the conditions, and keep them in docs/identified.md."""
    parser = parser_of(__doc__, "0-20")
    parser.add_argument("--truth", default="xcell60", choices=sorted(PAIRS))
    parser.add_argument("--only", nargs="+", choices=CONDITIONS, help="default: every condition")
    options = parsed(parser, "identified.md", timed=False)
    names, seeds = options.only or list(CONDITIONS), seeds_of(options)
    calls = [partial(of_seed, name, seed, options.truth) for name in names for seed in seeds]
    marks = list(over_seeds(options, calls))
    found = {
        name: marks[i * len(seeds) : (i + 1) * len(seeds)] for i, name in enumerate(names)
    }
    text = table(options.truth, found)
    plain = {name: [vars(m) for m in of_name] for name, of_name in found.items()}
    print(as_json(plain) if options.json else text)
    if options.write:
        keep(DOCS / "identified.md", f"{options.truth} under real conditions", text)


if __name__ == "__main__":
    from evidence.marks import (
        conditions,  # under its own name: its results are handed on and stored by it
    )

    conditions.main()
