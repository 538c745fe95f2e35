"""Trims over airspeed and climb rate, and the region where momentum theory is invalid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, overload

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.helicopter import Helicopter
from symheli.steady.equilibrium import TrimPoint
from symheli.steady.flight_conditions import FlightConditions
from symheli.steady.steady_flights import SteadyFlights
from symheli.steady.trim_batch import hover, one_after_another, trimmed, warn_of_trims
from symheli.values.arrays import Array, frozen
from symheli.values.comma_separated import comma_separated
from symheli.values.html_table import as_table
from symheli.values.labelled import dataset, frame
from symheli.values.signal import Signal
from symheli.values.summary import summarized

POWER = Signal("power", "W")
OMEGA = Signal("Om")
AIRSPEED, CLIMB = Signal("airspeed"), Signal("climb_rate", "m/s")
FLAGS = ("success", "attainable", "vortex_ring")

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class TrimMap:
    """Trims at n airspeeds and m climb rates; map["theta"] is any state, input or "power" on the
    grid (n, m).

    Parameters
    ----------
    airspeeds : array (n,)
        Of the whole motion, m/s.
    climb_rates : array (m,)
        m/s, up.
    points : tuple of tuple of TrimPoint
        (n, m); None where the climb rate exceeds the airspeed.
    power : array (n, m)
        Engine torque times rotor speed, W; NaN where there is no point.

    Examples
    --------
    >>> found = symheli.trim_map(heli, [4.0, 8.0], [0.0, 2.0])
    >>> found["theta"].shape, bool((found.power[:, 1] > found.power[:, 0]).all())
    ((2, 2), True)
    """

    airspeeds: Array
    climb_rates: Array
    points: tuple[tuple[TrimPoint | None, ...], ...]
    power: Array

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        for name in ("airspeeds", "climb_rates"):
            object.__setattr__(self, name, _increasing(getattr(self, name), name))
        shape = (len(self.airspeeds), len(self.climb_rates))
        object.__setattr__(self, "power", frozen(self.power, "power", shape, finite=False))
        if len(self.points) != shape[0] or any(len(row) != shape[1] for row in self.points):
            raise InputError(
                f"expected points of shape {shape}, one for each airspeed and climb rate"
            )

    @property
    def success(self) -> Array:
        """Whether the equations hold (n, m), bool."""
        return self._flags("success")

    @property
    def attainable(self) -> Array:
        """Whether they hold with every control within its travel (n, m), bool."""
        return self._flags("attainable")

    @property
    def vortex_ring(self) -> Array:
        """Mask (n, m), bool, of the points at which a rotor is in the vortex-ring region, where
        momentum theory is invalid.
        """
        return self._flags("vortex_ring")

    @property
    def possible(self) -> Array:
        """Whether the airspeed is enough for the climb rate (n, m), bool."""
        return np.array([[point is not None for point in row] for row in self.points])

    @property
    def level_speeds(self) -> Array:
        """Horizontal part of the airspeed (n, m), m/s; NaN where the climb rate exceeds the
        airspeed.
        """
        square = self.airspeeds[:, None] ** 2 - self.climb_rates**2
        return np.sqrt(np.where(self.possible, np.maximum(square, 0.0), np.nan))

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Signals of the map: states, inputs, power, with their units."""
        point = next(point for row in self.points for point in row if point is not None)
        return (*point.x.signals, *point.u.signals, POWER)

    @overload
    def __getitem__(self, name: str) -> Array: ...
    @overload
    def __getitem__(self, name: tuple[int, int]) -> TrimPoint | None: ...
    def __getitem__(self, name: str | tuple[int, int]) -> Array | TrimPoint | None:
        """A state, input or "power" over the grid (n, m), NaN where the equations do not hold; by
        [i, j] the trim at airspeed i and climb rate j, None where the airspeed is less than that.
        """
        if isinstance(name, tuple):
            i, j = name
            return self.points[i][j]
        if name not in self.signals:
            raise UnknownNameError("signal", name, self.signals)
        if name == POWER:
            return np.where(self.success, self.power, np.nan)

        def value(point: TrimPoint | None) -> float:
            if point is None or not point.success:
                return np.nan
            return point.x[name] if name in point.x else point.u[name]

        return np.array([[value(point) for point in row] for row in self.points])

    def csv(self) -> str:
        """Return every signal and flag, one line for each possible grid point."""
        return comma_separated([*self._pairs(), *self._columns()])

    def plot(self, ax: Axes | None = None, quantity: str = "power") -> Axes:
        """`quantity` (a state, input or "power") at every trim over horizontal airspeed and climb
        rate; hatched: vortex ring; crosses: a control beyond its stop; gray: no trim. Returns the
        axes; raises `UnknownNameError`.
        """
        from symheli.steady.trim_map_plot import plot_trim_map

        return plot_trim_map(self, ax, quantity)

    def to_frame(self) -> pandas.DataFrame:
        """A row a pair of airspeed and climb rate (m/s) that is possible: every signal, and the
        flags success, attainable and vortex_ring; units in attrs["units"]. Raises `InputError`
        without pandas.
        """
        return frame(self._pairs(), self._columns())

    def to_xarray(self) -> xarray.Dataset:
        """Every signal and flag over "airspeed" and "climb_rate", NaN where there is no trim.
        Raises `InputError` without xarray.
        """
        over = str(AIRSPEED), str(CLIMB)
        variables = {
            **{str(s): (over, self[s], s.unit) for s in self.signals},
            **{flag: (over, getattr(self, flag), "1") for flag in FLAGS},
        }
        coordinates = {
            over[0]: (AIRSPEED, self.airspeeds),
            over[1]: (CLIMB, self.climb_rates),
        }
        return dataset(coordinates, variables)

    def _pairs(self) -> list[tuple[Signal, Array]]:
        """Airspeed and climb rate of every pair that is possible."""
        speeds, rates = np.meshgrid(self.airspeeds, self.climb_rates, indexing="ij")
        return [(AIRSPEED, speeds[self.possible]), (CLIMB, rates[self.possible])]

    def _columns(self) -> list[tuple[Signal, Array]]:
        """Every signal and flag there."""
        keep = self.possible
        signals = [(name, self[name][keep]) for name in self.signals]
        return signals + [(Signal(flag), getattr(self, flag)[keep]) for flag in FLAGS]

    def _flags(self, name: str) -> Array:
        return np.array(
            [[point is not None and getattr(point, name) for point in row] for row in self.points]
        )


def trim_map(
    heli: Helicopter, airspeeds: Sequence[float] | Array, climb_rates: Sequence[float] | Array
) -> TrimMap:
    """Trim at every pair of airspeed and climb rate, each started from neighbours already found.

    Failures are kept, not raised: see `success`, `attainable` and `vortex_ring` of the result.

    Parameters
    ----------
    heli : Helicopter
        The model.
    airspeeds : sequence of float
        Of the whole motion, increasing, m/s: straight down is climb_rate = -airspeed.
    climb_rates : sequence of float
        Increasing, m/s, up.

    Returns
    -------
    TrimMap
        With the power at each pair.

    Raises
    ------
    InputError
        Values that do not increase.

    Warns
    -----
    ValidityWarning
        The equations are not known to hold at all of them, once for all; the vortex ring is a flag
        of the result.

    See Also
    --------
    symheli.trim : one steady flight
    symheli.sweep : trims and linear models over airspeed

    Examples
    --------
    >>> found = symheli.trim_map(heli, [4.0, 8.0], [-2.0, 0.0])
    >>> bool(found.success.all()), int(found.vortex_ring.sum())
    (True, 0)
    """
    speeds, rates = _increasing(airspeeds, "airspeeds"), _increasing(climb_rates, "climb_rates")
    if not np.any(np.abs(rates) <= speeds[-1]):
        raise InputError("every climb rate exceeds the largest airspeed, which includes it")
    outwards = np.argsort(np.abs(rates), kind="stable")  # level flight first, the easiest to trim
    i, j = np.array(
        [(i, j) for j in outwards for i, speed in enumerate(speeds) if abs(rates[j]) <= speed]
    ).T
    conditions = FlightConditions(speeds[i], climb_rate=rates[j])
    flights = SteadyFlights.of(heli, conditions)
    found = trimmed(flights, hover(flights), _after_inner(i, j, outwards[0]), throw=False)
    warn_of_trims(flights, found, ring=False)
    points: list[list[TrimPoint | None]] = [[None] * len(rates) for _ in speeds]
    for point, *at in zip(found, i, j, strict=True):
        points[at[0]][at[1]] = point
    power = np.full((len(speeds), len(rates)), np.nan)
    power[i, j] = found.torque * (
        found.x[:, heli.states.index(OMEGA)] if OMEGA in heli.states else heli.nominal_speed
    )
    return TrimMap(speeds, rates, tuple(map(tuple, points)), power)


def _after_inner(i: Array, j: Array, inner: int) -> Array:
    """Return the trim from which each is started: those of the innermost climb rate one after
    another, the others from the next climb rate inwards.
    """
    at = {place: k for k, place in enumerate(zip(i.tolist(), j.tolist(), strict=True))}
    first = int(np.count_nonzero(j == inner))
    inwards = j + np.sign(inner - j)
    others = [at[place] for place in zip(i[first:].tolist(), inwards[first:].tolist(), strict=True)]
    return np.concatenate([one_after_another(first), others]).astype(int)


def _increasing(values: Sequence[float] | Array, name: str) -> Array:
    array = frozen(values, name, (None,))
    if len(array) == 0 or np.any(np.diff(array) <= 0):
        raise InputError(f"{name}: expected increasing numbers (m/s), got {array.tolist()}")
    return array
