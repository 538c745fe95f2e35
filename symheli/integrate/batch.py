"""Thousands of flights at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from symheli.codegen.compile import compiler
from symheli.errors import InputError
from symheli.helicopter import Helicopter
from symheli.integrate.equations import equations
from symheli.integrate.feedback import Feedback
from symheli.integrate.problem import many_flights
from symheli.integrate.rk4 import IntegratedFlights, RungeKutta4
from symheli.integrate.side_by_side import SIDE_BY_SIDE, over_the_cores, workers_of
from symheli.integrate.validity import warn_of_flights
from symheli.values.arrays import Array
from symheli.values.signal import Signal, indices
from symheli.values.summary import summarized

CHUNK, CHUNK_IN_NUMPY = 64, 512
"""Flights a worker takes at a time; in NumPy so many that the arrays of one stage still fit the
cache.
"""


@dataclass(frozen=True, eq=False)
class Batch:
    """Trajectories of N flights; found["q"] is one state of all flights (N, kept).

    Parameters
    ----------
    times : array (kept,)
        s.
    states : array (N, kept, nx)
        Quaternion form, SI.
    signals : tuple of Signal
        nx names.
    inputs : array (N, kept, 4), optional
        Used then, with feedback, rad.

    Examples
    --------
    >>> point = symheli.trim(heli, airspeed=5.0)
    >>> x0 = np.tile(point.x.array, (2, 1))
    >>> inputs = np.tile(point.u.array, (20, 1))
    >>> found = symheli.integrate.simulate_batch(heli, x0, inputs, dt=0.02, keep=5)
    >>> found.states.shape, len(found)
    ((2, 5, 15), 2)
    """

    times: Array
    states: Array
    signals: tuple[Signal, ...]
    inputs: Array | None = None

    __repr__ = summarized

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, name: str) -> Array:
        """One state of every flight (N, kept), by its name."""
        return self.states[:, :, indices([name], self.signals, "signal")[0]]

    @property
    def final(self) -> Array:
        """State of every flight at the end (N, nx)."""
        return self.states[:, -1]

    @property
    def lost(self) -> Array:
        """Mask (N,) of the flights whose states became NaN or infinite."""
        return np.logical_not(np.isfinite(self.final).all(axis=1))


def simulate_batch(
    heli: Helicopter,
    x0: object,
    u: object,
    wind: object = (0.0, 0.0, 0.0),
    *,
    dt: float,
    method: RungeKutta4 | None = None,
    parameters: Mapping[str, object] | None = None,
    feedback: Feedback | None = None,
    keep: Literal["final"] | int = "final",
    workers: int | None = None,
) -> Batch:
    """Simulate N flights by the classical Runge-Kutta method, vectorised and in parallel over the
    cores.

    A flight comes out the same to the bit whatever its neighbours, the number of workers and, where
    there are fused multiply-adds, the processor. Without a compiler or without them it differs by
    rounding: below 1e-9 of its size after 40 s of a stable flight.

    Memory: the arrays given and the result, (N, kept, nx) doubles. Ctrl-C stops within a sample and
    raises `KeyboardInterrupt`.

    Parameters
    ----------
    heli : Helicopter
        The model.
    x0 : array (N, nx) or (nx,)
        One for all, in quaternion or Euler form (then heading north from the origin).
    u : array (n, 4) or (N, n, 4)
        rad, each held for `dt`.
    wind : array (3,), (n, 3), (N, n, 3) or (N, 1, 3)
        North east down, m/s.
    dt : float
        s.
    method : RungeKutta4, optional
        With its step.
    parameters : mapping, optional
        {"body.mass": (N,), "density": ...} or a number for all, SI, in place of those of the
        helicopter.
    feedback : Feedback, optional
        Added at every sample, shared by all flights.
    keep : "final" or int
        Only the last state, or every k-th sample from the start on.
    workers : int, optional
        Threads; default the cores this process may use.

    Returns
    -------
    Batch
        States (N, kept, nx), and which flights were lost.

    Raises
    ------
    InputError
        Something does not fit.

    Warns
    -----
    ValidityWarning
        Flights leave what the equations are known to hold for, judged at the states that are kept.

    Examples
    --------
    >>> point = symheli.trim(heli, airspeed=5.0)
    >>> x0 = np.tile(point.x.array, (3, 1))
    >>> x0[:, 6] += [0.0, 0.1, 0.2]  # phi
    >>> found = symheli.integrate.simulate_batch(heli, x0, np.tile(point.u.array, (25, 1)), dt=0.02)
    >>> found.final.shape, bool(found.lost.any())
    ((3, 15), False)
    """
    problem = many_flights(heli, x0, u, wind, dt, parameters or {})
    if keep != "final" and not (isinstance(keep, int) and 1 <= keep <= problem.samples):
        raise InputError(
            f'keep must be "final" or a number of samples from 1 to {problem.samples}, got {keep!r}'
        )
    threads = workers_of(workers)
    if feedback is not None:
        feedback.check(heli, problem.samples)
    every = problem.samples if keep == "final" else keep
    flights = IntegratedFlights(
        equations(heli),
        problem,
        method or RungeKutta4(),
        feedback,
        every,
        keep == "final",
        SIDE_BY_SIDE,
    )
    chunk, count = CHUNK if compiler() else CHUNK_IN_NUMPY, problem.count
    chunks = [(first, min(first + chunk, count)) for first in range(0, count, chunk)]
    for _ in over_the_cores(lambda c: flights.run(*c), chunks, threads, flights.stop):
        pass
    warn_of_flights(heli, problem, flights.states, every)
    slots = np.arange(flights.states.shape[1]) + flights.skip_start
    return Batch(dt * every * slots, flights.states, heli.flight_states, flights.inputs)
