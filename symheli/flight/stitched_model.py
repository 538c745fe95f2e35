"""Point linear models and trims stitched over airspeed, with the exact rigid body put back: the
field's usual comparator.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.bases import CubicSpline, PiecewiseLinear
from symheli.lpv.linear_family import LinearFamily
from symheli.physics.rigid_body import euler_rates, gravity_euler, rotation, translation
from symheli.values.arrays import Array, frozen
from symheli.values.kinematics import RIGID_BODY
from symheli.values.signal import Signal, signals
from symheli.values.summary import summarized

STEP = 0.005
"""Longest integration step, s: that of the flights of the nonlinear model."""
_TABLES = {"linear": PiecewiseLinear, "spline": CubicSpline}


@dataclass(frozen=True, eq=False, kw_only=True)
class StitchedModel:
    """Stitched model dx/dt = n(x) + f0(p) + A(p) (x_a - x0(p)) + B(p) (u - u0(p)), interpolated at
    the filtered airspeed p.

    n(x) is exact: omega x V, gravity, attitude kinematics and, where `inertia` is given, the
    gyroscopic moments. The tables hold what is left of each point model. x_a is x with the velocity
    through the air. Beyond the first and the last anchor the tables keep their end values.

    Parameters
    ----------
    basis : PiecewiseLinear or CubicSpline
        Of the tables, over K airspeeds.
    x0, u0, f0 : array (K, nx), (K, nu), (K, nx)
        The trim values, and what is left of the derivative there.
    A, B : array (K, nx, nx), (K, nx, nu)
        The aerodynamic and control derivatives, per unit of mass and inertia.
    states, inputs : tuple of Signal
        SI and radians.
    filter : float
        Time constant of dp/dt = (V - p)/filter with V the true airspeed, s; 0: looked up at V
        itself; math.inf: at the start's airspeed for good.
    inertia : (float, float, float, float), optional
        Ixx, Iyy, Izz, held rotor inertia added in yaw, kg m^2.

    Raises
    ------
    InputError
        Shapes that do not fit, or an unknown table.

    References
    ----------
    Zivan & Tischler (2010), J. American Helicopter Society 55; Tobias & Tischler (2016),
    RDMR-AF-16-01.

    Examples
    --------
    >>> stitched = symheli.flight.StitchedModel.from_family(symheli.sweep(heli, [2.0, 5.0, 8.0]))
    >>> point = symheli.trim(heli, airspeed=5.0)
    >>> rate = stitched.rhs([point.x[s] for s in stitched.states], [*point.u.values()])
    >>> bool(np.abs(rate).max() < 1e-9)
    True
    """

    basis: PiecewiseLinear | CubicSpline
    x0: Array
    u0: Array
    f0: Array
    A: Array
    B: Array
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    filter: float = 0.5
    inertia: tuple[float, float, float, float] | None = None

    __repr__ = summarized

    def __post_init__(self) -> None:
        for group in ("states", "inputs"):
            object.__setattr__(self, group, signals(getattr(self, group)))
        K, nx, nu = self.basis.size, len(self.states), len(self.inputs)
        for name, shape in (
            ("x0", (K, nx)),
            ("u0", (K, nu)),
            ("f0", (K, nx)),
            ("A", (K, nx, nx)),
            ("B", (K, nx, nu)),
        ):
            object.__setattr__(self, name, frozen(getattr(self, name), name, shape))
        if not self.filter >= 0:
            raise InputError(f"filter must be a time constant >= 0 s, got {self.filter}")
        if self.inertia is not None and (len(self.inertia) != 4 or not min(self.inertia[:3]) > 0):
            raise InputError(
                "inertia: expected Ixx, Iyy, Izz > 0 and the added yaw inertia (kg m^2), got"
                f" {self.inertia}"
            )

    @classmethod
    def from_family(
        cls,
        family: LinearFamily,
        filter: float = 0.5,
        *,
        kind: Literal["linear", "spline"] = "linear",
        inertia: tuple[float, float, float, float] | None = None,
    ) -> StitchedModel:
        """Return the stitched model of a continuous family with all rigid-body states and its
        trims; tables straight between the anchors, or "spline".
        """
        speeds = family.over_airspeed("a stitched model")
        if family.dt is not None:
            raise InputError(f"stitch continuous models; these are sampled at {family.dt} s")
        if family.states[:8] != RIGID_BODY:
            raise InputError(
                f"a stitched model needs the states {' '.join(RIGID_BODY)} first, got"
                f" {' '.join(family.states)}"
            )
        if len(family) < 2:
            raise InputError("stitching needs at least two airspeeds")
        if kind not in _TABLES:
            raise UnknownNameError("kind of table", kind, _TABLES)
        if gusts := [
            n for n in family.inputs if n not in family.known_trims("a stitched model")[0].u
        ]:
            raise InputError(
                f"leave {', '.join(gusts)} out (family.select(inputs=...)): wind enters a stitched"
                " model by its kinematics"
            )
        nodes = tuple(float(p) for p in speeds)
        x0 = np.array([[trim.x[s] for s in family.states] for trim in family.trims])
        u0 = np.array([[trim.u[s] for s in family.inputs] for trim in family.trims])
        xdot = np.array([[trim.xdot[s] for s in family.states] for trim in family.trims])
        exact = _rigid_body(inertia)
        return cls(
            basis=_TABLES[kind](nodes),
            x0=x0,
            u0=u0,
            f0=xdot - exact(x0),
            A=family.A - np.stack([_jacobian(exact, x) for x in x0]),
            B=family.B,
            states=family.states,
            inputs=family.inputs,
            filter=filter,
            inertia=inertia,
        )

    def airspeed(self, x: object, wind: object = (0.0, 0.0, 0.0)) -> Array:
        """True airspeed, m/s, of the states x (..., nx) in `wind` (..., 3), body axes, m/s."""
        return np.linalg.norm(np.asarray(x)[..., :3] - np.asarray(wind), axis=-1)

    def rhs(
        self, x: object, u: object, wind: object = (0.0, 0.0, 0.0), *, lookup: object | None = None
    ) -> Array:
        """xdot (..., nx) at x (..., nx), u (..., nu), wind in body axes (..., 3); read at `lookup`
        (...), m/s, or at the airspeed. Not finite where one of these is
        not.
        """
        x, u, wind = np.asarray(x, float), np.asarray(u, float), np.asarray(wind, float)
        for name, given, size in (
            ("x", x, self.x0.shape[1]),
            ("u", u, self.u0.shape[1]),
            ("wind", wind, 3),
        ):
            if given.shape[-1:] != (size,):
                raise InputError(f"{name}: expected (..., {size}), got shape {given.shape}")
        p = self.airspeed(x, wind) if lookup is None else np.asarray(lookup, float)
        weights = self.basis(np.clip(p, self.basis.low, self.basis.high))
        x0, u0, f0 = weights @ self.x0, weights @ self.u0, weights @ self.f0
        dx, du = x - x0, u - u0
        dx[..., :3] -= wind
        A, B = np.tensordot(weights, self.A, axes=1), np.tensordot(weights, self.B, axes=1)
        return (
            _rigid_body(self.inertia)(x)
            + f0
            + (A @ dx[..., None])[..., 0]
            + (B @ du[..., None])[..., 0]
        )

    def simulate(
        self,
        u: object,
        x0: object,
        *,
        dt: float,
        wind: object = (0.0, 0.0, 0.0),
        lookup: object | None = None,
    ) -> Array:
        """States (n, ..., nx) from x0 (..., nx) with inputs u (n, ..., nu) held for `dt` s each;
        row k is before input k.

        `wind` in body axes, (3,) or (n, ..., 3), m/s. `lookup` (...), m/s, is where the airspeed
        filter starts (default: at the true airspeed). The leading axes are flights side by side.
        Classical Runge-Kutta steps of at most 5 ms.
        """
        if not dt > 0:
            raise InputError(f"dt must be a positive number of seconds, got {dt}")
        u, start = frozen(u, "u"), frozen(x0, "x0")
        if (
            u.ndim != start.ndim + 1
            or u.shape[1:] != (*start.shape[:-1], len(self.inputs))
            or start.shape[-1] != len(self.states)
        ):
            raise InputError(
                f"expected x0 (..., {len(self.states)}) and u (n, ..., {len(self.inputs)}), got x0"
                f" {start.shape} and u {u.shape}"
            )
        air = np.broadcast_to(frozen(wind, "wind"), (*u.shape[:-1], 3))
        p = (
            self.airspeed(start, air[0])
            if lookup is None
            else np.broadcast_to(frozen(lookup, "lookup"), start.shape[:-1])
        )
        steps = math.ceil(dt / STEP - 1e-9)
        h, z = dt / steps, np.concatenate([start, p[..., None]], axis=-1)
        out = np.empty((*u.shape[:-1], len(self.states)))
        for k in range(len(u)):
            out[k] = z[..., :-1]
            for _ in range(steps):
                z = self._step(z, u[k], air[k], h)
        return out

    def _step(self, z: Array, u: Array, wind: Array, h: float) -> Array:
        """One Runge-Kutta step of the states and the filtered airspeed together."""
        k1 = self._rates(z, u, wind)
        k2 = self._rates(z + h / 2 * k1, u, wind)
        k3 = self._rates(z + h / 2 * k2, u, wind)
        k4 = self._rates(z + h * k3, u, wind)
        return z + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def _rates(self, z: Array, u: Array, wind: Array) -> Array:
        x, p = z[..., :-1], z[..., -1]
        if self.filter == 0:
            return np.concatenate([self.rhs(x, u, wind), np.zeros_like(p)[..., None]], axis=-1)
        pdot = (self.airspeed(x, wind) - p) / self.filter
        return np.concatenate([self.rhs(x, u, wind, lookup=p), pdot[..., None]], axis=-1)


def _rigid_body(inertia: Sequence[float] | None) -> Callable[[Array], Array]:
    """The part of dx/dt (..., nx) that no table holds: omega x V, gravity, gyroscopic moments,
    attitude rates.
    """
    still = (0.0, 0.0, 0.0)

    def exact(x: Array) -> Array:
        u, v, w, p, q, r, phi, theta = np.moveaxis(x[..., :8], -1, 0)
        out = np.zeros_like(x)
        out[..., :3] = np.stack(
            translation(u, v, w, p, q, r, gravity_euler(phi, theta), still, 1.0), axis=-1
        )
        if inertia is not None:
            out[..., 3:6] = np.stack(rotation(p, q, r, still, *inertia), axis=-1)
        out[..., 6:8] = np.stack(euler_rates(phi, theta, p, q, r)[:2], axis=-1)
        return out

    return exact


def _jacobian(f: Callable[[Array], Array], x: Array) -> Array:
    """df/dx (n, n) at x (n,) by complex steps, which cancel nothing: exact to rounding for analytic
    f.
    """
    h = 1e-30
    return np.imag(f(x + 1j * h * np.eye(len(x)))).T / h
