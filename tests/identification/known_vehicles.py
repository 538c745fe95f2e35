"""Rigid vehicles with known aerodynamic coefficients, flown by a loop that shares no code with the
estimators or the models: vectors and rotation matrices instead of components, steps solved to
convergence.
"""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np

import identification as idn
from symheli.records import FlightRecord

DT, G = 0.02, np.array([0.0, 0.0, 9.81])
STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta")
CONTROLS = ("d_lon", "d_lat", "d_col", "d_ped")
UNITS = dict(zip(STATES, ("m/s",) * 3 + ("rad/s",) * 3 + ("rad",) * 2, strict=True))
LOW, HIGH = 0.0, 10.0


def rates(y):
    """Rates (8,) of a rigid body without aerodynamics: g in body axes less omega x V, Euler."""
    V, omega = y[:3], y[3:6]
    p, q, r, phi, theta = y[3:].tolist()
    c, s = math.cos, math.sin
    roll = np.array([[1, 0, 0], [0, c(phi), s(phi)], [0, -s(phi), c(phi)]])
    pitch = np.array([[c(theta), 0, -s(theta)], [0, 1, 0], [s(theta), 0, c(theta)]])
    # columns: body rates of a unit rate of roll, of pitch and of yaw
    turned = np.array([(1.0, 0.0, 0.0), roll[:, 1], roll @ pitch[:, 2]]).T
    cross = np.array([[0, -r, q], [r, 0, -p], [-q, p, 0]])  # omega x
    out = np.zeros(8)
    out[:3] = roll @ (pitch @ G) - cross @ V
    out[6:] = np.linalg.solve(turned, omega)[:2]
    return out


class Vehicle:
    """A `KinematicARX` with known coefficients, stabilised by a fixed feedback of the attitude and
    the velocities.

    Damping and effectiveness of order one a second, twice as large at the highest p, and cross
    couplings of a few percent drawn at random.
    """

    def __init__(self, na=2, nb=2, degree=1, seed=0):
        self.kin = idn.KinematicARX(
            CONTROLS, "airspeed_command", na=na, nb=nb, basis=idn.Polynomial(degree, LOW, HIGH)
        )
        rng, aero = np.random.default_rng(seed), self.kin.aerodynamics
        own = np.zeros((6, 10))  # of one second: velocities, then d_lon d_lat d_col d_ped
        own[range(6), range(6)] = [-0.4, -0.5, -0.8, -6.0, -5.0, -4.0]
        own[[4, 3, 2, 5], [6, 7, 8, 9]] = [30.0, 40.0, -50.0, 25.0]
        values = []
        points = np.linspace(LOW, HIGH, 2 * degree + 3)
        growth = (1 + (points / HIGH) ** degree)[:, None]
        for entry in aero.entries:
            if entry.kind == "input":
                share = 1.0 if entry.lag == 1 else 0.3
                base = share * own[:, entry.channel] + 0.05 * rng.normal(size=6)
            elif entry.kind == "offset":
                base = np.array([0.1, -0.1, -0.5 * 9.81, 0.02, 0.02, -0.02])
            else:
                base = 2.0 * rng.normal(size=6)
            values.append(DT * base * growth)
        self.theta = np.vstack([aero.basis.fit(points, v) for v in values])  # (n, 6)

    def added(self, k, y, u, p, f):
        """Increments (6,) from samples before k and p of k and k - 1; f is the basis at p(k)."""
        signals = [
            (y[k - e.lag, e.channel] if e.channel < 6 else u[k - e.lag, e.channel - 6])
            if e.kind == "input"
            else {"offset": 1.0, "increment": p[k] - p[k - 1]}[e.kind]
            for e in self.kin.aerodynamics.entries
        ]
        return np.outer(signals, f).reshape(-1) @ self.theta

    def advanced(self, k, y, u, p, f):
        """y(k) by the trapezoidal rule, its equation solved until nothing moves."""
        added = np.append(self.added(k, y, u, p, f), [0.0, 0.0])
        new, start = y[k - 1], rates(y[k - 1])
        for _ in range(60):
            last, new = new, y[k - 1] + added + 0.5 * DT * (start + rates(new))
            if np.array_equal(new, last):
                break
        return new

    def record(self, n=600, seed=1, process=0.0, sensors=None, period=11.0):
        """A flight of n samples: random steps on every control, p to and fro.

        `process` is the standard deviation of white noise in the six equations, `sensors` (8,)
        those of white noise on the measured states; feedback acts on what is measured.
        """
        rng, noise = np.random.default_rng(seed), np.random.default_rng((seed, 1))
        u, y = np.zeros((n, 4)), np.zeros((n, 8))
        e = np.repeat(0.05 * rng.normal(size=(n // 7 + 1, 4)), 7, axis=0)[:n]
        p = 0.5 * (LOW + HIGH) + 4.5 * np.sin(2 * np.pi * DT / period * np.arange(n) + 0.3)
        blur = noise.normal(size=(n, 8)) * (np.zeros(8) if sensors is None else sensors)
        pushes = process * noise.normal(size=(n, 6))
        pilot, first, f = Pilot(), self.kin.memory, self.kin.aerodynamics.basis(p)
        for k in range(n):
            if k < first:
                y[k] = 0.05 * rng.normal(size=8)
            else:
                y[k] = self.advanced(k, y, u, p, f[k])
                y[k, :6] += pushes[k]
            u[k] = pilot.step(y[k] + blur[k], None, None) + e[k]
        columns = dict(zip((*STATES, *CONTROLS), np.column_stack([y + blur, u]).T, strict=True))
        columns |= {f"e_{c}": e[:, i] for i, c in enumerate(CONTROLS)}
        columns |= {"airspeed_command": p, "u_reference": np.zeros(n)}
        units = UNITS | dict.fromkeys((*CONTROLS, *(f"e_{c}" for c in CONTROLS)), "rad")
        units |= {"airspeed_command": "m/s", "u_reference": "m/s"}
        return FlightRecord.from_arrays(DT * np.arange(n), units, **columns)

    def model(self, record, theta=None):
        """The true coefficients, or others, in a `KinematicModel` beside what a fit says."""
        fitted = idn.fit(self.kin, record)
        aero = fitted.aerodynamics
        known = idn.model.LPVARXModel(
            structure=aero.structure,
            theta=self.theta if theta is None else theta,
            dt=aero.dt,
            outputs=aero.outputs,
            inputs=aero.inputs,
            scheduling=aero.scheduling,
            residual_covariance=aero.residual_covariance,
            rows_used=aero.rows_used,
        )
        return idn.model.KinematicModel(structure=self.kin, aerodynamics=known, trim=fitted.trim)

    def without_noise(self, **flight):
        """A source of flights: the same commands without noise."""
        return SimpleNamespace(flown=lambda record: self.record(n=len(record), **flight))


class Pilot:
    """Feedback that keeps a `Vehicle` upright; a controller, as flights know them."""

    def reset(self):
        """It remembers nothing."""

    def step(self, measured, reference, p):
        u, v, w, *_, r, phi, theta = np.asarray(measured)[:8]
        return np.array([-0.6 * theta + 0.03 * u, -0.5 * phi - 0.03 * v, 0.02 * w, -0.02 * r])
