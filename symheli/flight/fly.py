"""A closed-loop flight of the nonlinear helicopter along an airspeed schedule, recorded."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from symheli.codegen.numeric import Numeric
from symheli.environment import Wind
from symheli.errors import InputError, SymheliError
from symheli.flight.autopilot import Autopilot, gain_scheduled_lqr
from symheli.flight.excitation import Excitation
from symheli.flight.reference import references
from symheli.flight.schedule import AirspeedSchedule
from symheli.flight.sensor import Sensor, SensorBank
from symheli.flight.servo import Servo, ServoBank
from symheli.helicopter import Helicopter
from symheli.integrate import runge_kutta
from symheli.physics.attitude import flight_state
from symheli.physics.rigid_body import body_to_earth
from symheli.records.flight_record import FlightRecord
from symheli.values.sample_period import same_period
from symheli.values.signal import UNITS, Signal

MEASURED = ("u", "v", "w", "p", "q", "r", "phi", "theta")
CONTROL_PERIOD = 0.02  # s; slower sampling still flies at about this period
INTEGRATION_STEP = (
    0.005  # s; the error over a flight stays below 1e-5 of each state's peak (see tests)
)


def fly(
    heli: Helicopter,
    schedule: AirspeedSchedule,
    *,
    dt: float = 0.02,
    excitation: Excitation | None = None,
    noise_db: float | None = None,
    seed: int = 0,
    wind: Wind | Sequence[float] = (0.0, 0.0, 0.0),
    servos: Mapping[str, Servo] | None = None,
    sensors: Mapping[str, Sensor] | None = None,
    autopilot: Autopilot | None = None,
) -> FlightRecord:
    """Fly a schedule in the nonlinear model, stabilised by a gain-scheduled LQR, and record it.

    The reference at each moment is the quasi-steady trim of the commanded airspeed and acceleration
    in the steady wind. The autopilot sees what is recorded of u v w p q r phi theta.

    Parameters
    ----------
    heli : Helicopter
        The model.
    schedule : AirspeedSchedule
        What is commanded.
    dt : float
        Of the control and the record, s.
    excitation : Excitation, optional
        Added to the inputs.
    noise_db : float, optional
        White noise this many dB below each signal's own variation (the noise-free flight is flown
        first to know it).
    seed : int
        Of the noise.
    wind : Wind or (float, float, float)
        Or a steady one, north east down, m/s, from the start.
    servos : mapping of str to Servo, optional
        One by input, between command and blade pitch.
    sensors : mapping of str to Sensor, optional
        By signal.
    autopilot : Autopilot, optional
        Default: an LQR designed at several airspeeds.

    Returns
    -------
    FlightRecord
        The measured states, the flapping angles a1 b1 and rotor states (true), the four total
        inputs, the excitation as e_d_lon .., `airspeed` (true, of the air) and `airspeed_command`;
        with servos the inputs are the deflections reached, and d_lon_command .. what was asked;
        with a changing wind also wind_n, wind_e, wind_d.

    Raises
    ------
    SymheliError
        The flight is lost.
    InputError
        Something does not fit.

    Examples
    --------
    >>> transition = symheli.AirspeedSchedule.transition(4.0, 6.0, acceleration=2.0, hold=1.0)
    >>> record = symheli.fly(heli, transition, excitation=symheli.Excitation({"d_lon": 0.01}))
    >>> round(record.dt, 3), bool(np.abs(record["airspeed"] - record["airspeed_command"]).max() < 1)
    (0.02, True)
    """
    if not dt > 0:
        raise InputError(f"dt must be a positive number of seconds, got {dt}")
    if noise_db is not None and sensors is not None:
        raise InputError("give either noise_db or sensors: each says what the measurements are")
    steady = wind if isinstance(wind, Wind) else Wind(_three(wind))
    flight = _Flight(heli, schedule, dt, excitation, steady, servos, autopilot)
    record = flight.run(sensors or {}, seed)
    if noise_db is None:
        return record
    spread = record.columns(MEASURED).std(axis=0) * 10 ** (-noise_db / 20)
    noisy = flight.run(
        {name: Sensor(noise=float(s)) for name, s in zip(MEASURED, spread, strict=True)}, seed
    )
    return replace(
        noisy, note=record.note + f", noise {noise_db:g} dB below each signal, seed {seed}"
    )


def _three(wind: Sequence[float]) -> tuple[float, float, float]:
    if np.shape(wind) != (3,):
        raise InputError(f"wind: expected a Wind or (north, east, down) in m/s, got {wind!r}")
    return float(wind[0]), float(wind[1]), float(wind[2])


class _Flight:
    """Everything of a flight that does not depend on the sensors."""

    def __init__(
        self,
        heli: Helicopter,
        schedule: AirspeedSchedule,
        dt: float,
        excitation: Excitation | None,
        wind: Wind,
        servos: Mapping[str, Servo] | None,
        autopilot: Autopilot | None,
    ):
        self.heli, self.steady_air = heli, wind.is_steady
        self.per_sample = math.ceil(dt / CONTROL_PERIOD - 1e-9)
        self.control_dt = dt / self.per_sample
        self.substeps = math.ceil(self.control_dt / INTEGRATION_STEP - 1e-9)
        self.samples = math.floor(schedule.duration / dt) * self.per_sample
        self.time = self.control_dt * np.arange(self.samples)
        self.speed, self.rate = schedule(self.time)
        self.wind = wind.history(self.time, self.speed)
        top = max(float(self.speed.max()), float(self.speed.min()) + 1.0)
        self.autopilot = autopilot or gain_scheduled_lqr(
            heli, float(self.speed.min()), top, self.control_dt, servos=servos
        )
        if not same_period(self.autopilot.dt, self.control_dt):
            raise InputError(
                f"the autopilot was designed for {self.autopilot.dt} s, this flight controls every"
                f" {self.control_dt:.6g} s"
            )
        added = excitation(self.time) if excitation else {}
        self.added = np.column_stack(
            [added.get(str(name), np.zeros(self.samples)) for name in heli.inputs]
        )
        self.x0, self.u0 = references(heli, self.time, self.speed, self.rate, np.array(wind.steady))
        if servos is None:
            self.servos = None
            self.step = Numeric(runge_kutta(heli, self.control_dt, self.substeps))
        else:
            short = self.control_dt / self.substeps
            self.servos = ServoBank(servos, heli.inputs, heli.travel, short)
            self.step = Numeric(runge_kutta(heli, short, 1))

    def run(self, sensors: Mapping[str, Sensor], seed: int) -> FlightRecord:
        heli, autopilot, travel = self.heli, self.autopilot, self.heli.travel
        seen = [heli.states.index(s) for s in autopilot.states]
        measured = [heli.states.index(Signal(s)) for s in MEASURED]
        bank = SensorBank(sensors, MEASURED, self.samples, self.control_dt, seed)
        gains = np.stack([autopilot.gain(p) for p in self.speed])
        flight = flight_state(self.x0[0])
        servo = self.servos.init(self.u0[0]) if self.servos else None
        truth, states = (
            np.empty((self.samples, len(MEASURED))),
            np.empty((self.samples, len(heli.states))),
        )
        commands, inputs, air = (
            np.empty((self.samples, 4)),
            np.empty((self.samples, 4)),
            np.empty(self.samples),
        )
        for k in range(self.samples):
            states[k], air[k] = _euler_form(flight, self.wind[k])
            truth[k] = states[k, measured]
            states[k, measured] = bank.read(k, truth)
            command = self.u0[k] - gains[k] @ (states[k] - self.x0[k])[seen] + self.added[k]
            commands[k] = np.clip(command, -travel, travel)
            if self.servos is None or servo is None:
                inputs[k] = commands[k]
                flight = self.step(flight, inputs[k], self.wind[k])[0]
            else:
                inputs[k] = reached = self.servos.deflection(servo)
                for _ in range(self.substeps):
                    before = reached
                    servo, reached = self.servos.step(servo, commands[k])
                    flight = self.step(flight, 0.5 * (before + reached), self.wind[k])[0]
            if not np.all(np.isfinite(flight)) or np.abs(truth[k, 6:]).max() > 1.4:
                raise SymheliError(
                    f"the flight was lost at {self.time[k]:.2f} s near {self.speed[k]:.1f} m/s: "
                    "less excitation, noise, gusts or acceleration, please"
                )
        return self._record(states, inputs, commands, air)

    def _record(
        self, states: np.ndarray, inputs: np.ndarray, commands: np.ndarray, air: np.ndarray
    ) -> FlightRecord:
        keep = slice(None, None, self.per_sample)
        columns = {str(s): states[keep, i] for i, s in enumerate(self.heli.states)}
        columns |= {str(s): inputs[keep, i] for i, s in enumerate(self.heli.inputs)}
        columns |= {f"e_{s}": self.added[keep, i] for i, s in enumerate(self.heli.inputs)}
        if self.servos is not None:
            columns |= {f"{s}_command": commands[keep, i] for i, s in enumerate(self.heli.inputs)}
        if not self.steady_air:
            columns |= {
                name: self.wind[keep, i] for i, name in enumerate(("wind_n", "wind_e", "wind_d"))
            }
        columns |= {"airspeed": air[keep], "airspeed_command": self.speed[keep]}
        known = UNITS | {str(s): s.unit for s in self.heli.states}
        units = {
            name: known[name if name in known else name.removeprefix("e_").removesuffix("_command")]
            for name in columns
        }
        note = (
            f"{self.heli.vehicle.title}, {self.heli.governor} governor, peak acceleration"
            f" {np.abs(self.rate).max():.1f} m/s^2"
        )
        return FlightRecord.from_arrays(self.time[keep], units, note, **columns)


def _euler_form(flight: np.ndarray, wind: np.ndarray) -> tuple[np.ndarray, float]:
    """Euler-form state and true airspeed (m/s) from the quaternion form; wind in earth axes."""
    q0, q1, q2, q3 = flight[6:10]
    phi = math.atan2(2 * (q0 * q1 + q2 * q3), 1 - 2 * (q1**2 + q2**2))
    theta = math.asin(max(-1.0, min(1.0, 2 * (q0 * q2 - q3 * q1))))
    velocity = flight[:3]
    if wind.any():
        velocity = velocity - np.array(body_to_earth(q0, q1, q2, q3)).T @ wind
    return np.concatenate([flight[:6], [phi, theta], flight[13:]]), float(np.linalg.norm(velocity))
