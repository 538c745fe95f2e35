"""Equilibria: the attitude, flapping and controls that hold a steady flight condition."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares, root

from symheli.errors import TrimError
from symheli.helicopter import Helicopter
from symheli.steady.flight_condition import FlightCondition
from symheli.values.named_vector import NamedVector
from symheli.values.operating_point import OperatingPoint
from symheli.values.signal import Signal
from symheli.values.units import quotient

TOLERANCE = 1e-9
"""Largest residual of any equation at a trim, in its SI unit."""
ROUNDING = 1e-13
"""Residual below which another Newton step would only move roundings of accelerations of the size
of gravity.
"""


@dataclass(frozen=True, kw_only=True)
class TrimPoint(OperatingPoint):
    """An operating point with the flight condition it answers and how well.

    Parameters
    ----------
    x, u, xdot : NamedVector
        State, input and derivative of the state, SI and radians.
    airspeed : float
        m/s.
    condition : FlightCondition
        What was asked.
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

    condition: FlightCondition
    residual: NamedVector
    wind: NamedVector
    on_stops: tuple[str, ...]
    vortex_ring: bool
    density: float

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

    def __str__(self) -> str:
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
    """Steady flight at an airspeed.

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
        A flight condition that is none.

    Examples
    --------
    >>> point = symheli.trim(heli, airspeed=5.0)
    >>> round(float(np.degrees(point.x["theta"])), 1), round(float(point.u["d_col"]), 3)
    (-1.2, 0.088)
    """
    condition = FlightCondition(
        float(airspeed),
        climb_rate=float(climb_rate),
        turn_rate=float(turn_rate),
        sideslip=float(sideslip),
        wind=(float(wind[0]), float(wind[1]), float(wind[2])),
        acceleration=float(acceleration),
        altitude=None if altitude is None else float(altitude),
    )
    heli = heli if altitude is None else heli.at_altitude(float(altitude))
    problem = _Problem(heli, condition)
    best = problem.solve(problem.guess() if start is None else problem.unknowns_of(start))
    if continuation and not best.success:
        best = min((best, _continue_from_hover(heli, condition)), key=_miss)
    if continuation and not best.success:
        best = min((best, *map(problem.solve, problem.other_guesses())), key=_miss)
    if continuation and not best.success and np.any(np.abs(best.u.array) > 2 * heli.travel):
        best = problem.within_travel()  # nobody learns from a blade pitch of several turns
    if throw and not best.success:
        raise TrimError(_failure(heli, best), best)
    return best


def _miss(point: TrimPoint) -> float:
    """Largest residual; infinite where one is no number."""
    return float(np.nan_to_num(np.abs(point.residual.array), nan=np.inf).max())


def _stops(point: TrimPoint) -> str:
    return "at or beyond the stop: " + ", ".join(
        f"{name} = {point.u[name]:.3g} rad" for name in point.on_stops
    )


def _failure(heli: Helicopter, best: TrimPoint) -> str:
    """What the best point misses, equation by equation, the worst first."""
    misses = sorted(
        zip(best.residual.array, best.residual.signals, strict=True), key=lambda miss: -abs(miss[0])
    )
    table = ", ".join(f"d{s}/dt = {r:.2e} {quotient(s.unit, 's')}" for r, s in misses)
    return "; ".join(
        [
            f"no trim at {best.condition}: the best point leaves {table}",
            *([_stops(best)] if best.on_stops else []),
            *_throttle(heli, best),
            *_jumps(heli, best),
            *(["in a vortex ring"] if best.vortex_ring else []),
            "try a nearer condition as `start`, or throw=False for the best point",
        ]
    )


def _throttle(heli: Helicopter, point: TrimPoint) -> list[str]:
    """What the engine says at a point that is no trim."""
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


def _jumps(heli: Helicopter, point: TrimPoint) -> list[str]:
    """Jumps of the equations beside a point that is no trim: within 0.1 of the switch (m/s), as a
    trim would step across.
    """
    switches = heli.switches(point.x.array, point.u.array, point.wind.array)
    near = [
        name.partition("jump ")[2]
        for name, value in switches.items()
        if "jump " in name and abs(value) < 0.1
    ]
    return [f"the equations jump here, {name}: there may be no equilibrium" for name in near]


def _continue_from_hover(
    heli: Helicopter, condition: FlightCondition, steps: int = 12
) -> TrimPoint:
    point: TrimPoint | None = None
    for share in np.linspace(0.0, 1.0, steps + 1):
        stage = FlightCondition(
            share * condition.airspeed,
            climb_rate=share * condition.climb_rate,
            turn_rate=share * condition.turn_rate,
            sideslip=condition.sideslip,
            wind=(share * condition.wind[0], share * condition.wind[1], share * condition.wind[2]),
            acceleration=share * condition.acceleration,
            altitude=condition.altitude,
        )
        problem = _Problem(heli, stage)
        point = problem.solve(problem.guess() if point is None else problem.unknowns_of(point))
    assert point is not None  # noqa: S101
    return point


class _Problem:
    """Unknowns phi theta a1 b1 (om_i) and the four inputs against the equations of motion."""

    def __init__(self, heli: Helicopter, condition: FlightCondition):
        self.heli, self.condition = heli, condition
        self.air, self.turn = condition.air_velocity, np.array([0.0, 0.0, condition.turn_rate])
        self.wind, self.push = (
            np.array(condition.wind),
            np.array([condition.acceleration, 0.0, 0.0]),
        )
        self.own = [s for s in heli.states[8:] if s != "Om"]
        self.equations = [i for i, s in enumerate(heli.states) if s not in ("phi", "theta", "om_i")]
        self.free = [heli.states.index(Signal(s)) for s in ("phi", "theta", *self.own)]

    def guess(self) -> np.ndarray:
        mass = self.heli.vehicle.sections["body"]["mass"].value
        start = dict.fromkeys((str(s) for s in self.own), 0.0)
        if "om_i" in start:
            drivetrain = self.heli.vehicle.values("drivetrain")
            # throttle that holds about 130 W/kg of rotor and profile power, typical of a small
            # helicopter in hover
            start["om_i"] = (
                min(130.0 * mass / drivetrain["max_power"], 0.9) / drivetrain["governor_ki"]
            )
        return np.array([0.07, 0.0, *start.values(), 0.0, 0.0, 0.1, 0.25])

    def other_guesses(self) -> list[np.ndarray]:
        """Starts away from hover: nose and bank to either side, the rotor working hard or
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

    def unknowns_of(self, point: TrimPoint) -> np.ndarray:
        return np.concatenate([point.x.array[self.free], point.u.array])

    def state(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Full state, input, and wind in body axes."""
        x = np.zeros(len(self.heli.states))
        x[self.free] = z[: len(self.free)]
        if "Om" in self.heli.states:
            x[self.heli.states.index(Signal("Om"))] = self.heli.nominal_speed
        R = _heading_to_body(z[0], z[1])
        wind = R @ self.wind
        x[:3] = R @ self.air + wind
        x[3:6] = R @ self.turn
        return x, z[len(self.free) :], wind

    def residual(self, z: np.ndarray) -> np.ndarray:
        xdot = self.heli.numeric("rhs")(*self.state(z))[0]
        xdot[:3] -= _heading_to_body(z[0], z[1]) @ self.push
        return xdot

    def jacobian(self, z: np.ndarray) -> np.ndarray:
        A, B, E = self.heli.numeric("jacobian")(*self.state(z))
        J = np.concatenate([A[:, self.free], B], axis=1)
        # the attitude also turns velocity, rates, wind and the demanded acceleration into body axes
        for column in (0, 1):
            dR = _heading_to_body(z[0], z[1], derivative=column)
            dwind = dR @ self.wind
            J[:, column] += (
                A[:, :3] @ (dR @ self.air + dwind) + A[:, 3:6] @ (dR @ self.turn) + E @ dwind
            )
            J[:3, column] -= dR @ self.push
        return J[self.equations]

    def solve(self, start: np.ndarray) -> TrimPoint:
        """Newton's method from `start`; MINPACK's hybrid method where it stops descending, then
        Newton again.
        """
        z = self.newton(start)
        if np.abs(self.residual(z)).max() >= TOLERANCE:
            found = root(
                lambda z: self.residual(z)[self.equations],
                start,
                jac=self.jacobian,
                method="hybr",
                options={"xtol": 1e-14},
            )
            z = min((z, self.newton(found.x)), key=lambda z: float(np.abs(self.residual(z)).max()))
        return self.point(z)

    def within_travel(self) -> TrimPoint:
        """The point of least residual with controls in their travel and the attitude short of +-80
        deg, from the hover guess.
        """
        start, n = self.guess(), len(self.free)
        bound = np.concatenate([np.full(2, 1.4), np.full(n - 2, np.inf), self.heli.travel])
        start = np.clip(start, -0.9 * bound, 0.9 * bound)
        found = least_squares(
            lambda z: self.residual(z)[self.equations],
            start,
            self.jacobian,  # type: ignore[arg-type]
            bounds=(-bound, bound),
            max_nfev=200,
        )
        return self.point(found.x)

    def newton(self, z: np.ndarray, steps: int = 12) -> np.ndarray:
        """Full Newton steps while the largest residual falls."""
        residual = self.residual(z)
        for _ in range(steps):
            try:
                better = z - np.linalg.solve(self.jacobian(z), residual[self.equations])
            except np.linalg.LinAlgError:
                break
            left = (
                self.residual(better)
                if np.all(np.isfinite(better))
                else np.full_like(residual, np.inf)
            )
            if not np.abs(left).max() < np.abs(residual).max():
                break
            z, residual = better, left
            if np.abs(residual).max() < ROUNDING:
                break
        return z

    def point(self, z: np.ndarray) -> TrimPoint:
        heli = self.heli
        x, u, wind = self.state(z)
        xdot = heli.numeric("rhs")(x, u, wind)[0]
        switches = heli.switches(x, u, wind)
        return TrimPoint(
            x=NamedVector(heli.states, x),
            u=NamedVector(heli.inputs, u),
            xdot=NamedVector(heli.states, xdot),
            airspeed=self.condition.airspeed,
            condition=self.condition,
            residual=NamedVector(heli.states, self.residual(z)),
            wind=NamedVector(heli.wind, wind),
            on_stops=tuple(
                str(s)
                for s, value, limit in zip(heli.inputs, u, heli.travel, strict=True)
                if abs(value) >= 0.999 * limit
            ),
            vortex_ring=any(
                value > 0 for name, value in switches.items() if name.endswith("vortex ring")
            ),
            density=heli.density,
        )


def _heading_to_body(phi: float, theta: float, derivative: int | None = None) -> np.ndarray:
    """Rotation (3, 3) from forward-right-down axes of the heading to body axes; derivative 0: by
    phi, 1: by theta.
    """
    cp, sp, ct, st = math.cos(phi), math.sin(phi), math.cos(theta), math.sin(theta)
    if derivative == 0:
        return np.array([[0.0, 0.0, 0.0], [cp * st, -sp, cp * ct], [-sp * st, -cp, -sp * ct]])
    if derivative == 1:
        return np.array([[-st, 0.0, -ct], [sp * ct, 0.0, -sp * st], [cp * ct, 0.0, -cp * st]])
    return np.array([[ct, 0.0, -st], [sp * st, cp, sp * ct], [cp * st, -sp, cp * ct]])
