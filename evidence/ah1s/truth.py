"""Linear models of the sampled simulator, frozen at an airspeed: by realization from small pulses,
and, beside it, by central differences of the held simulator.
"""

from __future__ import annotations

import numpy as np

from evidence.ah1s.simulator import AH1S, DT, STATES, STICKS
from evidence.ah1s.trim import Trim
from symheli import LinearModel
from symheli.errors import AccuracyError
from symheli.values import NamedVector, Signal
from symheli.values.arrays import Array
from symheli.values.operating_point import OperatingPoint

SLOWEST = 1.0
"""m/s; nearer to rest the simulator has no derivative (its air angles jump), and no linear
model.
"""

SAMPLES = 240
"""Of a pulse response: 4.8 s."""

PULSE = 0.02
"""Size of the pulses, part of the travel; halving it moves the models by a thousandth of the
tolerance below.
"""

ORDERS = range(10, 19)
"""States tried for a realization: the body has eight, the controls four lags, inflow and downwash
the rest. The fewest that predict are taken: with more, slow poles appear that the simulator does
not have.
"""

SCALE = np.array([0.1, 0.1, 0.1, 1.0, 1.0, 1.0, 1.0, 1.0])
"""Outputs times this are realized alike: 10 m/s as 1 rad."""

PREDICTS = 0.005
"""Part of the response to fresh stick movements, of each output, that a realization may miss."""

STATIC = 0.02
"""Part of the static gains by which it may differ from central differences."""

FRESH = 200, 10, 0.005
"""Samples of such movements, how many of them a stick stays, and its size."""

GOVERNOR, SETTLE = 900.0, 20.0
"""Seconds held before a realization, in which the governor (58 s) comes to rest, and before each
response, in which the rest does: a rotor that still creeps does not cancel in differences.
"""

STATE_STEP = np.array([0.05, 0.05, 0.05, 0.01, 0.01, 0.01, 0.005, 0.005])
STICK_STEP = 0.01


def responses(simulator: AH1S, trim: Trim, inputs: Array) -> Array:
    """Outputs (n, 8), in deviations from trim, of small stick movements (n, 4): half the difference
    of these and the opposite ones, in which trim errors and squares cancel.
    """
    both = []
    for sign in (1.0, -1.0):
        simulator.hold(trim.state, trim.sticks, SETTLE)
        simulator.release()
        both.append([simulator.step(trim.sticks + sign * move) for move in inputs])
    return 0.5 * (np.array(both[0]) - np.array(both[1]))


def markov(simulator: AH1S, trim: Trim) -> Array:
    """Pulse responses (samples, 8, 4) per unit of stick, from one sample after the pulse on."""
    out = []
    for j in range(len(STICKS)):
        pulse = np.zeros((SAMPLES, len(STICKS)))
        pulse[0, j] = PULSE
        out.append(responses(simulator, trim, pulse) / PULSE)
    return np.stack(out, axis=2)


def realization(simulator: AH1S, trim: Trim) -> LinearModel:
    """The sampled simulator near `trim`, sticks held over each sample (50 Hz): with the fewest
    states that predict stick movements it was not made of. Raises `AccuracyError` where none does.

    Source: Juang and Pappa (1985), An eigensystem realization algorithm, J. Guidance 8(5).
    """
    simulator.hold(trim.state, trim.sticks, GOVERNOR)
    h = markov(simulator, trim) * SCALE[:, None]
    rows = len(h) // 2
    hankel = np.block([[h[i + j] for j in range(rows)] for i in range(rows)])
    shifted = np.block([[h[i + j + 1] for j in range(rows)] for i in range(rows)])
    U, s, Vt = np.linalg.svd(hankel, full_matrices=False)
    samples, stay, size = FRESH
    signs = np.random.default_rng(0).choice([-size, size], (samples // stay, len(STICKS)))
    inputs = np.repeat(signs, stay, axis=0)
    outputs = responses(simulator, trim, inputs)
    ny, nu = h.shape[1:]
    missed = np.inf
    for order in ORDERS:
        root = np.sqrt(s[:order])
        left, right = U[:, :order] / root, Vt[:order].T / root
        model = LinearModel(
            left.T @ shifted @ right,
            root[:, None] * Vt[:order, :nu],
            (U[:ny, :order] * root) / SCALE[:, None],
            np.zeros((ny, nu)),
            tuple(Signal(f"x{i}") for i in range(order)),
            STICKS,
            STATES,
            dt=DT,
            point=point_of(trim),
        )
        error = response(model, inputs) - outputs
        missed = (np.linalg.norm(error, axis=0) / np.linalg.norm(outputs, axis=0)).max()
        if missed < PREDICTS:
            return model
    raise AccuracyError(
        f"no linear model of up to {ORDERS[-1]} states predicts the simulator at"
        f" {np.linalg.norm(trim.state[:3]):.4g} m/s: {100 * missed:.2g} % of a response is missed;"
        " it may have a kink there"
    )


def response(model: LinearModel, inputs: Array) -> Array:
    """Outputs (n, ny) of a discrete model one sample after each of the inputs (n, nu), from
    rest.
    """
    x, out = np.zeros(len(model.states)), []
    for u in inputs:
        x = model.A @ x + model.B @ u
        out.append(model.C @ x)
    return np.array(out)


def held_model(simulator: AH1S, trim: Trim) -> LinearModel:
    """The body alone, rotors and lags settled (continuous): central differences of the
    accelerations the held simulator shows, and exact kinematics.
    """
    x, u = trim
    A, B = np.zeros((8, 8)), np.zeros((8, 4))
    for i, h in enumerate(np.diag(STATE_STEP)):
        A[:6, i] = (simulator.hold(x + h, u) - simulator.hold(x - h, u)) / (2 * STATE_STEP[i])
    for j, h in enumerate(STICK_STEP * np.eye(4)):
        B[:6, j] = (simulator.hold(x, u + h) - simulator.hold(x, u - h)) / (2 * STICK_STEP)
    phi, theta = trim.state[6:]
    A[6, 3:6] = 1.0, np.sin(phi) * np.tan(theta), np.cos(phi) * np.tan(theta)
    A[7, 4:6] = np.cos(phi), -np.sin(phi)
    return LinearModel(
        A, B, np.eye(8), np.zeros((8, 4)), STATES, STICKS, STATES, point=point_of(trim)
    )


def point_of(trim: Trim) -> OperatingPoint:
    """The trim by names."""
    return OperatingPoint(
        NamedVector(STATES, trim.state),
        NamedVector(STICKS, trim.sticks),
        NamedVector(STATES, np.zeros(len(STATES))),
        float(np.linalg.norm(trim.state[:3])),
    )
