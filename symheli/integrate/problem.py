"""Simulation problem: the inputs of a simulation, checked once for all methods and numbers of
flights.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from symheli.errors import InputError
from symheli.helicopter import Helicopter
from symheli.physics.attitude import flight_state
from symheli.steady.equilibrium import TrimPoint
from symheli.values.arrays import Array, frozen

MAX_STEPS_PER_SAMPLE = 1_000_000
"""Largest number of integration steps a sample."""


@dataclass(frozen=True, eq=False)
class Problem:
    """`count` flights of `samples` samples of `dt` seconds: x0 (count, nx), u (count or 1, n, 4),
    wind (count or 1, n or 1, 3), p (count or 1, parameters); an axis of length 1 is shared.
    Quaternion form, wind north east down, SI.
    """

    x0: Array
    u: Array
    wind: Array
    p: Array
    dt: float

    @property
    def count(self) -> int:
        """Number of flights."""
        return len(self.x0)

    @property
    def samples(self) -> int:
        """Control intervals of each flight."""
        return self.u.shape[1]

    def substeps(self, longest: float) -> tuple[int, float]:
        """Number and size (s) of the equal steps, none longer than `longest`, that make one
        sample.
        """
        count = max(math.ceil(min(self.dt / longest, 2.0 * MAX_STEPS_PER_SAMPLE) - 1e-9), 1)
        if count > MAX_STEPS_PER_SAMPLE:
            raise InputError(
                f"dt of {self.dt:g} s takes more than {MAX_STEPS_PER_SAMPLE} steps of"
                f" {longest:g} s a sample; is it in seconds?"
            )
        return count, self.dt / count


def one_flight(heli: Helicopter, x0: object, u: object, wind: object, dt: float) -> Problem:
    """A problem of one flight from what a user gives; see `symheli.simulate`."""
    return _checked(
        _start(heli, x0)[None],
        frozen(u, "u", (None, 4))[None],
        _wind(wind),
        heli.parameters.array[None],
        dt,
    )


def many_flights(
    heli: Helicopter,
    x0: object,
    u: object,
    wind: object,
    dt: float,
    parameters: Mapping[str, object],
) -> Problem:
    """A problem of N flights from what a user gives; see `symheli.integrate.simulate_batch`."""
    u, w, start = np.asarray(u, float), _wind(wind), _start(heli, x0)
    values = {name: np.asarray(value, float) for name, value in parameters.items()}
    lengths = {len(start)} if start.ndim == 2 else set()
    lengths |= {len(a) for a in (u, w) if a.ndim == 3 and len(a) > 1}
    lengths |= {len(v) for v in values.values() if v.ndim == 1}
    if len(lengths) != 1 or 0 in lengths:
        raise InputError(
            "x0 (N, nx), u (N, n, 4), wind (N, n, 3) and parameters (N,) must agree on the number"
            f" of flights N >= 1, got {sorted(lengths) or 'none'}"
        )
    count = lengths.pop()
    u = u if u.ndim == 3 else frozen(u, "u", (None, 4))[None]
    return _checked(
        np.broadcast_to(start, (count, start.shape[-1])), u, w, _varied(heli, values, count), dt
    )


def _varied(heli: Helicopter, values: Mapping[str, Array], count: int) -> Array:
    """(count or 1, parameters): those of the helicopter but for the given ones; the extremes of
    each must make a possible helicopter.
    """
    p = np.tile(heli.parameters.array, (count if any(v.ndim for v in values.values()) else 1, 1))
    for name, value in values.items():
        frozen(value, name, (count,) if value.ndim else ())
        if name.startswith("controls."):
            raise InputError(
                f"{name} is not part of the equations: limit the inputs, or the travel of the"
                " feedback"
            )
        for extreme in (value.min(), value.max()):
            heli.with_parameters({name: float(extreme)})
        p[:, heli.parameters.signals.index(name)] = value  # type: ignore[arg-type]
    return p


def _checked(x0: Array, u: Array, wind: Array, p: Array, dt: float) -> Problem:
    if not (math.isfinite(dt) and dt > 0):
        raise InputError(f"dt must be a positive number of seconds, got {dt}")
    if not u.shape[1]:
        raise InputError("u has no samples: expected (n, 4) with n >= 1")
    if wind.shape[1] not in (1, u.shape[1]):
        raise InputError(
            f"wind: expected 3 numbers or {u.shape[1]} samples as u has, got {wind.shape[1]}"
        )
    for name, array, shape in (
        ("u", u, (None, None, 4)),
        ("wind", wind, (None, None, 3)),
        ("x0", x0, (None, None)),
    ):
        _finite(array, name, shape)
    norm = np.linalg.norm(x0[:, 6:10], axis=1)
    if np.abs(norm - 1).max() > 1e-6:
        k = int(np.abs(norm - 1).argmax())
        raise InputError(
            f"x0: the quaternion q0 q1 q2 q3 of flight {k} has length {norm[k]:.6g}, expected 1"
        )
    x0 = x0.copy()
    x0[:, 6:10] /= norm[:, None]
    u, wind, p = (np.ascontiguousarray(a, float) for a in (u, wind, p))
    return Problem(x0, u, wind, p, float(dt))


def _finite(array: Array, name: str, shape: tuple[int | None, ...]) -> None:
    """Raises where the shape is wrong or a number is missing, without a copy of a large array."""
    wrong = array.ndim != len(shape) or any(
        want not in (None, got) for want, got in zip(shape, array.shape, strict=False)
    )
    if wrong or not np.isfinite(array).all():
        frozen(array, name, shape)


def _start(heli: Helicopter, x0: object) -> Array:
    """(nx,) or (N, nx) in quaternion form; the Euler form is flown heading north from the
    origin.
    """
    if isinstance(x0, TrimPoint):
        if x0.x.signals != heli.states:
            raise InputError(
                f"the trim point has states {', '.join(x0.x.signals)}, the helicopter"
                f" {', '.join(heli.states)}"
            )
        x0 = x0.x.array
    x = np.asarray(x0, float)
    long, short = len(heli.flight_states), len(heli.states)
    if x.ndim not in (1, 2) or x.shape[-1] not in (long, short):
        raise InputError(
            f"x0: expected {long} states in quaternion form or {short} in Euler form, got shape"
            f" {x.shape}"
        )
    return x if x.shape[-1] == long else flight_state(x)


def _wind(wind: object) -> Array:
    w = np.asarray(wind, float)
    return w.reshape((1,) * (3 - w.ndim) + w.shape) if 1 <= w.ndim <= 3 else frozen(w, "wind", (3,))
