"""Local gains on proven tubes beside those of the linear loop at the same airspeed, of its LPV
model around it, and the largest ratio flown.
"""

from __future__ import annotations

import casadi
import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

import symheli
import synthesis
from evidence.tables import markdown
from symheli import Helicopter
from symheli.errors import InputError
from synthesis.tubes import Tube

Array = np.ndarray

CASES = (
    ("xcell60", 3.0, "theta"),
    ("xcell60", 8.0, "theta"),
    ("xcell_kahn_hudson", 3.0, "theta"),
)
"""Helicopter, airspeed, m/s, output."""
GUST = 0.2
"""Amplitude of the gusts, m/s."""
AROUND, RATE, POINTS, DEGREE = 0.5, 1.0, 5, 2
"""Of the LPV model: airspeeds to either side, m/s, their rate, m/s^2, models, degree."""
GUSTS = ("u_w", "v_w", "w_w")
STEP, PERIODS, SECONDS = 0.005, 20, 20.0
"""Of the flights: Runge and Kutta's step, s; periods of a sine; length of a single gust, s."""
FREQUENCIES = np.concatenate([[0.0], np.geomspace(0.05, 50, 400)])
"""rad/s, at which the linear loop is looked at."""


def linear(found: Tube) -> tuple[Array, Array, casadi.Function]:
    """A, E of de/dt at the reference, and de/dt of (e, w), w in m/s."""
    loop, e, w = found.deviations, casadi.SX.sym("e", 10), casadi.SX.sym("w", 3)
    data, c = loop.reference.data[0], np.zeros(4)
    rate = loop.rate(e, w / loop.gust, c, data)
    slopes = casadi.Function("AE", [e, w], [casadi.jacobian(rate, e), casadi.jacobian(rate, w)])
    A, E = (np.asarray(m) for m in slopes(np.zeros(10), np.zeros(3)))
    return A, E, casadi.Function("rate", [e, w], [rate])


def flown(found: Tube, rate: casadi.Function, gusts: Array, output: int) -> tuple[float, float]:
    """(energy, peak) of a deviation in a flight from the reference through gusts (N, 3), m/s, each
    as a ratio to their energy; `InputError` would mean that it left the tube.
    """
    e, P, z = np.zeros(10), found.P[0], [0.0]
    for w in gusts:
        a = np.asarray(rate(e, w))[:, 0]
        b = np.asarray(rate(e + STEP / 2 * a, w))[:, 0]
        c = np.asarray(rate(e + STEP / 2 * b, w))[:, 0]
        d = np.asarray(rate(e + STEP * c, w))[:, 0]
        e = e + STEP / 6 * (a + 2 * b + 2 * c + d)
        z.append(float(e[output]))
        if e @ P @ e > 1:
            raise InputError("a flight left the tube")
    size = np.sqrt((gusts**2).sum() * STEP)
    return float(np.sqrt((np.square(z)).sum() * STEP) / size), float(np.abs(z).max() / size)


def worst_sine(A: Array, E: Array, output: int) -> tuple[float, Array]:
    """(largest gain of the linear loop, gusts of unit amplitude at its frequency, (N, 3))."""
    C = np.eye(10)[output]
    rows = [C @ np.linalg.solve(1j * f * np.eye(10) - A, E) for f in FREQUENCIES]
    sizes = [np.linalg.norm(row) for row in rows]
    k = int(np.argmax(sizes))
    frequency, share = FREQUENCIES[k], np.conj(rows[k]) / sizes[k]
    length = PERIODS * 2 * np.pi / frequency if frequency else 10 * SECONDS
    t = STEP * np.arange(int(length / STEP))
    gusts = np.real(np.exp(1j * frequency * t)[:, None] * share)
    return float(sizes[k]), gusts / np.linalg.norm(gusts, axis=1).max()


def worst_push(A: Array, E: Array, output: int) -> tuple[float, Array]:
    """(largest peak per energy^1/2 of the linear loop, the gusts that make it, unit amplitude)."""
    C, back, rows = np.eye(10)[output], expm(A.T * STEP), []
    X = solve_continuous_lyapunov(A, -E @ E.T)
    for _ in range(int(SECONDS / STEP)):
        rows.append(C @ E)
        C = back @ C
    gusts = np.array(rows[::-1])
    return float(X[output, output] ** 0.5), gusts / np.linalg.norm(gusts, axis=1).max()


def certified(heli: Helicopter, airspeed: float, K: Array, output: str) -> tuple[float, float]:
    """(L2 gain, energy to peak) proven of the LPV model of the same loop around an airspeed."""
    ends = np.linspace(max(airspeed - AROUND, 0.0), airspeed + AROUND, POINTS)
    controls, states = map(str, heli.inputs), list(map(str, heli.states))
    family = symheli.sweep(heli, ends, inputs=(*controls, *GUSTS))  # type: ignore[arg-type]
    gains = {
        (str(u), x): float(K[i, j]) for i, u in enumerate(heli.inputs) for j, x in enumerate(states)
    }
    model = family.interpolate("polynomial", DEGREE).feedback(gains)
    loop = model.select(inputs=GUSTS, outputs=(output,))
    found = [ask(loop, rate=RATE) for ask in (synthesis.l2_gain, synthesis.analysis.energy_to_peak)]
    return float(found[0].gamma), float(found[1].gamma)


def table() -> str:
    """The table in Markdown, two rows for each case."""
    rows = []
    for name, airspeed, output in CASES:
        heli = Helicopter.load(name, governor="ideal")
        found = synthesis.tubes.tube(heli, airspeed, gust=GUST)
        found = found.with_gain([output]).with_gain([output], energy=False)
        own = [gain.gamma for gain in found.gains]
        lpv = certified(heli, airspeed, found.deviations.reference.gain[0], output)
        A, E, rate = linear(found)
        place = found.deviations.states.index(output)
        for k, (kind, make) in enumerate((("L2", worst_sine), ("peak", worst_push))):
            frozen, gusts = make(A, E, place)
            ratio = flown(found, rate, GUST * gusts, place)[k]
            case = [name, f"{airspeed:g}", f"{output}, {kind}"]
            rows.append([*case, *(f"{v:.4g}" for v in (frozen, lpv[k], own[k], ratio))])
            print(*rows[-1], flush=True)
    head = ["helicopter", "airspeed, m/s", "output, gain", "linear loop", "LPV model"]
    return markdown([*head, "nonlinear, proven", "flown"], rows)
