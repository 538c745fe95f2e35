"""How near identified models come to the helicopter under real conditions: servos, delay and
governor, late sensors, steady wind, few samples, much noise.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.integrate import cumulative_trapezoid

import symheli
from evidence.seeds import by_name, parser_of
from evidence.tables import DOCS, keep, markdown, parsed
from identification import (
    Actuators,
    FilterError,
    KinematicARX,
    KinematicModel,
    LateSensors,
    Polynomial,
    Product,
    SteadyWind,
    fit,
)
from identification.structure.kinematic_arx import STATES
from studies.known_kinematics.flights import aggressive
from studies.known_kinematics.models import FASTEST, INPUTS, PAIRS, SCHEDULING
from studies.known_kinematics.truth import AXES, SPEEDS, FrozenAxes, Truth, frozen
from studies.output import as_json
from studies.transition.flights import NOISE_DB, TOP, autopilot_for
from studies.transition.guarantees import PERIOD
from symheli import (
    DataWarning,
    FlightPlan,
    FlightRecord,
    Helicopter,
    Sensor,
    SimulatedFlight,
    Wind,
)
from symheli.flight import XCELL_SERVOS, gain_scheduled_lqr
from symheli.values.arrays import Array

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
    sensors : LateSensors, optional
        What is known of sensors that are 40 ms late.
    headings : tuple of float
        Of the flights, off the one into the wind, deg; empty: still air.
    prior : bool
        Whether the coefficients are taken to lie about the simulator's.
    over_ground : bool
        Whether speeds are commanded, and the coefficients scheduled, over ground.
    """

    about: str
    mark: float
    servos: bool = False
    late: int = 0
    decimated: int = 1
    noise_db: float = NOISE_DB
    longest: float = 150.0
    told: Actuators | None = None
    sensors: LateSensors | None = None
    headings: tuple[float, ...] = ()
    over_ground: bool = True
    prior: bool = False

    @property
    def period(self) -> float:
        """Time between two rows of the log, s."""
        return PERIOD * self.decimated

    def helicopter(self, name: str) -> Helicopter:
        """A vehicle with the engine of the condition."""
        return Helicopter.load(name, governor="pi" if self.servos else "ideal")

    def flights(self, heli: Helicopter, seed: int) -> list[FlightRecord]:
        """The flights for identification, as they are logged."""
        if not self.headings:
            return [self.logged(symheli.fly(heli, self.plan(heli, seed)))]
        longest, out = self.longest / len(self.headings), []
        for i, off in enumerate(self.headings):
            north, east = (
                WIND * np.cos(np.radians(180.0 - off)),
                WIND * np.sin(np.radians(180.0 - off)),
            )
            plan = replace(
                self.plan(heli, seed + i * ANOTHER, longest), wind=Wind((north, east, 0.0))
            )
            out.append(with_heading(symheli.fly(heli, plan), into_the_wind(seed) + off))
        return out

    def plan(self, heli: Helicopter, seed: int, longest: float | None = None) -> FlightPlan:
        """A flight for identification, heading north."""
        autopilot = (
            gain_scheduled_lqr(heli, 0.0, TOP, PERIOD, servos=XCELL_SERVOS)
            if self.servos
            else autopilot_for(heli)
        )
        plan = aggressive(
            seed,
            autopilot,
            noise_db=self.noise_db,
            servos=self.servos,
            longest=longest or self.longest,
        )
        if self.sensors is not None:
            plan = replace(
                plan,
                noise_db=None,
                sensors=self._late(symheli.fly(heli, replace(plan, noise_db=None))),
            )
        return replace(plan, delay=self.late * PERIOD)

    def _late(self, clean: FlightRecord) -> dict[str, Sensor]:
        """Sensors with the noise of the condition, some of them late."""
        size = 10.0 ** (-self.noise_db / 20.0)
        late = self.sensors.signals if self.sensors else ()
        return {
            name: Sensor(
                noise=size * float(np.std(clean[name])), delay=SENSORS_LATE * (name in late)
            )
            for name in STATES
        }

    def logged(self, record: FlightRecord) -> FlightRecord:
        """What of a flight is in the log."""
        return record.rows(slice(None, None, self.decimated))

    def structure(self, record: FlightRecord) -> KinematicARX:
        """Cubic in airspeed, linear in acceleration; from the commands where something stands
        between them and the rotor.
        """
        commanded = self.told is not None and f"{INPUTS[0]}_command" in record.signals
        names = {u: f"{u}_command" if commanded else u for u in INPUTS}
        ground = OVER_GROUND if self.headings and self.over_ground else None
        first = SCHEDULING[0] if ground is None else ground
        low, high = (0.0, TOP) if ground is None else (-AROUND, TOP + AROUND)
        return KinematicARX(
            tuple(names.values()),
            (first, SCHEDULING[1]),
            basis=Product(
                (Polynomial(3, low, high), Polynomial(1, -FASTEST, FASTEST)), total_degree=3
            ),
            nb={names[u]: n for u, n in LAGS.items()},
            offset_rate=False,
            actuators=self.told,
            rotor_speed="Om" if self.servos else None,
            wind=SteadyWind(deviation=WIND, over_ground=ground) if self.headings else None,
            sensors=self.sensors,
        )

    def truth(self, heli: Helicopter) -> Truth:
        """Exact linearizations of what was flown, from the commands, at the period of the log."""
        servos = XCELL_SERVOS if self.servos else None
        late = self.late // self.decimated
        return Truth.of(heli, {ALL: AXES[ALL]}, period=self.period, servos=servos, late=late)


WIND, ANOTHER = 5.0, 50_000
"""m/s; what is added to the seed for a second flight."""

AROUND = 12.0
"""How far from the airspeeds that are flown a speed over ground may be, m/s."""

OVER_GROUND = "speed_command"
SENSORS_LATE = 0.04
"""s."""


def into_the_wind(seed: int) -> float:
    """Heading of a seed that is into the wind, deg."""
    return float(np.random.default_rng(seed).uniform(0.0, 360.0))


def wind_of(seed: int) -> Array:
    """Where the wind of a seed blows to: north and east, m/s."""
    towards = np.radians(into_the_wind(seed) + 180.0)
    return WIND * np.array([np.cos(towards), np.sin(towards)])


def with_heading(record: FlightRecord, start: float) -> FlightRecord:
    """A flight that began northwards turned to the heading `start` (deg), integrated from its
    rates, with the speed over ground that was commanded along it.
    """
    phi, theta = record["phi"], record["theta"]
    turning = (record["q"] * np.sin(phi) + record["r"] * np.cos(phi)) / np.cos(theta)
    psi = np.radians(start) + cumulative_trapezoid(turning, dx=record.dt, initial=0.0)
    north = record.meta["plan"].wind.steady[0]
    return record.with_signals(
        {"psi": "rad", OVER_GROUND: "m/s"},
        psi=psi,
        **{OVER_GROUND: record[SCHEDULING[0]] + north},
    )


@dataclass(frozen=True)
class Instruments:
    """Simulated flights, with the heading of those that have one."""

    simulator: SimulatedFlight

    def flown(self, record: FlightRecord) -> FlightRecord:
        """The flight of a record in the simulator."""
        found = self.simulator.flown(record)
        if "psi" not in record.signals:
            return found
        return with_heading(found, float(np.degrees(record["psi"][0])))


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
        "servos, 20 ms, governor; servos known, delay found",
        0.12,
        True,
        1,
        told=NOT_QUITE(XCELL_SERVOS),
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
        "logged at 25 Hz, commanded at 50 Hz, said so",
        0.10,
        decimated=2,
        told=Actuators(period=PERIOD),
    ),
    "25 Hz, untold": Condition("logged at 25 Hz, commanded at 50 Hz, not said", 0.10, decimated=2),
    "sensors": Condition(
        "rates and attitude 40 ms late, found", 0.12, sensors=LateSensors(deviation=ASSUMED)
    ),
    "wind": Condition(
        "steady wind of 5 m/s, two headings, no air data; wind found", 0.12, headings=(-50.0, 50.0)
    ),
    "airspeed": Condition(
        "the same, airspeed known", 0.08, headings=(-50.0, 50.0), over_ground=False
    ),
    "20 dB": Condition("20 dB of noise; simulator as prior", 0.12, noise_db=20.0, prior=True),
    "half": Condition("half a flight; simulator as prior", 0.10, longest=HALF, prior=True),
}


PARTS = ("actuators", "sensors", "wind")


@dataclass(frozen=True, kw_only=True)
class Marks:
    """Of one seed: worst nu-gap in all axes, the airspeed where (m/s), and what was found of the
    actuators, the sensors and the wind, with its standard deviation.
    """

    seed: int
    gap: float
    airspeed: float
    found: dict[str, dict[str, tuple[float, float]]]


def of_seed(name: str, seed: int, truth: str = "xcell60") -> Marks:
    """Fly, identify, judge."""
    condition = CONDITIONS[name]
    heli, simulator = (condition.helicopter(vehicle) for vehicle in (truth, PAIRS[truth]))
    records = condition.flights(heli, seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        model = fit(
            condition.structure(records[0]),
            records,
            method=FilterError(Instruments(SimulatedFlight(simulator)), prior=condition.prior),
        )
    gap = condition.truth(heli).compare(frozen_all(model))[ALL]["model"].gap
    return Marks(
        seed=seed,
        gap=float(gap.max()),
        airspeed=float(SPEEDS[gap.argmax()]),
        found={name: model.details[name] for name in PARTS if name in model.details},
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
        _found(condition, marks),
        f"{len(marks)}",
    )


def _found(condition: Condition, marks: Sequence[Marks]) -> str:
    """How far the delays, and the winds, that were found are from the true ones."""
    late = SENSORS_LATE if condition.sensors else condition.late * PERIOD
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
        errors.append(float(np.hypot(*(found[:, 0] - wind_of(m.seed)))))
        inside += int(np.sum(np.abs(found[:, 0] - wind_of(m.seed)) <= 2.0 * found[:, 1]))
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
    found = by_name(options, of_seed, options.only or list(CONDITIONS))
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
