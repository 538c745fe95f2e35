"""Extended Kalman filter on the identified model: states of a rigid vehicle from noisy
measurements.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from identification.model.kinematic_run import stepped
from identification.structure.kinematic_arx import MOVING, STATES
from identification.structure.regressors import scheduling_values, vector
from symheli.errors import AccuracyError, InputError, UnknownNameError
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.kinematics import kinematic_jacobian

if TYPE_CHECKING:
    from identification.model.kinematic_model import KinematicModel

WIDE, FAST = len(STATES), len(MOVING)


class KinematicObserver:
    """Observer of the states, which combines the predictions of the model with the measurements at
    every sample.

    Made by `KinematicModel.observer`. The mean goes through the nonlinear kinematics, the
    covariance through their Jacobian at the estimate. The first samples after `reset`, as many as
    the model reaches back, come out as they were measured. A missing y is predicted over, in whole
    or in part; a missing u or p, or a start with anything missing, resets. After a gap call
    `reset`: the model cannot know what was flown in between.

    Parameters
    ----------
    model : KinematicModel
        Kinematics and aerodynamics.
    noise : array (8,)
        Standard deviations of the sensors of u v w p q r phi theta.
    process : array (6,)
        Standard deviations of what one sample adds to u v w p q r beyond the model.

    Examples
    --------
    >>> import symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> plan = symheli.AirspeedSchedule((6.0, 2.0), (1.5, 1.5), (2.0, 2.0), start=2.0)
    >>> excitation = symheli.Excitation(dict.fromkeys(heli.inputs, 0.01))
    >>> clean, noisy = (
    ...     symheli.fly(heli, plan, excitation=excitation, noise_db=db) for db in (None, 30.0))
    >>> kin = idn.KinematicARX(
    ...     heli.inputs, "airspeed_command", basis=idn.Polynomial(1, 2.0, 6.0))
    >>> model = idn.fit(kin, clean)
    >>> noise = {s: float(np.std(noisy[s] - clean[s])) for s in kin.outputs}
    >>> observer = model.observer(noise, process=0.01)
    >>> y = observer.run(noisy)
    >>> bool(np.std(y[:, 7] - clean["theta"]) < 0.7 * noise["theta"])
    True
    """

    def __init__(self, model: KinematicModel, noise: Array, process: Array):
        self._model, self._realization = model, model.realization
        self._X, self._U = self._realization.regressor()
        self._R, self._Q = np.square(noise), np.square(process)
        p = np.array([np.mean(range_) for range_ in model.structure.basis.ranges])
        A, B, *_ = self._realization.matrices(p if len(p) == 1 else p[None])
        self._A, self._B = A[0], B[0]  # below the first rows, what is remembered, at any p
        self.reset()

    @property
    def model(self) -> KinematicModel:
        """Kinematics and aerodynamics."""
        return self._model

    @property
    def variances(self) -> tuple[Array, Array]:
        """Variances (8,) of the sensors and (6,) of what one sample adds beyond the model."""
        return self._R, self._Q

    @property
    def selections(self) -> tuple[list[int], list[int]]:
        """Places in x and u side by side: of the signals that coefficients multiply, and of what
        the states below the first eight become.
        """
        lagged = np.hstack([self._X, self._U])
        below = np.hstack([self._A[WIDE:], self._B[WIDE:]])
        return lagged.argmax(axis=1).tolist(), below.argmax(axis=1).tolist()

    @property
    def running(self) -> bool:
        """Whether the past is full: the next sample is estimated."""
        return self._x is not None

    def anew(self) -> KinematicObserver:
        """The same observer at its start."""
        return KinematicObserver(self._model, np.sqrt(self._R), np.sqrt(self._Q))

    def reset(self) -> None:
        """Delete the state: the next samples fill the past."""
        self._start: list[tuple[Array, Array]] = []
        self._x: Array | None = None
        self._p, self._u = np.zeros(0), np.zeros(0)

    @property
    def covariance(self) -> Array:
        """Covariance (8, 8) of the estimation error, if model and noise are correct; that of the
        sensors during a start.
        """
        return np.diag(self._R) if self._x is None else self._P[:WIDE, :WIDE].copy()

    def step(self, y: object, u: object, p: object) -> Array:
        """Return the states (8,) at one instant from y (8,), u (nu,) and p as measured there; NaN
        where a start lacks a measurement.

        Raises `InputError` for wrong shapes and p outside the basis, `AccuracyError` where the
        estimate leaves the range of numbers; the next samples are then a start.
        """
        y, u = vector(y, WIDE, "y"), vector(u, len(self._model.inputs), "u")
        p = vector(p, len(self._model.parameters), "p")
        if not (np.isfinite(u).all() and np.isfinite(p).all()):
            self.reset()
            return y
        if self._x is None:
            return self._starting(y, u, p)
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                self._x = x = self._corrected(self._predicted(self._x, p), y)
        except np.linalg.LinAlgError:
            self._x = x = np.full(WIDE, np.nan)
        if not np.isfinite(x).all():
            self.reset()
            raise AccuracyError(
                "the estimate left the range of numbers: the measurements are far from anything"
                " the model describes; check their units"
            )
        self._u, self._p = u, p
        return x[:WIDE].copy()

    def run(self, record: FlightRecord) -> Array:
        """Return the states (n, 8) along a record, each from the samples up to it; a gap resets.
        NaN and errors as of `step`.
        """
        kin = self._model.structure
        prepared = kin.aerodynamics.prepared(record)
        self._model.aerodynamics.require_same_kind(prepared)
        y, u = record.columns(STATES), record.columns(kin.inputs)
        p = scheduling_values(kin.aerodynamics, prepared)
        out = np.empty_like(y)
        for part in record.segments():
            self.reset()
            for k in range(part.start, part.stop):
                out[k] = self.step(y[k], u[k], p[k])
        return out

    def _starting(self, y: Array, u: Array, p: Array) -> Array:
        if not np.isfinite(y).all():
            self.reset()
            return y
        memory = self._model.structure.memory
        self._start = [(y, u), *self._start][:memory]
        self._u, self._p = u, p
        if len(self._start) == memory:
            past = [np.concatenate([y[:FAST], u]) for y, u in self._start]
            held = [(past[back][column], column) for column, back in self._realization.memory]
            self._x = np.concatenate([y, [value for value, _ in held]])
            variances = [self._R[column] if column < FAST else 0.0 for _, column in held]
            self._P = np.diag([*self._R, *variances])
        return y

    def _predicted(self, x: Array, p: Array) -> Array:
        model = self._model
        f = model.structure.basis(p[0] if len(p) == 1 else p)
        blocks = model.theta.reshape(-1, len(f), FAST)
        values = np.einsum("f,sfo->so", f, blocks)
        lagged, count = self._X @ x + self._U @ self._u, len(self._X)
        added = np.zeros(WIDE)
        added[:FAST] = lagged @ values[:count] + values[count]
        if model.structure.offset_rate:
            added[:FAST] += (p - self._p) @ values[count + 1 :]
        y = stepped(x[:WIDE], added, model.dt)
        half = 0.5 * model.dt
        now, then = (half * kinematic_jacobian(state) for state in (y, x[:WIDE]))
        solved = np.linalg.inv(np.eye(WIDE) - now)
        A = self._A.copy()
        A[:WIDE] = solved[:, :FAST] @ values[:count].T @ self._X
        A[:WIDE, :WIDE] += solved @ (np.eye(WIDE) + then)
        moved = self._A @ x + self._B @ self._u
        moved[:WIDE] = y
        self._P = A @ self._P @ A.T
        self._P[:WIDE, :WIDE] += (solved[:, :FAST] * self._Q) @ solved[:, :FAST].T
        return moved

    def _corrected(self, x: Array, y: Array) -> Array:
        there = np.flatnonzero(np.isfinite(y))
        S = self._P[there][:, there] + np.diag(self._R[there])
        K = np.linalg.solve(S, self._P[there]).T
        kept = np.eye(len(x))
        kept[:, there] -= K
        self._P = kept @ self._P @ kept.T + (K * self._R[there]) @ K.T  # Joseph: stays symmetric
        return x + K @ (y[there] - x[there])


def deviations(given: Mapping[str, float] | float, names: tuple[str, ...], what: str) -> Array:
    """Return standard deviations by name, or one for all; raise `UnknownNameError` for another
    name, `InputError` for one missing or not positive.
    """
    table = given if isinstance(given, Mapping) else dict.fromkeys(names, given)
    for name in table:
        if name not in names:
            raise UnknownNameError(what, name, names)
    if missing := [name for name in names if name not in table]:
        raise InputError(f"{what}: none given for {', '.join(missing)}")
    out = np.array([table[name] for name in names], float)
    if not (np.isfinite(out) & (out > 0)).all():
        raise InputError(f"{what}: expected positive standard deviations, got {dict(table)}")
    return out
