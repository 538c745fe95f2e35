"""Flights of the AH-1S along an airspeed schedule, under a feedback of our own, recorded."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from evidence.ah1s.simulator import AH1S, DEFLECTIONS, DT, STATES, STICKS
from evidence.ah1s.trim import GUESS, Trim, trim
from evidence.ah1s.truth import SLOWEST, held_model
from symheli.errors import FlightLostError
from symheli.flight import AirspeedSchedule, Excitation
from symheli.lpv.riccati import regulator
from symheli.records import FlightRecord
from symheli.values import Signal
from symheli.values.arrays import Array

KNOTS = (0.0, 2.0, 4.0, 7.0, 10.0, 13.0, 16.0, 20.0, 25.0, 31.0, 38.0, 45.0, 52.0)
"""Airspeeds at which the controller is designed and the trims are found, m/s."""

ACCELERATIONS = (-2.0, 0.0, 2.0)
"""Between these the reference is a parabola, m/s^2."""

ERRORS = np.array([1.0, 1.0, 1.0, 0.2, 0.2, 0.2, 0.1, 0.1])
EFFORT = 0.1
"""Deviations of the states and of the sticks that the regulator weighs alike."""

LOST = np.radians(60.0)
"""Roll or pitch from which on a flight is no flight."""


@dataclass(frozen=True)
class Pilot:
    """What the flights are held to and by: trims (airspeeds, accelerations, 12) and gains
    (airspeeds, 4, 8) over `KNOTS`. The linear models it is designed on are for control only.
    """

    trims: Array
    gains: Array

    def reference(self, airspeed: Array, acceleration: Array) -> Array:
        """Quasi-steady states and sticks (n, 12)."""
        low, level, high = (CubicSpline(KNOTS, self.trims[:, i])(airspeed) for i in range(3))
        a = (acceleration / ACCELERATIONS[2])[:, None]
        return level + a * (high - low) / 2 + a**2 * ((high + low) / 2 - level)

    def reset(self) -> None:
        """Nothing is remembered."""

    def step(
        self, measured: Mapping[str, float], reference: Mapping[str, float], p: Mapping[str, float]
    ) -> Array:
        """Sticks (4,) of one sample: those of the reference, less K times what is missing to its
        state.
        """
        error = np.array([measured[s] - reference[s] for s in STATES])
        K = self.gain(np.array([p["airspeed"]]))[0]
        return np.array([reference[s] for s in STICKS]) - K @ error

    def gain(self, airspeed: Array) -> Array:
        """K (n, 4, 8), linear between airspeeds."""
        flat = self.gains.reshape(len(KNOTS), -1)
        columns = [np.interp(airspeed, KNOTS, column) for column in flat.T]
        return np.stack(columns, axis=1).reshape(-1, *self.gains.shape[1:])


@functools.cache
def pilot() -> Pilot:
    """Trims and a linear quadratic regulator, found once a process in a few seconds."""
    simulator, trims, gains, guess = AH1S(), [], [], GUESS
    for airspeed in KNOTS:
        level = trim(simulator, airspeed, guess=guess)
        guess = unknown(level)
        row = [level if not a else trim(simulator, airspeed, a, guess=guess) for a in ACCELERATIONS]
        trims.append([np.concatenate(one) for one in row])
        near = level if airspeed else trim(simulator, SLOWEST, guess=guess)
        gains.append(_regulator(simulator, near))
    return Pilot(np.array(trims), np.array(gains))


def unknown(found: Trim) -> Array:
    """Roll, pitch and sticks of a trim (6,), a guess for the next."""
    return np.concatenate([found.state[6:], found.sticks])


def _regulator(simulator: AH1S, near: Trim) -> Array:
    model = held_model(simulator, near).discretize(DT)
    Q, R = np.diag(ERRORS**-2.0), np.eye(len(STICKS)) / EFFORT**2
    return regulator(model.A, model.B, Q, R, dt=model.dt).K


@dataclass(frozen=True)
class Plan:
    """What is flown between hover and 52 m/s: `meta["plan"]` of a record.

    Amplitudes of the `excitation` are parts of the sticks' travel; white noise is `noise_db` below
    each signal's own variation.
    """

    schedule: AirspeedSchedule
    excitation: Excitation | None = None
    noise_db: float | None = None
    seed: int = 0

    @property
    def controller(self) -> Pilot:
        """What flies it."""
        return pilot()


@dataclass(frozen=True)
class CalmFlight:
    """The plan of a record flown once more without noise: a source of instruments."""

    def flown(self, record: FlightRecord) -> FlightRecord:
        """A whole record's twin."""
        return fly(replace(record.meta["plan"], noise_db=None))


def fly(plan: Plan) -> FlightRecord:
    """Fly a plan and record it at 50 Hz.

    The record holds u v w p q r phi theta as measured (the controller hears the noise too), the
    sticks d_lon d_lat d_col d_ped (parts of their travel), d_lon_reached .. (what the rotors are
    set to, rad), the excitation e_d_lon .., the true airspeed, airspeed_command,
    acceleration_command, and what the flight is held to: u_reference .. d_ped_reference. Raises
    `FlightLostError`, and `InputError` where jsbsim is missing.
    """
    excitation, noise_db, seed = plan.excitation, plan.noise_db, plan.seed
    time = DT * np.arange(int(plan.schedule.duration / DT))
    command, acceleration = plan.schedule(time)
    held_to = pilot().reference(command, acceleration)
    added = np.zeros((len(time), len(STICKS)))
    for name, signal in ({} if excitation is None else excitation(time)).items():
        added[:, STICKS.index(name)] = signal  # type: ignore[arg-type]
    gains, noise = pilot().gain(command), np.zeros((len(time), len(STATES)))
    states, measured, sticks, reached = _flown(held_to, gains, added, noise)
    if noise_db is not None:
        sizes = states.std(axis=0) * 10 ** (-noise_db / 20)
        noise = sizes * np.random.default_rng(seed).standard_normal(noise.shape)
        states, measured, sticks, reached = _flown(held_to, gains, added, noise)
    told = "" if noise_db is None else f", noise {noise_db:g} dB below each signal, seed {seed}"
    columns: Mapping[Signal, Array] = {
        **dict(zip(STATES, measured.T, strict=True)),
        **dict(zip(STICKS, sticks.T, strict=True)),
        **dict(zip(DEFLECTIONS, reached.T, strict=True)),
        **{Signal(f"e_{s}", s.unit): e for s, e in zip(STICKS, added.T, strict=True)},
        Signal("airspeed"): np.linalg.norm(states[:, :3], axis=1),
        Signal("airspeed_command"): command,
        Signal("acceleration_command", "m/s^2"): acceleration,
        **{
            Signal(f"{s}_reference", s.unit): column
            for s, column in zip((*STATES, *STICKS), held_to.T, strict=True)
        },
    }
    table = np.column_stack(list(columns.values()))
    return FlightRecord(
        time, table, tuple(columns), note=f"AH-1S of JSBSim{told}", meta={"plan": plan}
    )


def _flown(
    held_to: Array, gains: Array, added: Array, noise: Array
) -> tuple[Array, Array, Array, Array]:
    """True and measured states (n, 8), the sticks (n, 4) that follow from each sample on, and the
    deflections (n, 4) reached at it.
    """
    simulator, n = AH1S(), len(held_to)
    start = Trim(held_to[0, : len(STATES)], held_to[0, len(STATES) :])
    simulator.hold(*start)
    simulator.release()
    states, sticks = np.empty((n, len(STATES))), np.empty((n, len(STICKS)))
    reached = np.empty_like(sticks)
    state = simulator.read()
    for k in range(n):
        states[k], reached[k] = state, simulator.deflections()
        error = state + noise[k] - held_to[k, : len(STATES)]
        sticks[k] = held_to[k, len(STATES) :] - gains[k] @ error + added[k]
        if not np.abs(state[6:]).max() < LOST:
            raise FlightLostError(
                f"the AH-1S was lost at {DT * k:.2f} s: roll {np.degrees(state[6]):.0f} deg, pitch"
                f" {np.degrees(state[7]):.0f} deg; reduce excitation or acceleration"
            )
        state = simulator.step(sticks[k])
    return states, states + noise, sticks, reached
