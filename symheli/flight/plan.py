"""Everything that makes a flight: what is commanded, what disturbs it, and what is built in."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from typing import Any, Literal, TypedDict, TypeVar, get_args

import numpy as np

from symheli.environment import Wind
from symheli.errors import InputError, UnknownNameError
from symheli.flight.controller import MEASURED
from symheli.flight.excitation import Excitation
from symheli.flight.parameter_change import ParameterChange
from symheli.flight.schedule import AirspeedSchedule
from symheli.flight.sensor import Sensor
from symheli.flight.servo import Servo, one_each
from symheli.lpv.actuation import Actuation
from symheli.values.kinematics import INPUTS
from symheli.values.numbers import by_name, whole

F = TypeVar("F", bound=Callable[..., Any])

MIN_SAMPLE_PERIOD = 1e-6
"""Least sample period, s."""

CONTROL_PERIOD = 0.02
"""s; slower sampling still flies at about this period."""

LONGEST_DELAY = 1.0
"""s, from command to servo."""

MAX_NOISE_DB = 1000
"""Largest noise level, dB above or below the signal."""

READ = (*map(str, MEASURED), "airspeed")
"""Signals that have a sensor."""
Trims = Literal["quasi-steady", "level"]


class Options(TypedDict, total=False):
    """Options of `fly` and `fly_batch` besides the schedule; see `FlightPlan`."""

    dt: float
    controller: object
    excitation: Excitation | None
    noise_db: float | None
    seed: int
    wind: Wind | Sequence[float]
    servos: Mapping[str, Servo] | Actuation | None
    sensors: Mapping[str, Sensor] | None
    delay: float
    trims: Trims
    change: ParameterChange | None


@dataclass(frozen=True)
class FlightPlan:
    """A flight plan holds all settings of a flight, so that it can be repeated;
    `record.meta["plan"]` of every flight is one.

    Parameters
    ----------
    schedule : AirspeedSchedule
        What is commanded.
    dt : float
        Sample period of the record, s; a whole multiple of the controller's.
    controller : object, optional
        An `Autopilot` (gains over airspeed), a LinearModel, an LPVStateSpace or a python-control
        system (see `ScheduledController` for what their signals mean), or an object that is called
        at every sample, with its state outside (`PureController`) or within, that is dt, reset()
        and step(measured, reference, p) (`StatefulController`). Default: an LQR designed at
        several airspeeds.
    excitation : Excitation, optional
        Added to the commands.
    noise_db : float, optional
        White noise this many dB below each measured signal's own variation (the noise-free flight
        is flown first to know it).
    seed : int
        Of the sensors' noise.
    wind : Wind or (float, float, float)
        Or a steady one, north east down, m/s, from the start.
    servos : mapping of str to Servo, or Actuation, optional
        One by input, between command and blade pitch; an Actuation has the delay too.
    sensors : mapping of str to Sensor, optional
        By signal: u v w p q r phi theta, airspeed.
    delay : float
        From a command to the servo, s; rounded up to whole integration steps (of at most 5 ms).
    trims : {"quasi-steady", "level"}
        What the flight is held to: the trims of the commanded airspeed and acceleration, or those
        of the commanded airspeed alone, whose drift the controller has to answer. Both in the
        steady wind.
    change : ParameterChange, optional
        What becomes of the helicopter in flight, as where a load is dropped.

    Raises
    ------
    InputError
        Something that does not fit.

    See Also
    --------
    symheli.fly : one closed-loop flight
    symheli.flight.fly_batch : many flights at once

    Examples
    --------
    >>> climb = symheli.AirspeedSchedule.transition(4.0, 6.0, acceleration=2.0, hold=0.5)
    >>> plan = symheli.FlightPlan(climb, wind=(-2.0, 0.0, 0.0), delay=0.02)
    >>> symheli.fly(heli, plan).meta["plan"] == plan
    True
    """

    schedule: AirspeedSchedule
    _: KW_ONLY
    dt: float = 0.02
    controller: object = None
    excitation: Excitation | None = None
    noise_db: float | None = None
    seed: int = 0
    wind: Wind = field(default_factory=Wind)
    servos: Mapping[str, Servo] | Actuation | None = None
    sensors: Mapping[str, Sensor] | None = None
    delay: float = 0.0
    trims: Trims = "quasi-steady"
    change: ParameterChange | None = None

    def __post_init__(self) -> None:
        _expect("schedule", self.schedule, AirspeedSchedule)
        dt = _number("dt", self.dt, "a positive number of seconds")
        if not MIN_SAMPLE_PERIOD <= dt:
            raise InputError(
                f"dt must be a positive number of seconds, from {MIN_SAMPLE_PERIOD:g} on,"
                f" got {self.dt}"
            )
        if math.floor(self.schedule.duration / dt + 1e-9) < 2:
            raise InputError(
                f"the schedule lasts {self.schedule.duration:g} s, less than two samples of"
                f" {dt:g} s: hold longer, or sample faster"
            )
        if self.excitation is not None:
            _expect("excitation", self.excitation, Excitation)
            for name in self.excitation.amplitude:
                if name not in INPUTS:
                    raise UnknownNameError("input of the excitation", name, INPUTS)
        if self.noise_db is not None and self.sensors is not None:
            raise InputError("give either noise_db or sensors: both define the measurement errors")
        if self.noise_db is not None:
            level = _number("noise_db", self.noise_db, "a number of decibels, as 30")
            if abs(level) > MAX_NOISE_DB:
                raise InputError(
                    f"noise_db: expected -{MAX_NOISE_DB} to {MAX_NOISE_DB} dB, got {level:g}"
                )
        object.__setattr__(self, "seed", whole(self.seed, "seed"))
        object.__setattr__(self, "wind", _wind(self.wind))
        given = self.servos.servos if isinstance(self.servos, Actuation) else self.servos
        if given is not None:
            one_each(given, INPUTS)
        actuation = Actuation.of(self.actuation, period=self.control_period)
        object.__setattr__(self, "servos", actuation.servos)
        object.__setattr__(self, "delay", actuation.delay)
        _sensors(self.sensors)
        if self.change is not None:
            _expect("change", self.change, ParameterChange)
        if self.delay > LONGEST_DELAY:
            raise InputError(
                f"delay: {self.delay:g} s is implausibly long; delay is in seconds: {self.delay:g}"
                f" ms are delay={self.delay / 1000:g}"
            )
        if self.trims not in get_args(Trims):
            raise UnknownNameError("kind of trims", self.trims, get_args(Trims))

    @property
    def actuation(self) -> Actuation:
        """Servos and delay between the commands and the blade pitch."""
        return Actuation.of(self.servos, self.delay)

    @property
    def control_period(self) -> float:
        """Sample period of the controller, s; of one without, a part of `dt`."""
        own = getattr(self.controller, "dt", None)
        if isinstance(own, float | int) and own > 0:
            return own
        return self.dt / math.ceil(self.dt / CONTROL_PERIOD - 1e-9)

    def seeded(self, seed: int) -> FlightPlan:
        """Return the same flight with other random numbers: sensors' noise from `seed`, turbulence
        and excitation from their own seed plus `seed`.
        """
        seed = whole(seed, "seed")
        stirred = self.excitation and replace(self.excitation, seed=self.excitation.seed + seed)
        wind = replace(self.wind, seed=self.wind.seed + seed)
        return replace(self, seed=seed, wind=wind, excitation=stirred)


def plan_of(given: AirspeedSchedule | FlightPlan, options: Options) -> FlightPlan:
    """The plan of a schedule and options, or the given one with these options in place of its
    own.
    """
    if isinstance(given, FlightPlan):
        return replace(given, **options) if options else given
    known = [f.name for f in fields(FlightPlan) if f.name not in ("schedule", "_")]
    for name in options:
        if name not in known:
            raise UnknownNameError("option of a flight", name, known)
    return FlightPlan(given, **options)  # type: ignore[arg-type]


def shows_options(function: F) -> F:
    """The function, whose signature shows the options of a flight by name in `help` and completion,
    with the values that a `FlightPlan` has for them.
    """
    shown = inspect.signature(function)
    plan = inspect.signature(FlightPlan).parameters
    own = [p for p in shown.parameters.values() if p.kind is not inspect.Parameter.VAR_KEYWORD]
    named = [plan[name] for name in Options.__annotations__]
    function.__signature__ = shown.replace(parameters=[*own, *named])  # type: ignore[attr-defined]
    return function


def _expect(name: str, value: object, kind: type) -> None:
    if not isinstance(value, kind):
        article = "an" if kind.__name__[0] in "AE" else "a"
        raise InputError(f"{name}: expected {article} {kind.__name__}, got {value!r:.80}")


def _number(name: str, value: Any, wanted: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number) or isinstance(value, bool):
        raise InputError(f"{name}: expected {wanted}, got {value!r:.80}")
    return number


def _wind(wind: Any) -> Wind:
    if isinstance(wind, Wind):
        return wind
    try:
        north, east, down = (float(v) for v in np.asarray(wind, float))
    except (TypeError, ValueError) as error:
        raise InputError(
            f"wind: expected a Wind or (north, east, down) in m/s, got {wind!r:.80}"
        ) from error
    return Wind((north, east, down))


def _sensors(given: Mapping[str, Sensor] | None) -> None:
    """Raises where these are no sensors by name of what is read."""
    for name, sensor in by_name(given or {}, "sensors", "{signal: Sensor}").items():
        if name not in READ:
            raise UnknownNameError("measured signal", name, READ)
        _expect(f"sensors[{name!r}]", sensor, Sensor)
