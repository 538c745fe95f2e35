"""Equilibria: the attitude, flapping and controls that hold a steady flight condition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from symheli.codegen.numeric import Numeric
from symheli.errors import TrimError
from symheli.helicopter import Helicopter, require
from symheli.steady.equations import numeric, steady_equations
from symheli.steady.flight_condition import FlightCondition
from symheli.steady.newton import TOLERANCE, newton
from symheli.steady.validity import Validity, in_a_ring, warn
from symheli.values.aligned import columns, vector
from symheli.values.arrays import Array
from symheli.values.drawing import GREY, LINE, axes_of, plain
from symheli.values.html_table import as_table
from symheli.values.named_vector import NamedVector
from symheli.values.operating_point import OperatingPoint
from symheli.values.signal import Signal, rates
from symheli.values.summary import summarized

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, kw_only=True)
class TrimPoint(OperatingPoint):
    """An operating point with its flight condition and the residuals of the trim.

    Parameters
    ----------
    x, u, xdot : NamedVector
        State, input and derivative of the state, SI and radians.
    airspeed : float
        m/s.
    condition : FlightCondition
        The required flight.
    residual : NamedVector
        Of every equation by state name, in the unit of its derivative.
    wind : NamedVector
        Body axes, m/s.
    on_stops : tuple of str
        Inputs at (to 0.1 %) or beyond their travel.
    vortex_ring : bool
        A rotor is where momentum theory promises no accuracy.
    density : float
        Of the air, kg/m^3.

    Examples
    --------
    >>> point = symheli.trim(heli, airspeed=5.0)
    >>> point.success, point.attainable, point.vortex_ring
    (True, True, False)
    """

    airspeed: float = field()  # type: ignore[assignment]  # a flight has one
    condition: FlightCondition
    residual: NamedVector
    wind: NamedVector
    on_stops: tuple[str, ...]
    vortex_ring: bool
    density: float

    __repr__ = summarized
    _repr_html_ = as_table

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw attitude, flapping and controls, those in radians, as bars in degrees."""
        angles = [
            (str(s), np.degrees(v))
            for vector in (self.x, self.u)
            for s, v in zip(vector.signals, vector.array, strict=True)
            if s.unit == "rad"
        ][::-1]
        ax = axes_of(ax, 6.0, 3.2)
        ax.barh([name for name, _ in angles], [v for _, v in angles], color=LINE)
        ax.axvline(0.0, color=GREY, linewidth=0.8)
        ax.set_xlabel("angle at trim (deg)")
        return plain(ax)

    @property
    def success(self) -> bool:
        """Every residual, recomputed, below `TOLERANCE`: an equilibrium of the equations, whatever
        deflection it takes.
        """
        return bool(np.all(np.abs(self.residual.array) < TOLERANCE))

    @property
    def attainable(self) -> bool:
        """An equilibrium with every control within its travel: one that can be flown."""
        return self.success and not self.on_stops

    @property
    def outcome(self) -> str:
        """In one line: whether it is trimmed, where, and what limits it."""
        worst = max(zip(np.abs(self.residual.array), self.residual.signals, strict=True))
        notes = [_stops(self)] if self.on_stops else []
        notes += ["vortex ring: no accuracy promised"] if self.vortex_ring else []
        status = "trimmed" if self.success else "NOT trimmed"
        return "; ".join(
            [
                f"{status} at {self.condition} (largest residual {worst[0]:.1e} in d{worst[1]}/dt)",
                *notes,
            ]
        )

    def __str__(self) -> str:
        rows = [["", "value", "unit", ""]]
        for title, found in (("states", self.x), ("inputs", self.u)):
            rows.append([title])
            rows += [["  " + name, *rest] for name, *rest in vector(found.array, found.signals)]
        return f"{self.outcome}\n{columns(rows)}"


def trim(
    heli: Helicopter,
    airspeed: float,
    *,
    climb_rate: float = 0.0,
    turn_rate: float = 0.0,
    sideslip: float = 0.0,
    wind: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    acceleration: float = 0.0,
    altitude: float | None = None,
    start: TrimPoint | None = None,
    throw: bool = True,
    continuation: bool = True,
) -> TrimPoint:
    """Find the controls and attitude of the steady flight at an airspeed.

    Newton's method with the exact Jacobian (MINPACK's hybrid method where that stalls); where that
    fails, by continuation from hover and from other guesses. Success is judged on the recomputed
    residual of every equation. A control beyond its travel is no failure (the equations hold;
    `on_stops` names it, `attainable` is False): what would be needed, and by how much, is worth
    knowing.

    Parameters
    ----------
    heli : Helicopter
        The model.
    airspeed, climb_rate, turn_rate, sideslip, wind, acceleration, altitude
        As in `FlightCondition`.
    start : TrimPoint, optional
        To start from; default a hover guess.
    throw : bool
        False: a point that is no equilibrium is returned, not raised.
    continuation : bool
        Whether to go on from hover and other guesses where Newton fails.

    Returns
    -------
    TrimPoint
        State, inputs and the residual of every equation.

    Raises
    ------
    TrimError
        No equilibrium was found; its `result` is the best point.
    InputError
        The flight condition is invalid.

    Warns
    -----
    ValidityWarning
        The equations are not known to hold there; see `symheli.steady.validity`.

    See Also
    --------
    symheli.trim_map : trims over airspeed and climb rate
    symheli.linearize : the exact linear model about a trim
    symheli.steady.trim_batch : many trims at once

    Examples
    --------
    >>> point = symheli.trim(heli, airspeed=5.0)
    >>> round(float(np.degrees(point.x["theta"])), 1), round(float(point.u["d_col"]), 3)
    (-1.2, 0.088)
    """
    require(heli, "trim(heli, airspeed=5.0)")
    condition = FlightCondition(
        airspeed,
        climb_rate=climb_rate,
        turn_rate=turn_rate,
        sideslip=sideslip,
        wind=wind,  # type: ignore[arg-type]
        acceleration=acceleration,
        altitude=altitude,
    )
    problem = Equilibrium(heli if altitude is None else heli.at_altitude(altitude), condition)
    z = problem.search(
        problem.guess() if start is None else problem.unknowns_of(start), continuation
    )
    best = problem.point(z)
    if throw and not best.success:
        raise problem.failure(z)
    warn_of_point(problem.heli, best)
    return best


def warn_of_point(heli: Helicopter, point: TrimPoint) -> None:
    """A `ValidityWarning` where the equations of the helicopter are not known to hold for it."""
    warn(_beyond(heli, point))


def _beyond(heli: Helicopter, point: TrimPoint) -> list[str]:
    """Return the validity limits that the point exceeds."""
    velocity = point.x.array[:3] - point.wind.array

    def where(_: int) -> str:
        return f"at {point.condition}"

    ring = np.array([point.vortex_ring])
    return Validity.of(heli).beyond(where, velocity[None]) + in_a_ring(where, ring)


def on_stops(u: Array, travel: Array) -> Array:
    """Whether each input (..., 4) is at (to 0.1 %) or beyond its travel (4,)."""
    return np.abs(u) >= 0.999 * travel


def stops(inputs: Sequence[Signal], on: Array) -> tuple[str, ...]:
    """Names of the inputs that are on their stops."""
    return tuple(str(s) for s, at in zip(inputs, on, strict=True) if at)


def in_vortex_ring(switches: Array, names: Sequence[str]) -> Array:
    """Whether a switching function (..., ns) shows that a rotor is in a vortex ring."""
    rings = [k for k, name in enumerate(names) if name.endswith("vortex ring")]
    return np.any(switches[..., rings] > 0, axis=-1)


def _stops(point: TrimPoint) -> str:
    return "at or beyond the stop: " + ", ".join(
        f"{name} = {point.u[name]:.3g} rad" for name in point.on_stops
    )


def _throttle(heli: Helicopter, point: TrimPoint) -> list[str]:
    """Return the state of the engine at a point that is no trim, in words."""
    if "om_i" not in point.x:
        return []
    throttle = heli.vehicle.values("drivetrain")["governor_ki"] * point.x["om_i"]
    if throttle >= 1:
        return ["full throttle: the engine lacks power"]
    return (
        ["throttle closed: the air drives the rotor, whose speed no governor holds"]
        if throttle <= 0
        else []
    )


class Equilibrium:
    """The search for one: unknowns z = phi theta a1 b1 (om_i) and the four inputs against the
    equations of motion.
    """

    def __init__(self, heli: Helicopter, condition: FlightCondition):
        self.heli, self.condition = heli, condition
        self.equations = steady_equations(heli)
        self.demand = condition.demand

    def guess(self) -> Array:
        """A hover, level but for the push of the tail rotor."""
        mass = self.heli.vehicle.sections["body"]["mass"].value
        start = {"phi": 0.07, "d_col": 0.1, "d_ped": 0.25}
        if "om_i" in self.heli.states:
            drivetrain = self.heli.vehicle.values("drivetrain")
            # throttle that holds about 130 W/kg of rotor and profile power, typical of a small
            # helicopter in hover
            start["om_i"] = (
                min(130.0 * mass / drivetrain["max_power"], 0.9) / drivetrain["governor_ki"]
            )
        return np.array([start.get(name, 0.0) for name in self.equations.unknowns])

    def other_guesses(self) -> list[Array]:
        """Return starting points away from hover: nose and bank to either side, the rotor loaded or
        windmilling.
        """
        guesses = []
        for phi, theta, d_col in (
            (0.07, -0.4, 0.15),
            (0.07, 0.4, 0.02),
            (0.6, 0.0, 0.12),
            (-0.6, 0.0, 0.12),
            (0.0, 0.0, -0.02),
        ):
            guess = self.guess()
            guess[[0, 1, -2]] = phi, theta, d_col
            guesses.append(guess)
        return guesses

    def unknowns_of(self, point: OperatingPoint) -> Array:
        """Return the unknowns of a point of this helicopter."""
        return np.concatenate([point.x.array[self.equations.free], point.u.array])

    def search(self, start: Array, continuation: bool = True) -> Array:
        """The unknowns of least residual that `trim` finds from `start`."""
        best = self.solve(start)
        if continuation and not self._found(best):
            best = min(best, self._continue_from_hover(), key=self.miss)
        if continuation and not self._found(best):
            best = min((best, *map(self.solve, self.other_guesses())), key=self.miss)
        if continuation and not self._found(best):
            inputs = best[len(self.equations.free) :]
            if np.any(np.abs(inputs) > 2 * self.heli.travel):
                best = self._within_travel()  # nobody learns from a blade pitch of several turns
        return best

    def solve(self, start: Array) -> Array:
        """Solve by Newton's method from `start`; by MINPACK's hybrid method where it stops
        descending, then Newton again.
        """
        z, miss = self.newton(start)
        if not miss < TOLERANCE:
            from scipy.optimize import root

            found = root(
                lambda z: self.system(z)[0][self.equations.balanced],
                start,
                jac=lambda z: self.system(z)[1],
                method="hybr",
                options={"xtol": 1e-14},
            )
            z = min((z, self.newton(found.x)[0]), key=self.miss)
        return z

    def newton(self, start: Array) -> tuple[Array, float]:
        """Newton's method alone: where it ends, and the largest residual there."""
        return newton(self.system, self.equations.balanced, start)

    def point(self, z: Array) -> TrimPoint:
        """Return all quantities at these unknowns."""
        heli, u = self.heli, z[len(self.equations.free) :]
        x, wind, xdot, residual, switches, _ = numeric(heli, "point")(z, self.demand)
        return TrimPoint(
            x=NamedVector(heli.states, x),
            u=NamedVector(heli.inputs, u),
            xdot=NamedVector(rates(heli.states), xdot),
            airspeed=self.condition.airspeed,
            condition=self.condition,
            residual=NamedVector(rates(heli.states), residual),
            wind=NamedVector(heli.wind, wind),
            on_stops=stops(heli.inputs, on_stops(u, heli.travel)),
            vortex_ring=bool(in_vortex_ring(switches, self.equations.switches)),
            density=heli.density,
        )

    def failure(self, z: Array) -> TrimError:
        """Return the residuals of the best point, at z, equation by equation, the largest first."""
        best = self.point(z)
        misses = sorted(
            zip(best.residual.array, best.residual.signals, strict=True),
            key=lambda miss: -abs(miss[0]),
        )
        table = ", ".join(f"d{s}/dt = {r:.2e} {s.unit}" for r, s in misses)
        causes = [
            f"no trim at {best.condition}: the best point leaves {table}",
            *([_stops(best)] if best.on_stops else []),
            *_throttle(self.heli, best),
            *self._jumps(z),
            *(f"and beyond validity, {one}" for one in _beyond(self.heli, best)),
        ]
        advice = "try a nearer condition as `start`, or throw=False for the best point"
        return TrimError("; ".join(causes), best, advice)

    def _jumps(self, z: Array) -> list[str]:
        """Jumps of the equations beside a point that is no trim: within 0.1 of the switch (m/s), as
        a trim would step across.
        """
        switches = numeric(self.heli, "point")(z, self.demand)[4]
        near = [
            name.partition("jump ")[2]
            for name, value in zip(self.equations.switches, switches, strict=True)
            if "jump " in name and abs(value) < 0.1
        ]
        return [f"the equations jump here, {name}: there may be no equilibrium" for name in near]

    def system(self, z: Array) -> tuple[Array, Array]:
        """Residual of every equation, and the derivative of the balanced ones."""
        residual, slopes = self._evaluate(z, self.demand)
        return residual, slopes.reshape(len(z), len(z))

    @cached_property
    def _evaluate(self) -> Numeric:
        return numeric(self.heli, "system")

    def miss(self, z: Array) -> float:
        """Largest residual; infinite where one is no number."""
        return float(np.nan_to_num(np.abs(self.system(z)[0]), nan=np.inf).max())

    def _found(self, z: Array) -> bool:
        return self.miss(z) < TOLERANCE

    def _continue_from_hover(self, steps: int = 12) -> Array:
        requested, z = self.condition, self.guess()
        for share in np.linspace(0.0, 1.0, steps + 1).tolist():
            stage = replace(
                requested,
                airspeed=share * requested.airspeed,
                climb_rate=share * requested.climb_rate,
                turn_rate=share * requested.turn_rate,
                wind=(
                    share * requested.wind[0],
                    share * requested.wind[1],
                    share * requested.wind[2],
                ),
                acceleration=share * requested.acceleration,
            )
            z = Equilibrium(self.heli, stage).solve(z)
        return z

    def _within_travel(self) -> Array:
        """The unknowns of least residual with controls in their travel and the attitude short of
        +-80 deg, from the hover guess.
        """
        from scipy.optimize import least_squares

        start, n = self.guess(), len(self.equations.free)
        bound = np.concatenate([np.full(2, 1.4), np.full(n - 2, np.inf), self.heli.travel])
        start = np.clip(start, -0.9 * bound, 0.9 * bound)
        return least_squares(
            lambda z: self.system(z)[0][self.equations.balanced],
            start,
            lambda z: self.system(z)[1],  # type: ignore[arg-type]
            bounds=(-bound, bound),
            max_nfev=200,
        ).x
