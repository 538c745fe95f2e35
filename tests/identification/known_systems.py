"""Systems with known coefficients, simulated by a loop that shares no code with the estimators."""

from __future__ import annotations

import numpy as np

from identification import LPVARX, Polynomial
from identification.model import Coefficients
from symheli.records import FlightRecord


def flown(arx, A, B, p, u, *, c=None, d=None, noise=0.0, seed=0, dt=0.1):
    """A record of y(k) = -sum A_i(p) y(k-i) + sum B_j(p) u(k-delay-j) + c(p) + d(p)(p(k)-p(k-1)) +
    noise, from callables of p.
    """
    rng = np.random.default_rng(seed)
    n, ny = len(p), arx.ny
    y = np.zeros((n, ny))
    y[: arx.memory] = rng.normal(size=(arx.memory, ny))
    for k in range(arx.memory, n):
        at = (
            (lambda lag, k=k: p[k - lag]) if arx.scheduling_at == "lag" else (lambda lag, k=k: p[k])
        )
        y[k] = -sum((A[i - 1](at(i)) @ y[k - i] for i in arx.output_lags), np.zeros(ny))
        y[k] += sum(
            (B[j](at(lag)) @ u[k - lag] for j, lag in enumerate(arx.input_lags)), np.zeros(ny)
        )
        y[k] += c(at(1)) if c else 0.0
        y[k] += d(at(1)).reshape(ny, -1) @ np.atleast_1d(p[k] - p[k - 1]) if d else 0.0
        y[k] += noise * rng.normal(size=ny)
    columns = dict(
        zip((*arx.outputs, *arx.inputs, *arx.parameters), np.column_stack([y, u, p]).T, strict=True)
    )
    return FlightRecord.from_arrays(dt * np.arange(n), dict.fromkeys(columns, "1"), **columns)


class Truth:
    """A structure with random coefficients small enough to be stable, and records of it."""

    def __init__(self, arx, seed=0, size=0.45):
        self.arx, rng = arx, np.random.default_rng(seed)
        n, ny, nu = arx.basis.size, arx.ny, arx.nu
        na, d_shape = (
            len(arx.output_lags),
            (n, ny) if arx.basis.dimension == 1 else (n, ny, arx.basis.dimension),
        )
        A = rng.uniform(-1, 1, (na, n, ny, ny)) * size / max(na * ny, 1) / n
        B = rng.uniform(-1, 1, (len(arx.input_lags), n, ny, nu))
        c = rng.uniform(-1, 1, (n, ny)) * arx.offset
        d = rng.uniform(-1, 1, d_shape) * arx.offset_rate
        self.theta = Coefficients(
            basis=arx.basis, input_lags=tuple(arx.input_lags), A=A, B=B, c=c, d=d
        ).theta(arx)  # zero where an equation lacks a regressor
        self.coefficients = Coefficients.of(arx, self.theta)

    @classmethod
    def of(cls, arx, theta):
        """A structure with these coefficients."""
        truth = cls(arx)
        truth.theta, truth.coefficients = theta, Coefficients.of(arx, theta)
        return truth

    def record(self, p, *, noise=0.0, seed=1, noise_seed=None):
        """A record with random inputs and white noise in the equations; the noise has a stream of
        its own.
        """
        arx, v = self.arx, self.coefficients.at(np.asarray(p))
        u = np.random.default_rng(seed).normal(size=(len(p), arx.nu))
        now = {np.asarray(q).tobytes(): k for k, q in enumerate(p)}
        A = [
            lambda q, i=i: v.A[now[np.asarray(q).tobytes()], i] for i in range(len(arx.output_lags))
        ]
        B = [
            lambda q, j=j: v.B[now[np.asarray(q).tobytes()], j] for j in range(len(arx.input_lags))
        ]
        c, d = (lambda q, part=part: part[now[np.asarray(q).tobytes()]] for part in (v.c, v.d))
        return flown(
            arx,
            A,
            B,
            p,
            u,
            c=c,
            d=d,
            noise=noise,
            seed=(seed, 1) if noise_seed is None else noise_seed,
        )


def moving(n=700):
    """A scheduling signal (n,) that sweeps 0-13 with two frequencies."""
    k = np.arange(n)
    return 6.5 + 3.5 * np.sin(0.11 * k) + 2.9 * np.sin(0.37 * k + 1.0)


def moving_box(n=700):
    """Two scheduling signals (n, 2) that fill 0-13 by 0.9-1.3."""
    k = np.arange(n)
    return np.column_stack([moving(n), 1.1 + 0.12 * np.sin(0.29 * k) + 0.07 * np.cos(0.053 * k)])


def structure(**over):
    usual = dict(
        outputs=("y",),
        inputs=("u",),
        scheduling="p",
        na=2,
        nb=2,
        delay=1,
        basis=Polynomial(2, 0.0, 13.0),
    )
    return LPVARX(**{**usual, **over})
