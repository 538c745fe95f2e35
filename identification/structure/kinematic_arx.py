"""A rigid vehicle: kinematics known, aerodynamics to be identified."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.integrate import cumulative_trapezoid

from identification.structure.actuators import Actuators, bare, behind, pieces
from identification.structure.late_sensors import LateSensors
from identification.structure.lpvarx import CONSTANT, LPVARX, UNSCHEDULED
from identification.structure.orders import Orders
from identification.structure.steady_wind import VELOCITY, SteadyWind, of_air
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.bases import FunctionSpace
from symheli.records import FlightRecord
from symheli.values import Signal
from symheli.values.arrays import Array
from symheli.values.kinematics import RIGID_BODY, VELOCITIES, kinematic_rates
from symheli.values.numbers import whole

STATES = tuple(map(str, RIGID_BODY))
MOVING = tuple(map(str, VELOCITIES))
INCREMENTS: tuple[Signal, ...] = tuple(Signal(f"{s}_aero", s.unit) for s in VELOCITIES)
"""Increments of the velocities by air and inertia over one sample."""

FLAPPING = {"u": 1, "v": 1, "w": 1, "p": 2, "q": 2, "r": 1}
"""Lags where what is not measured is the flapping of a rotor: two more states, and two samples of
roll and pitch rate show them. With a second lag of the other velocities the regressors are nearly
dependent: in a linear flight two combinations of them vanish.
"""


def increments(y: Array, dt: float) -> Array:
    """(n, 8): what y(k) - y(k-1) has beyond the kinematics, by the trapezoidal rule; NaN at k = 0.

    For y (n, 8) in the order of `STATES`. The last two columns, attitude, are the misfit of the
    Euler equations: zero but for noise and O(dt^3).
    """
    k = kinematic_rates(y)
    out = np.full_like(y, np.nan)
    out[1:] = np.diff(y, axis=0) - 0.5 * dt * (k[1:] + k[:-1])
    return out


Part = Actuators | SteadyWind | LateSensors
Found = dict[str, dict[str, tuple[float, float]]]

INTEGRAL = "{}_integral"
"""Name of the integral of what a governed speed lacks."""


@dataclass(frozen=True, kw_only=True)
class Aerodynamics(LPVARX):
    """The regression inside a `KinematicARX`: `INCREMENTS` from lagged velocities and inputs.

    It derives its outputs from u v w p q r phi theta of a record, and its inputs from the commands
    where `actuators` follow them, so that every method, recursive ones too, works on records as
    they are.

    Parameters
    ----------
    commands : tuple of str
        Inputs as the record has them.
    actuators : Actuators, optional
        Between those and the deflections that the regression takes.
    rotor_speed : str, optional
        A measured speed that a governor holds.
    governed_at : float, optional
        What it holds it at.
    wind : SteadyWind, optional
        In which the records were flown.
    sensors : LateSensors, optional
        Those that read what was true some time ago.

    Examples
    --------
    >>> import identification as idn
    >>> kin = idn.KinematicARX("d_lon", "airspeed", basis=idn.Polynomial(1, 0.0, 13.0))
    >>> kin.aerodynamics.outputs[0], kin.aerodynamics.inputs[-1]
    ('u_aero', 'd_lon')
    """

    commands: tuple[str, ...] = ()
    actuators: Actuators | None = None
    rotor_speed: str | None = None
    governed_at: float | None = None
    wind: SteadyWind | None = None
    sensors: LateSensors | None = None

    @property
    def parts(self) -> dict[str, Part]:
        """Parts between the record and the regression, by name of its field."""
        every = {"actuators": self.actuators, "wind": self.wind, "sensors": self.sensors}
        return {name: part for name, part in every.items() if part is not None}

    @property
    def unknown(self) -> int:
        """Number of what is unknown of its parts."""
        return sum(len(part.unknown) for part in self.parts.values())

    def _each(self, z: Sequence[float]) -> Iterator[tuple[str, Part, Sequence[float]]]:
        """Its parts, with those of `z` that belong to each."""
        first = 0
        for name, part in self.parts.items():
            yield name, part, z[first : first + len(part.unknown)]
            first += len(part.unknown)

    def moved(self, z: Sequence[float]) -> Aerodynamics:
        """Return the same with its parts at `z`, in their prior deviations."""
        return replace(self, **{name: part.moved(own) for name, part, own in self._each(z)})

    def found(self, z: Sequence[float], deviations: Sequence[float]) -> Found:
        """Values and standard deviations of what was estimated, by part."""
        sizes = [own for _, _, own in self._each(deviations)]
        return {
            name: part.found(own, size)
            for (name, part, own), size in zip(self._each(z), sizes, strict=True)
            if part.unknown
        }

    @property
    def simulated(self) -> Aerodynamics:
        """The regression for a simulated flight, whose signals are not late."""
        return replace(self, sensors=None)

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the controls that the commands are of."""
        return tuple(map(bare, self.commands))

    def prepared(self, record: FlightRecord) -> FlightRecord:
        """The record with `INCREMENTS`, deflections and the rotor's signals; raises
        `UnknownNameError` for a signal it lacks, `InputError` for one in another unit.
        """
        names = [str(s) for s in INCREMENTS]
        record = super().prepared(record)
        if set(names) <= set(record.signals):
            return record
        return self._completed(record if self.sensors is None else self.sensors.along(record))

    def again(self, record: FlightRecord, before: Aerodynamics) -> FlightRecord:
        """A record that was prepared `before` with its parts elsewhere, as this one prepares it."""
        if self.sensors is not None and before.sensors is not None:
            later = self.sensors.delay - before.sensors.delay
            record = replace(self.sensors, delay=later).along(record)
        return self._completed(record)

    def _completed(self, record: FlightRecord) -> FlightRecord:
        """The record, its signals in time, with all that is computed from them."""
        record = self._derived(record)
        y = record.columns(STATES)
        for signal in RIGID_BODY:
            found = record.signals[record.signals.index(str(signal))]  # type: ignore[arg-type]
            if found.unit != signal.unit:
                raise InputError(f"{found} is in {found.unit}; kinematics need it in {signal.unit}")
        out = np.full_like(y, np.nan)
        for part in record.segments():
            out[part] = increments(y[part], record.dt)
        units = {str(s): s.unit for s in INCREMENTS}
        return record.with_signals(units, **dict(zip(units, out.T, strict=False)))

    def _derived(self, record: FlightRecord) -> FlightRecord:
        """The record with deflections, the rotor's signals and velocities through the air, where
        the structure has them.
        """
        if self.rotor_speed is not None:
            record = _governed(record, self.rotor_speed, self.governed_at)
        if self.actuators is not None:
            found = self.actuators.along(record, self.commands, self.controls)
            units = {behind(u): record.signals[record.signals.index(u)].unit for u in self.commands}  # type: ignore[arg-type]
            record = record.with_signals(units, **dict(zip(units, found.T, strict=True)))
        return record if self.wind is None else self.wind.along(record)


def _governed(record: FlightRecord, speed: str, wanted: float | None) -> FlightRecord:
    """The record with the increment of a governed speed, and the integral of what it lacks of that
    asked for, as recorded, or else `wanted`, or else its mean, from 0 at the start of every piece.
    """
    measured = record.columns([speed])
    change, integral = np.full(len(record), np.nan), np.full(len(record), np.nan)
    if f"{speed}_reference" in record.signals:
        commanded = record[f"{speed}_reference"]
    else:
        commanded = np.full(len(record), np.nanmean(measured) if wanted is None else wanted)
    lacking = commanded - measured[:, 0]
    for piece in pieces(record, measured):
        part = slice(piece.start, piece.stop)
        change[piece.start + 1 : piece.stop] = np.diff(measured[part, 0])
        integral[part] = cumulative_trapezoid(lacking[part], dx=record.dt, initial=0.0)
    unit = record.signals[record.signals.index(speed)].unit  # type: ignore[arg-type]
    units = {_change(speed): unit, INTEGRAL.format(speed): f"{unit} s"}
    if unit == "rad/s":
        units[INTEGRAL.format(speed)] = "rad"
    columns = dict(zip(units, (change, integral), strict=True))
    return record.with_signals(units, **columns)


def _change(speed: str) -> str:
    return f"{speed}_change"


@dataclass(frozen=True)
class KinematicARX:
    """A kinematic ARX structure describes a rigid vehicle whose inertial, gravity and Euler terms
    are known and whose aerodynamics are functions of scheduling parameters p; any vehicle, any
    inputs.

    With y = (u v w p q r phi theta), kinematics k(y) and z = (u v w p q r),

        T(k) = y(k) - y(k-1) - dt/2 (k(y(k)) + k(y(k-1)))
             = sum_i A_i(p(k)) z(k-i) + sum_j B_j(p(k)) u(k-j) + c(p(k))
               + d(p(k)) (p(k) - p(k-1))          in its first six rows, 0 in the last two.

    The air does not see attitude: z has none, and roll and pitch need no coefficient.

    Parameters
    ----------
    inputs : str or sequence of str
        Controls, as the record names them.
    scheduling : str or sequence of str, optional
        One parameter, or several: then `basis` is a `Product`. Best a commanded airspeed, and the
        commanded acceleration beside it where trim attitudes depend on it. Default, with `basis`:
        none, the coefficients are constant, about one flight state.
    na : int or {velocity: int}
        Lags of the velocities; the default is that of a rotorcraft, see `FLAPPING`.
    nb : int or {input: int}
        Lags of the inputs, from 1 on.
    basis : FunctionSpace, optional
        The functions of p, on the range they are declared on.
    offset_rate : bool
        Whether there is d(p), False where nothing is scheduled; with an acceleration among the
        parameters c(p) says as much.
    actuators : Actuators, optional
        A delay, and servos, between `inputs`, which are then commands (d_lon_command, or d_lon),
        and the deflections; u in the equation is the mean deflection over a sample. What of them is
        not known `FilterError` estimates. The model is from the commands.
    rotor_speed : str, optional
        The measured speed of a rotor whose governor does not hold it exactly, as "Om". It and the
        integral of what it lacks act beside the inputs, and its own increment is one more equation;
        in the model both are states. Every record is to begin in the same flight state.
    governed_at : float, optional
        Speed that the governor holds it at, in its unit, where the record has no Om_reference;
        default its mean over a record, which serves where the flight ends as it began.
    wind : SteadyWind, optional
        In which the records were flown: aerodynamics, and a schedule over ground, see the velocity
        through the air. What of it is not known `FilterError` estimates.
    sensors : LateSensors, optional
        Sensors that come later than the others; `FilterError` estimates how late.

    Raises
    ------
    InputError
        As `LPVARX`, an input that is a state, or one without servo.

    See Also
    --------
    identification.LPVARX : a difference equation over parameters
    identification.fit : coefficients from records
    identification.structure.LateSensors : sensors that lag

    References
    ----------
    Klein and Morelli (2006), Aircraft System Identification, ch. 5, for equation error with known
    kinematics; with coefficients that move, here.

    Examples
    --------
    >>> kin = idn.KinematicARX(
    ...     inputs=("d_lon", "d_lat", "d_col", "d_ped"),
    ...     scheduling="airspeed_command",
    ...     na=2,
    ...     nb=2,
    ...     basis=idn.Polynomial(degree=2, low=0.0, high=13.0),
    ... )
    >>> kin.n_regressors, kin.outputs
    (66, ('u', 'v', 'w', 'p', 'q', 'r', 'phi', 'theta'))
    """

    inputs: tuple[str, ...]
    scheduling: str | tuple[str, ...] = UNSCHEDULED
    _: KW_ONLY
    basis: FunctionSpace = CONSTANT
    na: int | Mapping[str, int] | tuple[int, ...] = tuple(FLAPPING.values())
    nb: Orders = 2
    offset_rate: bool = True
    actuators: Actuators | None = None
    rotor_speed: str | None = None
    governed_at: float | None = None
    wind: SteadyWind | None = None
    sensors: LateSensors | None = None

    outputs: ClassVar[tuple[str, ...]] = STATES

    def __post_init__(self) -> None:
        given = (self.inputs,) if isinstance(self.inputs, str) else tuple(self.inputs)
        object.__setattr__(self, "inputs", given)
        if self.scheduling == UNSCHEDULED:
            object.__setattr__(self, "offset_rate", False)
        clash = sorted({*map(str, given)} & set(STATES))
        if clash:
            raise InputError(f"{', '.join(clash)}: a state of the body cannot be an input")
        if self.actuators is not None:
            if not isinstance(self.actuators, Actuators):
                raise InputError(f"actuators: expected Actuators(...), got {self.actuators!r:.80}")
            self.actuators.require(tuple(map(bare, given)))
        for name, kind in (("wind", SteadyWind), ("sensors", LateSensors)):
            part = getattr(self, name)
            if part is not None and not isinstance(part, kind):
                raise InputError(f"{name}: expected {kind.__name__}(...), got {part!r:.80}")
        if self.rotor_speed in (*STATES, *given):
            raise InputError(f"rotor_speed: {self.rotor_speed} is a state or an input already")
        aero = self.aerodynamics  # raises for anything else that does not fit
        if self.wind is None:
            object.__setattr__(self, "scheduling", aero.scheduling)
        lags = aero.input_lag_ranges[0]
        object.__setattr__(self, "na", tuple(len(r) for r in lags[: len(MOVING)]))
        if 0 in self.na:  # type: ignore[operator]
            raise InputError("na: every velocity needs at least one lag")

    @cached_property
    def aerodynamics(self) -> Aerodynamics:
        """The regression: `INCREMENTS` from lagged velocities and inputs, as any method takes
        it.
        """
        return self._regression(tuple(map(str, INCREMENTS)))

    def _regression(self, outputs: tuple[str, ...]) -> Aerodynamics:
        na = self.na if isinstance(self.na, Mapping) else _of_each(self.na)
        orders = {z: na if isinstance(na, int) else na.get(z, FLAPPING[z]) for z in MOVING}
        nb = self.nb if isinstance(self.nb, Mapping) else whole(self.nb, "nb", 1)
        more = {u: nb if isinstance(nb, int) else nb[u] for u in self.inputs}  # type: ignore[index,call-overload]
        if self.actuators is not None:
            more = {behind(u): n for u, n in more.items()}
        scheduling: str | tuple[str, ...] = self.scheduling
        if self.wind is not None:
            orders = {of_air(z) if z in VELOCITY else z: n for z, n in orders.items()}
            given = (scheduling,) if isinstance(scheduling, str) else tuple(scheduling)
            if self.wind.over_ground not in (None, *given):
                raise UnknownNameError(
                    "scheduling parameter over ground", str(self.wind.over_ground), given
                )
            scheduling = tuple(of_air(n) if n == self.wind.over_ground else n for n in given)
        names = (*orders, *more)
        if self.rotor_speed is not None:
            more |= dict.fromkeys(self.rotor, 1)
        return Aerodynamics(
            outputs,
            (*names, *self.rotor),
            scheduling,
            na=0,
            nb=orders | more,
            delay=1,
            basis=self.basis,
            scheduling_at="now",
            offset=True,
            offset_rate=self.offset_rate,
            commands=self.inputs,
            actuators=self.actuators,
            rotor_speed=self.rotor_speed,
            governed_at=self.governed_at,
            wind=self.wind,
            sensors=self.sensors,
        )

    @property
    def rotor(self) -> tuple[str, ...]:
        """The rotor's speed and its integral, where they are states."""
        speed = self.rotor_speed
        return () if speed is None else (speed, INTEGRAL.format(speed))

    @cached_property
    def drive(self) -> Aerodynamics | None:
        """The regression of the rotor's speed, from what the aerodynamics are regressed on."""
        if self.rotor_speed is None:
            return None
        return self._regression((_change(self.rotor_speed),))

    def require_plain(self, what: str) -> None:
        """Raises `InputError` with `what` needs it, unless the regression takes the signals of a
        record as they are: no actuators, rotor speed, wind or late sensors.
        """
        if self.aerodynamics.parts or self.rotor_speed is not None:
            raise InputError(
                f"{what} takes a KinematicARX without actuators, rotor_speed, wind or sensors: fit"
                " one to a record of deflections in still air, or take .at(p) or .to_state_space()"
            )

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the scheduling parameters, also where there is one."""
        return self.aerodynamics.parameters

    @property
    def constant(self) -> bool:
        """Whether nothing depends on the scheduling parameters."""
        return self.aerodynamics.constant

    @property
    def n_regressors(self) -> int:
        """Unknown coefficients of each of the six equations."""
        return self.aerodynamics.n_regressors

    @property
    def memory(self) -> int:
        """Number of samples before k to which the regressor of y(k) reaches back."""
        return self.aerodynamics.memory


def _of_each(na: int | tuple[int, ...]) -> dict[str, int] | int:
    if not isinstance(na, Sequence):
        return whole(na, "na")
    if len(na) != len(MOVING):
        raise InputError(f"na: expected lags of {', '.join(MOVING)}, got {len(na)} numbers")
    return dict(zip(MOVING, na, strict=True))
