"""Time response of an LPV model along a history of p, or with p a function of the state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.exponential import expm
from symheli.lpv.lft.model import LFT
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.scheduling import RANGE_SLACK, Scheduling, check_all
from symheli.lpv.trim_schedule import TrimSchedule
from symheli.values.arrays import Array, frozen
from symheli.values.sample_period import same_period

RELATIVE_ERROR, ABSOLUTE_ERROR = 1e-9, 1e-12
"""Local errors of the integration where p is a function of the state."""


class Steps(NamedTuple):
    """x(k+1) = A x(k) + B u(k) + E w(k) along a trajectory: A, E (n, nx, nx), B (n, nx, nu)."""

    A: Array
    B: Array
    E: Array


def simulate(
    lpv: LPVStateSpace | LFT,
    p: object,
    u: object,
    x0: object | None = None,
    *,
    dt: float | None = None,
    drift: object | None = None,
    offsets: bool = False,
) -> tuple[Array, Array]:
    """Simulate an LPV model along a scheduling history, or with p a function of time, state and
    input (quasi-LPV).

    Along a history continuous models are advanced by the exact exponential of each sample's
    A(p(k)), B(p(k)), p held; discrete ones by their own matrices. With p a function, a continuous
    model is integrated with p at every instant (LSODA, local error 1e-9), and only u is held.

    Parameters
    ----------
    lpv : LPVStateSpace or LFT
        The model.
    p : array (n,), or (n, d) with d parameters; or callable
        In the units of the parameters. A callable p(t, x, u) takes s, (nx,) and (nu,), states and
        inputs as they are simulated, and returns a number, or d of them.
    u : array (n, nu)
        Held between samples.
    x0 : array (nx,), optional
        Default zero; with `offsets`, the trim at the start of a history.
    dt : float, optional
        s; for continuous models.
    drift : array (n, nx), optional
        Added to dx/dt (continuous) or to x(k+1) (discrete): a moving trim x0(p) contributes
        `lpv.trim.drift(p, rate)`.
    offsets : bool
        States, inputs and outputs are whole values, not deviations from the trim of the model:
        dx/dt = xdot0(p) + A(p) (x - x0(p)) + B(p) (u - u0(p)), y = y0(p) + C(p) (x - x0(p)) +
        D(p) (u - u0(p)), which holds while p moves without a drift.

    Returns
    -------
    states : array (n, nx)
        At each sample.
    outputs : array (n, ny)
        At each sample.

    Raises
    ------
    InputError
        Shapes that do not fit, p outside its range (of a callable with time and value), a missing
        `dt`, or one that is not the model's; `offsets` of a model without a trim.

    Examples
    --------
    >>> p, u = np.linspace(0.0, 1.0, 400), np.ones((400, 1))
    >>> states, outputs = lpv.tools.simulate(spring, p, u, dt=0.1)
    >>> round(float(outputs[-1, 0]), 2)
    0.4

    A spring that stiffens with its own deflection:

    >>> states, outputs = lpv.tools.simulate(spring, lambda t, x, u: abs(x[0]), u, dt=0.1)
    >>> round(float(outputs[-1, 0]), 2)
    0.45
    """
    if offsets and getattr(lpv, "trim", None) is None:
        raise InputError("offsets: the model has no trim; give it one, replace(lpv, trim=...)")
    about = _Offsets(lpv, lpv.trim if offsets and isinstance(lpv, LPVStateSpace) else None)
    nx, nu = len(lpv.states), len(lpv.inputs)
    given = None if callable(p) else check_all(lpv.parameters, p)
    u = frozen(u, "u", (None if given is None else len(given), nu))
    n = len(u)
    w = frozen(np.zeros((n, nx)) if drift is None else drift, "drift", (n, nx))
    if x0 is None:
        x0 = np.zeros(nx) + (0.0 if given is None or not n else about(given[0]).x)
    state = frozen(x0, "x0", (nx,))
    if given is None:
        assert callable(p)  # noqa: S101
        x, given = _of_the_state(lpv, p, u, w, state, _period(lpv, dt), about)
    else:
        x = _along(steps(lpv, given, dt), u, w, state, about(given))
    _, _, C, D = lpv.matrices(given)
    o = about(given)
    return x, o.y + np.einsum("kij,kj->ki", C, x - o.x) + np.einsum("kij,kj->ki", D, u - o.u)


class _Trim(NamedTuple):
    """x0, u0, y0 (n, .), and what is added to dx/dt or to x(k+1); zero without a trim."""

    x: Any
    u: Any
    y: Any
    rate: Any


@dataclass(frozen=True, eq=False)
class _Offsets:
    """The trim of a model at p, whose y0 is C(p) x0(p) + D(p) u0(p) where it states none."""

    lpv: LPVStateSpace | LFT
    trim: TrimSchedule | None

    def __call__(self, p: Array) -> _Trim:
        if (trim := self.trim) is None:
            return _Trim(0.0, 0.0, 0.0, 0.0)
        x, u, y = trim.state(p), trim.input(p), trim.output(p)
        if y is None:
            _, _, C, D = self.lpv.matrices(p)
            y = (C @ x[..., None] + D @ u[..., None])[..., 0]
        rate = 0.0 if trim.xdot is None else trim.basis(p) @ trim.xdot
        return _Trim(x, u, y, rate if self.lpv.dt is None else self.lpv.dt * rate)


def _along(each: Steps, u: Array, w: Array, state: Array, o: _Trim) -> Array:
    n = len(u)
    w = np.einsum("kij,kj->ki", each.E, w + o.rate) + np.einsum("kij,kj->ki", each.B, u - o.u)
    about = np.broadcast_to(o.x, w.shape)
    x = np.empty(w.shape)
    for k in range(n):
        x[k] = state
        state = about[k] + each.A[k] @ (state - about[k]) + w[k]
    return x


def _of_the_state(
    lpv: LPVStateSpace | LFT,
    function: Callable[..., object],
    u: Array,
    w: Array,
    state: Array,
    dt: float,
    about: _Offsets,
) -> tuple[Array, Array]:
    """States (n, nx) and p (n,) or (n, d) at the samples."""
    from scipy.integrate import solve_ivp

    given = lpv.parameters
    low, high = (np.array([getattr(s, end) for s in given]) for end in ("low", "high"))

    def scheduled(t: float, x: Array, k: int) -> Array:
        p = np.asarray(function(t, x, u[k]), float).reshape(-1)
        if p.shape != (len(given),) or not np.isfinite(p).all():
            raise InputError(
                f"p(t, x, u): expected {len(given)} finite number(s), one for each of"
                f" {', '.join(s.name for s in given)}, got {p} at t = {t:.6g} s"
            )
        return p

    def rates(t: float, x: Array, k: int) -> Array:
        # within a step the integrator also tries states that the response never reaches
        p = np.clip(scheduled(t, x, k), low, high)
        at = p if len(given) > 1 else p[0]
        (A, B, *_), o = lpv.matrices(at), about(at)
        return A @ (x - o.x) + B @ (u[k] - o.u) + o.rate + w[k]

    n = len(u)
    x, p = np.empty((n, len(state))), np.empty((n, len(given)))
    for k in range(n):
        t = k * dt
        x[k], p[k] = state, scheduled(t, state, k)
        _within(given, p[k], t)
        if lpv.dt is not None:
            at = about(p[k] if len(given) > 1 else p[k, 0])
            state = at.x + rates(t, state, k)
        elif k < n - 1:
            found = solve_ivp(
                rates,
                (t, t + dt),
                state,
                method="LSODA",
                args=(k,),
                rtol=RELATIVE_ERROR,
                atol=ABSOLUTE_ERROR,
            )
            if not found.success:
                raise InputError(f"the response does not go on after {found.t[-1]:.6g} s")
            for when, there in zip(found.t, found.y.T, strict=True):
                _within(given, scheduled(when, there, k), when)
            state = found.y[:, -1]
    return x, p if len(given) > 1 else p[:, 0]


def _within(given: Sequence[Scheduling], p: Array, t: float) -> None:
    for s, value in zip(given, p, strict=True):
        if not abs(value - s.middle) <= (1 + 2 * RANGE_SLACK) * s.radius:
            unit = "" if s.unit == "1" else f" {s.unit}"
            raise InputError(
                f"{s.name} = {value:.9g}{unit} at t = {t:.6g} s, but the model holds on"
                f" [{s.low:.4g}, {s.high:.4g}]: build it over a wider range, or start or push it"
                " less far"
            )


def steps(lpv: LPVStateSpace | LFT, p: Array, dt: float | None) -> Steps:
    """Return the transition from each sample to the next, p held over `dt` (s) for a continuous
    model.
    """
    A, B, *_ = lpv.matrices(p)
    n, nx, nu = B.shape
    period = _period(lpv, dt)
    if lpv.dt is not None:
        return Steps(A, B, np.broadcast_to(np.eye(nx), (n, nx, nx)))
    stacked = np.zeros((n, 2 * nx + nu, 2 * nx + nu))
    stacked[:, :nx, :nx], stacked[:, :nx, nx : nx + nu] = A, B
    stacked[:, :nx, nx + nu :] = np.eye(nx)
    step = expm(stacked * period)
    return Steps(step[:, :nx, :nx], step[:, :nx, nx : nx + nu], step[:, :nx, nx + nu :])


def _period(lpv: LPVStateSpace | LFT, dt: float | None) -> float:
    """The time between samples, s; raises `InputError` unless the model or the caller gives it."""
    if lpv.dt is None:
        if dt is None or not dt > 0:
            raise InputError("a continuous model needs the sample period dt (s)")
        return dt
    if dt is not None and not same_period(dt, lpv.dt):
        raise InputError(f"the model is discrete at {lpv.dt:g} s; leave dt = {dt!r} out")
    return lpv.dt
