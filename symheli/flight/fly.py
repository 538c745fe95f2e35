"""A closed-loop flight of the nonlinear helicopter along an airspeed schedule, recorded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from symheli.equilibrium import TrimPoint, trim
from symheli.errors import InputError, SymheliError, TrimError
from symheli.flight.autopilot import Autopilot, gain_scheduled_lqr
from symheli.flight.excitation import Excitation
from symheli.flight.schedule import AirspeedSchedule
from symheli.helicopter import Helicopter
from symheli.integrate import runge_kutta
from symheli.lpv.flight_record import FlightRecord
from symheli.lpv.signal import UNITS, Signal
from symheli.numeric import Numeric
from symheli.rigid_body import body_to_earth

MEASURED = ("u", "v", "w", "p", "q", "r", "phi", "theta")
CONTROL_PERIOD = 0.02  # s; slower sampling still flies at about this period
REFERENCE_MISS = 0.3  # m/s^2 or rad/s^2; what feedback makes up for
INTEGRATION_STEP = 0.005  # s; the error over a flight stays below 1e-5 of each state's peak (see tests)


def fly(
    heli: Helicopter, schedule: AirspeedSchedule, *, dt: float = 0.02, excitation: Excitation | None = None, noise_db: float | None = None,
    seed: int = 0, wind: Sequence[float] = (0.0, 0.0, 0.0), autopilot: Autopilot | None = None,
) -> FlightRecord:  # fmt: skip
    """Fly `schedule` in the nonlinear model, stabilised by a gain-scheduled LQR, and record every `dt` seconds.

    The reference at each moment is the quasi-steady trim of the commanded airspeed and acceleration. `excitation` is
    added to the inputs. `noise_db`: white noise on u v w p q r phi theta, this many dB below each signal's own variation, which
    the autopilot sees too (the noise-free flight is flown first to know it). `wind`: north east down, m/s, from the start.

    The record holds the measured states, the flapping angles a1 b1 and rotor states (without noise), the four total inputs,
    the excitation as e_d_lon .., `airspeed` (true, of the air) and `airspeed_command`. Raises `SymheliError` where the flight is lost.
    """
    if not dt > 0:
        raise InputError(f"dt must be a positive number of seconds, got {dt}")
    flight = _Flight(heli, schedule, dt, excitation, np.asarray(wind, float), autopilot)
    record = flight.run(np.zeros((flight.samples, len(MEASURED))))
    if noise_db is None:
        return record
    spread = record.columns(MEASURED).std(axis=0) * 10 ** (-noise_db / 20)
    noise = np.random.default_rng(seed).standard_normal((flight.samples, len(MEASURED))) * spread
    return replace(flight.run(noise), note=record.note + f", noise {noise_db:g} dB below each signal, seed {seed}")


class _Flight:
    """Everything of a flight that does not depend on the noise."""

    def __init__(
        self,
        heli: Helicopter,
        schedule: AirspeedSchedule,
        dt: float,
        excitation: Excitation | None,
        wind: np.ndarray,
        autopilot: Autopilot | None,
    ):
        self.heli, self.wind = heli, wind
        self.per_sample = math.ceil(dt / CONTROL_PERIOD - 1e-9)
        self.control_dt = dt / self.per_sample
        self.step = Numeric(runge_kutta(heli, self.control_dt, math.ceil(self.control_dt / INTEGRATION_STEP - 1e-9)))
        self.samples = math.floor(schedule.duration / dt) * self.per_sample
        self.time = self.control_dt * np.arange(self.samples)
        self.speed, self.rate = schedule(self.time)
        top = max(float(self.speed.max()), float(self.speed.min()) + 1.0)
        self.autopilot = autopilot or gain_scheduled_lqr(heli, float(self.speed.min()), top, self.control_dt)
        if abs(self.autopilot.dt - self.control_dt) > 1e-9:
            raise InputError(f"the autopilot was designed for {self.autopilot.dt} s, this flight controls every {self.control_dt:.6g} s")
        added = excitation(self.time) if excitation else {}
        self.added = np.column_stack([added.get(str(name), np.zeros(self.samples)) for name in heli.inputs])
        self.x0, self.u0 = self._references()

    def _references(self) -> tuple[np.ndarray, np.ndarray]:
        """Quasi-steady states (n, nx) and inputs (n, 4) of the commanded airspeed and acceleration, every 0.1 s, in between linear."""
        stride = max(round(0.1 / self.control_dt), 1)
        knots = sorted({*range(0, self.samples, stride), self.samples - 1})
        x, u, point = [], [], None
        known: dict[tuple[float, float], TrimPoint] = {}
        for k in knots:
            key = (float(self.speed[k]), float(self.rate[k]))
            if key not in known:
                known[key] = self._reference(*key, start=point)
            point = known[key]
            x.append(point.x.array)
            u.append(point.u.array)

        def spread(values: list[np.ndarray]) -> np.ndarray:
            return np.column_stack([np.interp(self.time, self.time[knots], column) for column in np.array(values).T])

        x0 = spread(x)
        x0[:, self.heli.states.index(Signal("q"))] = np.gradient(x0[:, self.heli.states.index(Signal("theta"))], self.time)
        return x0, spread(u)

    def _reference(self, speed: float, acceleration: float, start: TrimPoint | None) -> TrimPoint:
        """The best quasi-steady point: where the wake factor jumps (flow reversing through the disc) none is exact."""
        for continuation in (False, True):  # the long way only where the short one fails
            point = trim(
                self.heli, speed, acceleration=acceleration, wind=self.wind, start=start, throw=False, continuation=continuation
            )  # fmt: skip
            miss = np.abs(point.residual.array[:6]).max()
            if miss <= REFERENCE_MISS:
                return point
        raise TrimError(
            f"no quasi-steady reference at {speed:.1f} m/s, {acceleration:.1f} m/s^2 (misses by {miss:.2g} SI): fly gentler", point
        )

    def run(self, noise: np.ndarray) -> FlightRecord:
        heli, autopilot, travel = self.heli, self.autopilot, self.heli.travel
        seen = [heli.states.index(s) for s in autopilot.states]
        noisy = [heli.states.index(Signal(s)) for s in MEASURED]
        gains = np.stack([autopilot.gain(p) for p in self.speed])
        flight = self._quaternion_start()
        states, inputs, air = np.empty((self.samples, len(heli.states))), np.empty((self.samples, 4)), np.empty(self.samples)
        for k in range(self.samples):
            states[k], air[k] = _euler_form(flight, self.wind)
            states[k, noisy] += noise[k]
            command = self.u0[k] - gains[k] @ (states[k] - self.x0[k])[seen] + self.added[k]
            inputs[k] = np.clip(command, -travel, travel)
            flight = self.step(flight, inputs[k], self.wind)[0]
            if not np.all(np.isfinite(flight)) or abs(states[k, 7]) > 1.4 or abs(states[k, 6]) > 1.4:
                raise SymheliError(
                    f"the flight was lost at {self.time[k]:.2f} s near {self.speed[k]:.1f} m/s: "
                    "less excitation, noise or acceleration, please"
                )
        return self._record(states, inputs, air)

    def _quaternion_start(self) -> np.ndarray:
        x = self.x0[0]
        cp, sp, ct, st = np.cos(x[6] / 2), np.sin(x[6] / 2), np.cos(x[7] / 2), np.sin(x[7] / 2)
        return np.concatenate([x[:6], [cp * ct, sp * ct, cp * st, -sp * st], np.zeros(3), x[8:]])

    def _record(self, states: np.ndarray, inputs: np.ndarray, air: np.ndarray) -> FlightRecord:
        keep = slice(None, None, self.per_sample)
        columns = {str(s): states[keep, i] for i, s in enumerate(self.heli.states)}
        columns |= {str(s): inputs[keep, i] for i, s in enumerate(self.heli.inputs)}
        columns |= {f"e_{s}": self.added[keep, i] for i, s in enumerate(self.heli.inputs)}
        columns |= {"airspeed": air[keep], "airspeed_command": self.speed[keep]}
        units = {name: UNITS[name.removeprefix("e_")] for name in columns}
        note = f"{self.heli.vehicle.title}, {self.heli.governor} governor, peak acceleration {np.abs(self.rate).max():.1f} m/s^2"
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
