"""The states and controls a flight is held to: quasi-steady trims along the commanded airspeed."""

from __future__ import annotations

import numpy as np

from symheli.errors import TrimError
from symheli.helicopter import Helicopter
from symheli.steady.equilibrium import TrimPoint, trim
from symheli.values.signal import Signal

LARGEST_MISS = 0.3
"""Residual of the accelerations (m/s^2, rad/s^2) a reference may have; feedback makes up for it."""
INTERVAL = 0.1  # s between trims; linear in between


def references(
    heli: Helicopter, time: np.ndarray, speed: np.ndarray, rate: np.ndarray, wind: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Quasi-steady states (n, nx) and inputs (n, 4) at `time` (n,) s of the commanded airspeed
    `speed` (n,) m/s and its `rate` (n,) m/s^2 in a steady `wind` (3,), north east down, m/s; q
    follows theta. Raises `TrimError`.
    """
    stride = max(round(INTERVAL / (time[1] - time[0])), 1) if len(time) > 1 else 1
    knots = sorted({*range(0, len(time), stride), len(time) - 1})
    x, u, point = [], [], None
    known: dict[tuple[float, float], TrimPoint] = {}
    for k in knots:
        key = (float(speed[k]), float(rate[k]))
        if key not in known:
            known[key] = _reference(heli, *key, wind, start=point)
        point = known[key]
        x.append(point.x.array)
        u.append(point.u.array)

    def spread(values: list[np.ndarray]) -> np.ndarray:
        return np.column_stack(
            [np.interp(time, time[knots], column) for column in np.array(values).T]
        )

    x0, q = spread(x), heli.states.index(Signal("q"))
    if len(time) > 1:
        x0[:, q] = np.gradient(x0[:, heli.states.index(Signal("theta"))], time)
    return x0, spread(u)


def _reference(
    heli: Helicopter, speed: float, acceleration: float, wind: np.ndarray, start: TrimPoint | None
) -> TrimPoint:
    """The best quasi-steady point: where the wake factor jumps (flow reversing through the disc)
    none is exact.
    """
    for continuation in (False, True):  # the long way only where the short one fails
        point = trim(
            heli,
            speed,
            acceleration=acceleration,
            wind=wind,
            start=start,
            throw=False,
            continuation=continuation,
        )
        miss = np.abs(point.residual.array[:6]).max()
        if miss <= LARGEST_MISS:
            return point
    raise TrimError(
        f"no quasi-steady reference at {speed:.1f} m/s, {acceleration:.1f} m/s^2 (misses by"
        f" {miss:.2g} SI): fly gentler",
        point,
    )
