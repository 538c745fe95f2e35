"""Real conditions of flights for identification: servos, delay and governor, late sensors, steady
wind, turbulence, few samples, much noise, each with the structure that its model is to have.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from scipy.integrate import cumulative_trapezoid

import symheli
from identification import Actuators, KinematicARX, Polynomial, fit
from identification.methods import FilterError
from identification.model import KinematicModel
from identification.structure import LateSensors, SteadyWind
from identification.structure.actuators import faster
from identification.structure.kinematic_arx import STATES
from studies.known_kinematics.flights import aggressive, held
from studies.known_kinematics.models import FASTEST, SCHEDULING, structure
from studies.known_kinematics.truth import AXES, SPEEDS, FrozenAxes, Truth, frozen
from studies.setup.bounds import PERIOD
from studies.setup.flights import ABOVE_GROUND, ACTUATION, BREEZE, NOISE_DB, TOP, autopilot_for
from symheli import FlightPlan, FlightRecord, Helicopter, Sensor, Wind
from symheli.environment import Dryden
from symheli.flight import XCELL_SERVOS, SimulatedFlight, gain_scheduled_lqr
from symheli.lpv import Product
from symheli.lpv.tools import Actuation
from symheli.values.arrays import Array

ALL = "all axes"
WIND, ANOTHER = 5.0, 50_000
"""m/s; what is added to the seed for a second flight."""

HALF = 75.0
"""Length of half a flight, s."""

ASSUMED, UNSURE = 0.03, 0.02
"""Delay before the flight, and its standard deviation, s."""

LAGS = {"d_lon": 2, "d_lat": 2, "d_col": 1, "d_ped": 1}
"""Of mean deflections: flapping stands behind the cyclic controls alone. A second lag of the others
would pass for a delay.
"""


@dataclass(frozen=True)
class RealCondition:
    """One kind of flight, what its identification knows, and the largest permitted nu-gap.

    Parameters
    ----------
    about : str
        In a table.
    mark : float
        Of the median; the worst may be twice it.
    flown : Actuation
        Servos, and the delay before them or the rotor; with servos the governor does not hold the
        rotor.
    decimated : int
        Of so many samples one is logged.
    noise_db, longest : float
        Of the sensors; of the flight, s.
    actuators : Actuators, optional
        What is known of servos and delay.
    sensors : LateSensors, optional
        What is known of sensors that are 40 ms late.
    headings : tuple of float
        Of the flights, off the one into the wind, deg; empty: still air.
    wind : float
        Steady, m/s, where there are headings.
    turbulence : Dryden, optional
        Besides; the gust is then a hidden state of the method, as large as Dryden's along the body.
    louder : float
        Amplitude of the excitation over that of `aggressive`.
    held : int
        Number of flights that hold each airspeed in place of the aggressive one.
    prior : bool
        Whether the coefficients are taken to lie about the simulator's.
    over_ground : bool
        Whether speeds are commanded, and the coefficients scheduled, over ground.
    """

    about: str
    mark: float
    flown: Actuation = field(default_factory=Actuation)
    decimated: int = 1
    noise_db: float = NOISE_DB
    longest: float = 150.0
    actuators: Actuators | None = None
    sensors: LateSensors | None = None
    headings: tuple[float, ...] = ()
    wind: float = WIND
    turbulence: Dryden | None = None
    louder: float = 1.0
    held: int = 0
    over_ground: bool = True
    prior: bool = False

    @property
    def period(self) -> float:
        """Time between two rows of the log, s."""
        return PERIOD * self.decimated

    def helicopter(self, name: str) -> Helicopter:
        """A vehicle with the engine of the condition."""
        return Helicopter.load(name, governor="pi" if self.flown.servos else "ideal")

    def flights(self, heli: Helicopter, seed: int) -> list[FlightRecord]:
        """The flights for identification, as they are logged."""
        if not self.headings:
            plans = [held(seed + i * ANOTHER, autopilot_for(heli)) for i in range(self.held)]
            return [self.logged(symheli.fly(heli, p)) for p in plans or [self.plan(heli, seed)]]
        longest, out = self.longest / len(self.headings), []
        for i, off in enumerate(self.headings):
            own, towards = seed + i * ANOTHER, np.radians(180.0 - off)
            steady = (self.wind * np.cos(towards), self.wind * np.sin(towards), 0.0)
            wind = Wind(steady, turbulence=self.turbulence, seed=own)
            plan = replace(self.plan(heli, own, longest), wind=wind)
            out.append(with_heading(symheli.fly(heli, plan), into_the_wind(seed) + off))
        return out

    def plan(self, heli: Helicopter, seed: int, longest: float | None = None) -> FlightPlan:
        """A flight for identification, heading north."""
        autopilot = (
            gain_scheduled_lqr(heli, 0.0, TOP, PERIOD, servos=self.flown.servos)
            if self.flown.servos
            else autopilot_for(heli)
        )
        plan = aggressive(
            seed,
            autopilot,
            noise_db=self.noise_db,
            servos=self.flown,
            longest=longest or self.longest,
            louder=self.louder,
        )
        if self.sensors is not None:
            clean = replace(plan, noise_db=None)
            return replace(clean, sensors=self._late(symheli.fly(heli, clean)))
        return plan

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
        """The part of a flight that is in the log."""
        return record.rows(slice(None, None, self.decimated))

    def structure(self, record: FlightRecord) -> KinematicARX:
        """Cubic in airspeed, linear in acceleration; in turbulence, which hides more, of
        total degree 2; of held airspeeds that of `models`. From the commands where something stands
        between them and the rotor.
        """
        if self.held:
            return structure()
        inputs = AXES[ALL].inputs
        commanded = self.actuators is not None and f"{inputs[0]}_command" in record.signals
        names = {u: f"{u}_command" if commanded else u for u in inputs}
        ground = OVER_GROUND if self.headings and self.over_ground else None
        first = SCHEDULING[0] if ground is None else ground
        low, high = (0.0, TOP) if ground is None else (-AROUND, TOP + AROUND)
        degree = 3 if self.turbulence is None else 2
        return KinematicARX(
            tuple(names.values()),
            (first, SCHEDULING[1]),
            basis=Product(
                (Polynomial(degree, low, high), Polynomial(1, -FASTEST, FASTEST)),
                total_degree=degree,
            ),
            nb={names[u]: n for u, n in LAGS.items()},
            offset_rate=False,
            actuators=self.actuators,
            rotor_speed="Om" if self.flown.servos else None,
            wind=SteadyWind(deviation=WIND, over_ground=ground) if self.headings else None,
            sensors=self.sensors,
        )

    def identified(
        self, kin: KinematicARX, records: Sequence[FlightRecord], source: Instruments
    ) -> KinematicModel:
        """By the filter error method."""
        gust = 0.0 if self.turbulence is None else float(self.turbulence.intensities[0])
        return fit(kin, records, method=FilterError(source, gust=gust, prior=self.prior))

    def truth(self, heli: Helicopter, *axes: str) -> Truth:
        """Exact linearizations of what was flown, from the commands, at the period of the log;
        default of all axes.
        """
        chosen = {name: AXES[name] for name in axes or (ALL,)}
        return Truth.of(heli, chosen, actuation=Actuation.of(self.flown, period=self.period))


AROUND = 12.0
"""How far from the airspeeds that are flown a speed over ground may be, m/s."""

OVER_GROUND = "speed_command"
SENSORS_LATE = 0.04
"""s."""


def into_the_wind(seed: int) -> float:
    """Heading of a seed that is into the wind, deg."""
    return float(np.random.default_rng(seed).uniform(0.0, 360.0))


def wind_of(seed: int, speed: float = WIND) -> Array:
    """Direction and speed of the wind of a seed: north and east, m/s."""
    towards = np.radians(into_the_wind(seed) + 180.0)
    return speed * np.array([np.cos(towards), np.sin(towards)])


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
"""Bandwidth of the servos from which the identification starts, as a multiple of the true one,
where it is to find it.
"""

WRONG_SERVOS = {u: faster(servo, FASTER) for u, servo in XCELL_SERVOS.items()}
AIR = {"light": Dryden(7.7, ABOVE_GROUND), "moderate": Dryden(15.4, ABOVE_GROUND)}
"""Mean winds of 15 and 30 kt at 20 ft."""

IN_TURBULENCE = partial(
    RealCondition, headings=(0.0,), wind=float(np.hypot(*BREEZE[:2])), louder=2.5, prior=True
)
"""Into the breeze, whose direction is known to a guess, with the heading measured."""

NOT_QUITE = partial(Actuators, delay=ASSUMED, delay_deviation=UNSURE)

CONDITIONS: Mapping[str, RealCondition] = {
    "ideal": RealCondition("nothing in between, 50 Hz, 30 dB", 0.10),
    "servos": RealCondition(
        "servos, 20 ms, governor; servos known, delay found",
        0.12,
        ACTUATION,
        actuators=NOT_QUITE(XCELL_SERVOS),
    ),
    "bandwidth": RealCondition(
        "the same; bandwidth and delay found",
        0.12,
        ACTUATION,
        actuators=NOT_QUITE(WRONG_SERVOS, bandwidth_deviation=0.2),
    ),
    "delay": RealCondition(
        "commands 40 ms late, delay found", 0.12, Actuation(delay=0.04), actuators=NOT_QUITE()
    ),
    "held": RealCondition(
        "ideal; each airspeed held for 40 s, twice 400 s, for slow modes", 0.10, held=2
    ),
    "25 Hz": RealCondition(
        "logged at 25 Hz, commanded at 50 Hz, said so",
        0.10,
        decimated=2,
        actuators=Actuators(period=PERIOD),
    ),
    "25 Hz, untold": RealCondition(
        "logged at 25 Hz, commanded at 50 Hz, not said", 0.10, decimated=2
    ),
    "sensors": RealCondition(
        "rates and attitude 40 ms late, found", 0.12, sensors=LateSensors(deviation=ASSUMED)
    ),
    "wind": RealCondition(
        "steady wind of 5 m/s, two headings, no air data; wind found", 0.12, headings=(-50.0, 50.0)
    ),
    "airspeed": RealCondition(
        "the same, airspeed known", 0.08, headings=(-50.0, 50.0), over_ground=False
    ),
    "turbulence": IN_TURBULENCE("a breeze and light turbulence", 0.15, turbulence=AIR["light"]),
    "moderate": IN_TURBULENCE("a breeze and moderate turbulence", 0.25, turbulence=AIR["moderate"]),
    "20 dB": RealCondition("20 dB of noise; simulator as prior", 0.12, noise_db=20.0, prior=True),
    "half": RealCondition("half a flight; simulator as prior", 0.10, longest=HALF, prior=True),
}


def frozen_all(model: KinematicModel) -> FrozenAxes:
    """The model in all axes at `SPEEDS`."""
    return {ALL: tuple(frozen(model, AXES[ALL], float(v)) for v in SPEEDS)}
