"""Equilibria by the hundred."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, overload

import numpy as np

from symheli.errors import InputError
from symheli.helicopter import Helicopter
from symheli.progress import tracked
from symheli.steady.equations import SIDE_BY_SIDE, steady_equations
from symheli.steady.equilibrium import (
    Equilibrium,
    TrimPoint,
    in_vortex_ring,
    on_stops,
    stops,
)
from symheli.steady.flight_condition import FlightCondition
from symheli.steady.flight_conditions import FlightConditions
from symheli.steady.newton import TOLERANCE
from symheli.steady.steady_flights import ALONE, SteadyFlights
from symheli.steady.validity import Validity, in_a_ring, warn
from symheli.values.arrays import Array, frozen
from symheli.values.html_table import as_table
from symheli.values.named_vector import NamedVector
from symheli.values.operating_points import OperatingPoints
from symheli.values.signal import Signal, indices
from symheli.values.summary import summarized


@dataclass(frozen=True, eq=False)
class TrimBatch(OperatingPoints):
    """N trims as arrays; found[k] is one of them as a `TrimPoint`.

    Parameters
    ----------
    conditions : FlightConditions
        The required flights.
    states, inputs, winds : tuple of Signal
        Names and units of what the arrays hold.
    x, u, xdot, residual, wind : array (N, nx), (N, 4), (N, nx), (N, nx), (N, 3)
        As in `TrimPoint`.
    density : array (N,)
        Of the air, kg/m^3.
    on_stops : array (N, 4)
        Whether each input is at (to 0.1 %) or beyond its travel, bool.
    vortex_ring : array (N,)
        Whether a rotor is where momentum theory promises no accuracy, bool.
    switches : mapping
        Each switching function by name (N,).
    torque : array (N,)
        Of the engine, N m.

    Raises
    ------
    InputError
        Other shapes, numbers that are not finite, flags that are no truth values.

    Examples
    --------
    >>> found = symheli.steady.trim_batch(heli, np.linspace(2.0, 8.0, 50), acceleration=1.0)
    >>> found.x.shape, bool(found.success.all()), found[49].airspeed
    ((50, 10), True, 8.0)
    """

    conditions: FlightConditions
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    winds: tuple[Signal, ...]
    x: Array
    u: Array
    xdot: Array
    residual: Array
    wind: Array
    density: Array
    on_stops: Array
    vortex_ring: Array
    switches: Mapping[str, Array]
    torque: Array
    _made: dict[int, TrimPoint] = field(default_factory=dict, init=False, repr=False)

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        n, nx = len(self.conditions), len(self.states)
        widths = {"x": nx, "u": len(self.inputs), "xdot": nx, "residual": nx}
        shapes = {name: (n, width) for name, width in widths.items()}
        shapes |= {"wind": (n, len(self.winds)), "density": (n,), "torque": (n,)}
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen(getattr(self, name), name, shape))
        for name in ("on_stops", "vortex_ring"):
            if getattr(self, name).dtype != bool:
                raise InputError(f"{name}: expected truth values, got {getattr(self, name).dtype}")
        for array in (*vars(self).values(), *self.switches.values()):
            if isinstance(array, np.ndarray):
                array.flags.writeable = False

    @property
    def success(self) -> Array:
        """Whether every residual, recomputed, is below `TOLERANCE` (N,), bool."""
        return np.all(np.abs(self.residual) < TOLERANCE, axis=1)

    @property
    def attainable(self) -> Array:
        """Whether these are equilibria with every control within its travel (N,), bool."""
        return self.success & ~self.on_stops.any(axis=1)

    def __len__(self) -> int:
        return len(self.x)

    @overload
    def __getitem__(self, k: int) -> TrimPoint: ...
    @overload
    def __getitem__(self, k: slice | Array) -> TrimBatch: ...
    def __getitem__(self, k: int | slice | Array) -> TrimPoint | TrimBatch:
        """The trim at a position, or those of a slice, a mask (N,) or positions."""
        if isinstance(k, slice | np.ndarray):
            names = ("x", "u", "xdot", "residual", "wind", "density", "on_stops", "vortex_ring")
            chosen = {name: getattr(self, name)[k] for name in (*names, "torque")}
            switches = {name: values[k] for name, values in self.switches.items()}
            return replace(self, conditions=self.conditions[k], switches=switches, **chosen)
        k = range(len(self))[k]
        if k not in self._made:
            self._made[k] = self._point(k)
        return self._made[k]

    def state(self, names: Sequence[str]) -> Array:
        """These states (N, n)."""
        return self.x[:, indices(names, self.states, "state")]

    def rate(self, names: Sequence[str]) -> Array:
        """Derivatives of these states (N, n)."""
        return self.xdot[:, indices(names, self.states, "state")]

    def input(self, names: Sequence[str]) -> Array:
        """These inputs (N, n), 0 where none has that name (a gust)."""
        out = np.zeros((len(self), len(names)))
        known = [k for k, name in enumerate(names) if name in self.inputs]
        out[:, known] = self.u[:, indices([names[k] for k in known], self.inputs, "input")]
        return out

    def _point(self, k: int) -> TrimPoint:
        condition = self.conditions[k]
        return TrimPoint(
            x=NamedVector(self.states, self.x[k]),
            u=NamedVector(self.inputs, self.u[k]),
            xdot=NamedVector(self.states, self.xdot[k]),
            airspeed=condition.airspeed,
            condition=condition,
            residual=NamedVector(self.states, self.residual[k]),
            wind=NamedVector(self.winds, self.wind[k]),
            on_stops=stops(self.inputs, self.on_stops[k]),
            vortex_ring=bool(self.vortex_ring[k]),
            density=float(self.density[k]),
        )


def trim_batch(
    heli: Helicopter,
    airspeed: Any,
    *,
    climb_rate: Any = 0.0,
    turn_rate: Any = 0.0,
    sideslip: Any = 0.0,
    wind: Any = (0.0, 0.0, 0.0),
    acceleration: Any = 0.0,
    altitude: float | None = None,
    start: TrimPoint | TrimBatch | None = None,
    throw: bool = True,
    continuation: bool = True,
) -> TrimBatch:
    """Trim at N flight conditions, vectorised and in parallel over the cores.

    What follows one another should be near: where no start is given each trim is started from one
    of the eight before it. Those that Newton's method does not find are searched as `trim` does,
    from the nearest found. Every trim is judged as there, and is the same whatever is computed
    beside it.

    Parameters
    ----------
    heli : Helicopter
        The model.
    airspeed, climb_rate, turn_rate, sideslip, acceleration : array (N,)
        As in `FlightCondition`; a number is one for all.
    wind : array (N, 3)
        m/s; (3,) is one for all.
    altitude : float, optional
        m, one for all.
    start : TrimPoint or TrimBatch, optional
        One point to start the first from, or N to start each from.
    throw : bool
        False: points that are no equilibria are returned, not raised.
    continuation : bool
        Whether to go on from hover and other guesses where Newton fails.

    Returns
    -------
    TrimBatch
        N points as arrays, and one by one.

    Raises
    ------
    TrimError
        No equilibrium was found; its `result` is the best point of the first that failed.
    InputError
        An invalid flight condition, or lengths that differ.

    Warns
    -----
    ValidityWarning
        The equations are not known to hold at all of them, once for all.

    Examples
    --------
    >>> found = symheli.steady.trim_batch(heli, [4.0, 5.0, 6.0], climb_rate=[0.0, 0.5, 1.0])
    >>> bool(found.success.all()), round(found[1].u["d_col"], 3)
    (True, 0.092)
    """
    conditions = FlightConditions(
        airspeed, climb_rate, turn_rate, sideslip, wind, acceleration, altitude
    )
    heli = heli if altitude is None else heli.at_altitude(altitude)
    flights = SteadyFlights.of(heli, conditions)
    z = hover(flights) if start is None else unknowns(heli, start)
    if z.ndim == 2 and len(z) != len(flights):
        raise InputError(f"expected a start for each of {len(flights)} conditions, got {len(z)}")
    after = ALONE if isinstance(start, TrimBatch) else one_after_another(len(flights))
    found = trimmed(flights, z, after, throw, continuation)
    warn_of_trims(flights, found)
    return found


def warn_of_trims(flights: SteadyFlights, trims: TrimBatch, ring: bool = True) -> None:
    """Give one `ValidityWarning` for trims outside the validity range of the equations; `ring`:
    also for rotors in a vortex ring.
    """
    validity, velocity = Validity(flights.helis[0], flights.parameters), trims.x[:, :3] - trims.wind

    def where(k: int) -> str:
        return f"at {trims.conditions[k]}"

    found = validity.beyond(where, velocity)
    warn(found + in_a_ring(where, trims.vortex_ring) if ring else found)


def one_after_another(count: int) -> Array:
    """Return the trim from which each is started (count,): the last of those computed before, as
    many side by side as there is room for.
    """
    lanes = SIDE_BY_SIDE.lanes
    k = np.arange(count)
    return np.where(k > 0, (k - 1) // lanes * lanes, ALONE)


def hover(flights: SteadyFlights) -> Array:
    """Unknowns of a hover for each (N, nz)."""
    guesses = [Equilibrium(heli, FlightCondition(0.0)).guess() for heli in flights.helis]
    return np.stack(guesses)[flights.which]


def unknowns(heli: Helicopter, start: TrimPoint | TrimBatch) -> Array:
    """Unknowns of a point of this helicopter (nz,), or of many (N, nz)."""
    many = isinstance(start, TrimBatch)
    given = start.states if many else start.x.signals
    if given != heli.states:
        raise InputError(
            f"the start has states {', '.join(given)}, the helicopter {', '.join(heli.states)}:"
            " trim this helicopter"
        )
    x, u = (start.x, start.u) if many else (start.x.array, start.u.array)
    return np.concatenate([x[..., steady_equations(heli).free], u], axis=-1)


def trimmed(
    flights: SteadyFlights,
    z: Array,
    after: Array | int,
    throw: bool = True,
    continuation: bool = True,
) -> TrimBatch:
    """The trims of these flights from starts z (N, nz) or (nz,), each after another as
    `SteadyFlights.solved` has it.
    """
    z, miss = flights.solved(np.broadcast_to(z, (len(flights), z.shape[-1])), after)
    demand = flights.conditions.demand
    for k in tracked("searching harder", np.flatnonzero(~(miss < TOLERANCE)).tolist()):
        alone = Equilibrium(flights.heli(k), flights.conditions[k])
        others = np.flatnonzero(miss < TOLERANCE)
        if len(others):
            apart = np.linalg.norm(demand[others] - demand[k], axis=1)
            z[k] = z[others[apart.argmin()]]
        z[k] = alone.search(z[k], continuation)
        miss[k] = alone.miss(z[k])
        if throw and not miss[k] < TOLERANCE:
            break
    found = _described(flights, z)
    if throw and not found.success.all():
        first = int(found.success.argmin())
        raise Equilibrium(flights.heli(first), flights.conditions[first]).failure(z[first])
    return found


def _described(flights: SteadyFlights, z: Array) -> TrimBatch:
    equations, heli, points = flights.equations, flights.helis[0], flights.points(z)
    u = np.ascontiguousarray(z[:, len(equations.free) :])
    travel = np.stack([heli.travel for heli in flights.helis])[flights.which]
    return TrimBatch(
        flights.conditions,
        heli.states,
        heli.inputs,
        heli.wind,
        points.x,
        u,
        points.xdot,
        points.residual,
        points.wind,
        np.array([heli.density for heli in flights.helis])[flights.which],
        on_stops(u, travel),
        in_vortex_ring(points.switches, equations.switches),
        dict(zip(equations.switches, points.switches.T, strict=True)),
        points.torque[:, 0],
    )
