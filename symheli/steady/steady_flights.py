"""Many steady flights at once: solved, evaluated and linearized in machine code, or one by one in
CasADi's virtual machine where there is no compiler.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from symheli.helicopter import Helicopter
from symheli.progress import task, tracked
from symheli.steady.equations import SteadyEquations, numeric, steady_equations
from symheli.steady.equilibrium import Equilibrium
from symheli.steady.flight_conditions import FlightConditions
from symheli.steady.newton import ROUNDING, STEPS, TOLERANCE
from symheli.values.arrays import Array

AT_ONCE = 4096
"""So many flights are computed before an interrupt is heard: some hundredths of a second."""
ALONE = -1
"""In place of the flight before: from its own start."""


@dataclass(frozen=True, eq=False)
class Points:
    """Quantities at N points: state and its derivative (N, nx), wind in body axes (N, 3), residuals
    (N, nx), switching functions (N, ns) and the torque of the engine (N, 1), SI.
    """

    x: Array
    wind: Array
    xdot: Array
    residual: Array
    switches: Array
    torque: Array


@dataclass(frozen=True, eq=False)
class SteadyFlights:
    """N flight conditions, each of one of a few helicopters that share their equations; `which`
    (N,) counts them.
    """

    helis: Sequence[Helicopter]
    which: Array
    conditions: FlightConditions

    @classmethod
    def of(cls, heli: Helicopter, conditions: FlightConditions) -> SteadyFlights:
        """Return the flights of one helicopter."""
        return cls([heli], np.zeros(len(conditions), int), conditions)

    @cached_property
    def equations(self) -> SteadyEquations:
        """Equations that they share."""
        return steady_equations(self.helis[0])

    @cached_property
    def _demand(self) -> Array:
        return np.ascontiguousarray(self.conditions.demand)

    @cached_property
    def parameters(self) -> Array:
        """Values of `Helicopter.parameters`, a row for each flight, or one for all."""
        rows = np.stack([heli.parameters.array for heli in self.helis])
        return rows if len(rows) == 1 else rows[self.which]

    def __len__(self) -> int:
        return len(self.conditions)

    def heli(self, k: int) -> Helicopter:
        """The helicopter of flight k."""
        return self.helis[self.which[k]]

    def __getitem__(self, which: Array) -> SteadyFlights:
        """Return the flights at these positions."""
        return SteadyFlights(self.helis, self.which[which], self.conditions[which])

    def solved(self, starts: Array, after: Array | int) -> tuple[Array, Array]:
        """Newton's method in each flight: unknowns (N, nz) and largest residuals (N,).

        after (N,): an earlier flight whose solution is the start (where that was not found, the one
        which that was after), or `ALONE`: the flight's own row of `starts` (N, nz).
        """
        z, miss = np.array(starts, float), np.full(len(self), np.nan)
        after = np.array(np.broadcast_to(after, len(self)), ctypes.c_long)
        code = self.equations.machine_code
        if code is None:
            for k in tracked("trimming", range(len(self))):
                alone = Equilibrium(self.heli(k), self.conditions[k])
                start = after[k]
                while start != ALONE and not miss[start] < TOLERANCE:
                    start = after[start]
                z[k], miss[k] = alone.newton(z[k if start == ALONE else start])
            return z, miss
        with task("trimming", len(self)) as trimming:
            for part in self._parts():
                code.trims(
                    ctypes.c_long(part.start),
                    ctypes.c_long(part.stop),
                    _at(after),
                    _at(self._demand),
                    *self._shared(),
                    _at(z),
                    _at(miss),
                    ctypes.c_long(STEPS),
                    ctypes.c_double(ROUNDING),
                    ctypes.c_double(TOLERANCE),
                )
                trimming.to(part.stop)
        return z, miss

    def points(self, z: Array) -> Points:
        """The points at these unknowns (N, nz)."""
        nx, ns = len(self.equations.dynamics.states), len(self.equations.switches)
        made = Points(*(np.empty((len(self), size)) for size in (nx, 3, nx, nx, ns, 1)))
        code, rows = self.equations.machine_code, list(vars(made).values())
        if code is None:
            for k in range(len(self)):
                found = numeric(self.heli(k), "point")(z[k], self._demand[k])
                for row, value in zip(rows, found, strict=True):
                    row[k] = value
            return made
        z = np.ascontiguousarray(z, float)
        for part in self._parts():
            own = [_at(array[part]) for array in (z, self._demand)]
            code.points(_length(part), *own, *self._shared(part), *(_at(row[part]) for row in rows))
        return made

    def slopes(self, x: Array, u: Array, wind: Array) -> tuple[Array, Array, Array]:
        """A (N, nx, nx), B (N, nx, 4), E (N, nx, 3) of the Euler form at these points."""
        n, nx = len(self), x.shape[1]
        made = (np.empty((n, nx, nx)), np.empty((n, nx, 4)), np.empty((n, nx, 3)))
        code = self.equations.machine_code
        if code is None:
            for k in range(n):
                found = numeric(self.heli(k), "slopes")(x[k], u[k], wind[k])
                for row, value in zip(made, found, strict=True):
                    row[k] = value.reshape(row.shape[1:])
            return made
        given = [np.ascontiguousarray(a, float) for a in (x, u, wind)]
        for part in self._parts():
            own, out = ([_at(array[part]) for array in arrays] for arrays in (given, made))
            code.slopes(_length(part), *own, *self._shared(part), *out)
        return made

    def _parts(self) -> Iterator[slice]:
        for begin in range(0, len(self), AT_ONCE):
            yield slice(begin, min(begin + AT_ONCE, len(self)))

    def _shared(self, part: slice = slice(0, 0)) -> tuple[ctypes.c_void_p, ctypes.c_long]:
        """Return the parameters from the first flight of a part on, and their stride."""
        if len(self.parameters) == 1:
            return _at(self.parameters), ctypes.c_long(0)
        return _at(self.parameters[part.start :]), ctypes.c_long(self.parameters.shape[1])


def _length(part: slice) -> ctypes.c_long:
    return ctypes.c_long(part.stop - part.start)


def _at(array: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
