"""The family of exact linear models along a range of airspeeds, and where it has corners."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from symheli.errors import InputError
from symheli.helicopter import Helicopter
from symheli.lpv.linear_family import LinearFamily
from symheli.lpv.linear_model import LinearModel
from symheli.steady.equilibrium import TrimPoint, trim
from symheli.steady.linearization import linearize

_MEANINGLESS = 1e-7  # a switching function that stays below this is zero, not switching


def sweep(
    heli: Helicopter,
    airspeeds: Sequence[float],
    *,
    climb_rate: float = 0.0,
    acceleration: float = 0.0,
    inputs: Sequence[str] | None = None,
    start: LinearFamily | None = None,
) -> LinearFamily:
    """Trim and linearize at each of several airspeeds, each trim started from the one before.

    Parameters
    ----------
    heli : Helicopter
        The model.
    airspeeds : sequence of float
        Increasing, m/s.
    climb_rate : float
        m/s, up.
    acceleration : float
        m/s^2, horizontal, along the nose: quasi-steady points of an accelerating flight.
    inputs : sequence of str, optional
        As in `linearize`.
    start : LinearFamily, optional
        A family at the same airspeeds whose trims are near, to start from instead.

    Returns
    -------
    LinearFamily
        Its `kinks` list, by cause, the airspeeds between the first and the last at which the linear
        models have a corner (a wake edge, a limit, a flow reversal).

    Raises
    ------
    TrimError
        No equilibrium at one of them.
    InputError
        Airspeeds that do not increase.

    Examples
    --------
    >>> family = symheli.sweep(heli, [2.0, 5.0, 8.0])
    >>> family.A.shape, len(family.trims)
    ((3, 10, 10), 3)
    """
    models = models_along(
        heli,
        airspeeds,
        climb_rate=climb_rate,
        acceleration=acceleration,
        inputs=inputs,
        start=start,
    )
    points: list[TrimPoint] = [model.point for model in models]  # type: ignore[misc]
    speeds = [point.airspeed for point in points]
    return LinearFamily.from_models(speeds, models, kink_speeds(heli, points))


def models_along(
    heli: Helicopter,
    airspeeds: Sequence[float],
    *,
    climb_rate: float,
    acceleration: float,
    inputs: Sequence[str] | None,
    start: LinearFamily | None,
) -> list[LinearModel]:
    """The models of `sweep`, without looking for corners between them."""
    speeds = [float(v) for v in np.atleast_1d(airspeeds)]
    if not speeds or any(b <= a for a, b in pairwise(speeds)):
        raise InputError("sweep needs increasing airspeeds")
    if start and not np.array_equal(start.airspeeds, speeds):
        raise InputError("the family to start from has other airspeeds")
    points: list[TrimPoint] = []
    for k, speed in enumerate(speeds):
        near = start.trims[k] if start else points[-1] if points else None
        points.append(
            trim(heli, speed, climb_rate=climb_rate, acceleration=acceleration, start=near)  # type: ignore[arg-type]
        )
    moving = acceleration != 0
    return [linearize(heli, point, inputs=inputs, allow_accelerating=moving) for point in points]


def kink_speeds(heli: Helicopter, points: Sequence[TrimPoint]) -> Mapping[str, tuple[float, ...]]:
    """Airspeeds (m/s) between neighbouring trims at which a switching function changes sign, to
    1e-6 m/s, by cause.
    """
    values = [heli.in_air(p.density).switches(p.x.array, p.u.array, p.wind.array) for p in points]
    kinks: dict[str, tuple[float, ...]] = {}
    for name in values[0]:
        if name.endswith("vortex ring"):  # a flag, not a corner
            continue
        found = []
        for before, after, a, b in zip(
            points[:-1], points[1:], values[:-1], values[1:], strict=True
        ):
            if a[name] * b[name] < 0 and min(abs(a[name]), abs(b[name])) > _MEANINGLESS:
                found.append(_crossing(heli, name, before, after))
        if found:
            kinks[name] = tuple(found)
    return kinks


def _crossing(heli: Helicopter, name: str, before: TrimPoint, after: TrimPoint) -> float:
    def value(speed: float) -> float:
        asked = before.condition
        # where the equations jump there may be no trim, and the nearest point says which side it is
        point = trim(
            heli,
            speed,
            climb_rate=asked.climb_rate,
            acceleration=asked.acceleration,
            start=before,
            throw=False,
        )
        return heli.switches(point.x.array, point.u.array, point.wind.array)[name]

    return float(brentq(value, before.airspeed, after.airspeed, xtol=1e-6))  # type: ignore[arg-type]
