"""Whether flights stay where the equations of the helicopter are known to hold."""

from __future__ import annotations

import numpy as np

from symheli.helicopter import Helicopter
from symheli.integrate.problem import Problem
from symheli.physics.rigid_body import body_to_earth
from symheli.steady.validity import Validity, in_a_ring, warn
from symheli.values.arrays import Array

AT_ONCE = 65_536
"""So many states are judged at a time: their copies take some megabytes."""


def warn_of_flights(heli: Helicopter, problem: Problem, states: Array, every: int = 1) -> None:
    """Give one `ValidityWarning` where flights leave the validity range of the equations, judged at
    the stored states (N, kept, nx), every `every`-th of the problem up to its last.
    """
    own = len(problem.p) == 1 and np.array_equal(problem.p[0], heli.parameters.array)
    validity = Validity.of(heli) if own else Validity(heli, problem.p)
    if _harmless(validity, states, problem.wind):
        warn(validity.in_hover())
        return
    count, kept = states.shape[:2]
    samples = every * np.arange(problem.samples // every + 1)[-kept:]
    fastest, velocity = np.zeros(count, int), np.zeros((count, 3))
    sinking, ring = np.zeros(count, int), np.zeros(count, bool)
    for first in range(0, count, max(AT_ONCE // kept, 1)):
        part = slice(first, first + max(AT_ONCE // kept, 1))
        air = _through_the_air(states[part], _of(problem.wind, part), samples)
        fastest[part] = k = np.hypot(air[..., 0], air[..., 1]).argmax(axis=1)
        velocity[part] = air[np.arange(len(k)), k]
        inside = Validity(heli, _of(problem.p, part)).in_vortex_ring(air)
        sinking[part], ring[part] = inside.argmax(axis=1), inside.any(axis=1)

    def after(flight: int, sample: int) -> str:
        named = f" of flight {flight}" if count > 1 else ""
        return f"after {problem.dt * samples[sample]:.4g} s{named}"

    def where(flight: int) -> str:
        speed = np.linalg.norm(velocity[flight])
        return f"at {speed:.4g} m/s {after(flight, fastest[flight])}"

    found = validity.beyond(where, velocity)
    warn(found + in_a_ring(lambda flight: after(flight, sinking[flight]), ring))


def _harmless(validity: Validity, states: Array, wind: Array) -> bool:
    """Whether no velocity can be too much, by the extremes of states and wind alone."""
    speed, sinking = validity.harmless
    blowing = float(np.linalg.norm([abs(wind[..., i]).max() for i in range(3)]))
    largest = [max(states[..., i].max(), -states[..., i].min()) for i in range(3)]
    return bool(
        float(np.linalg.norm(largest)) + blowing < speed
        and states[..., 2].max() + blowing < sinking
    )


def _of(array: Array, part: slice) -> Array:
    """Rows of these flights, or the one that all share."""
    return array[part] if len(array) > 1 else array


def _through_the_air(states: Array, wind: Array, samples: Array) -> Array:
    """Velocities (n, kept, 3), body axes, m/s; 0 where a flight has left the range of numbers."""
    held = np.minimum(samples, wind.shape[1] - 1)
    north_east_down = np.moveaxis(wind[:, held], 2, 0)
    with np.errstate(all="ignore"):
        rotation = body_to_earth(*np.moveaxis(states[..., 6:10], 2, 0))
        blown = [
            sum(row[i] * w for row, w in zip(rotation, north_east_down, strict=True))
            for i in range(3)
        ]
        air = states[..., :3] - np.stack(np.broadcast_arrays(*blown), axis=-1)
    return np.where(np.isfinite(air).all(axis=-1, keepdims=True), air, 0.0)
