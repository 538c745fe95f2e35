"""The recursive estimator in real time for a rigid vehicle, with increments formed sample by
sample.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from identification.recursive.kernel.configuration import KernelConfiguration
from identification.recursive.online import Online
from identification.recursive.rls_state import RLSState
from identification.structure.kinematic_arx import MOVING, STATES, increments
from identification.structure.regressors import vector
from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.kinematics import rates_of

WIDE, FAST = len(STATES), len(MOVING)


class RigidBodyOnline(Online):
    """A rigid body online is an `Online` whose samples are u v w p q r phi theta, the controls and
    p: it passes on the increments of the velocities beyond the kinematics.

    Made by `RecursiveLeastSquares.online` of a `KinematicARX`. After a missing sample or a gap the
    next sample is a start: nothing is learnt until the lags are full again.

    See Also
    --------
    identification.RecursiveLeastSquares : least squares sample by sample
    identification.KinematicARX : a structure with known kinematics

    Examples
    --------
    >>> import symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> plan = symheli.AirspeedSchedule((6.0, 2.0), (1.5, 1.5), (2.0, 2.0), start=2.0)
    >>> excitation = symheli.Excitation(dict.fromkeys(heli.inputs, 0.01))
    >>> flight = symheli.fly(heli, plan, excitation=excitation)
    >>> kin = idn.KinematicARX(
    ...     heli.inputs, "airspeed_command", basis=idn.Polynomial(1, 2.0, 6.0))
    >>> online = idn.RecursiveLeastSquares(kin).online(dt=flight.dt)
    >>> y, u = flight.columns(kin.outputs), flight.columns(kin.inputs)
    >>> p = flight["airspeed_command"]
    >>> [online.update(y[k], u[k], p[k]) for k in range(4)]
    [False, False, True, True]
    """

    def __init__(self, configuration: KernelConfiguration, kernel: Any, state: RLSState, dt: float):
        super().__init__(configuration, kernel, state)
        self._half, self._controls = 0.5 * dt, configuration.structure.nu - FAST
        self._y, self._u = np.zeros(FAST), np.zeros(FAST + self._controls)
        self._last: tuple[float, ...] = ()
        self._rates: tuple[float, ...] = ()
        self.forget_past()

    def update(self, y: object, u: object, p: object) -> bool:
        """Take in u v w p q r phi theta (8,), the controls (nu,) and p of one instant; True where
        the coefficients moved.

        A NaN anywhere is a missing sample. Raises `InputError` as `Online.update`; the next sample
        is then a start.
        """
        last, rates = self._last, self._rates
        self._last = ()
        try:
            now = tuple(vector(y, WIDE, "y").tolist())
            controls = vector(u, self._controls, "u")
            if not math.isfinite(sum(now)) and any(map(math.isinf, now)):
                raise InputError("y is infinite; mark a missing sample as NaN")
        except InputError:
            self.forget_past()
            raise
        new = rates_of(now, math)
        if not last:  # a start: any number will do, there is no regressor yet
            last, rates = now, new
        half, complete = self._half, new[WIDE - 2] - new[WIDE - 2]  # NaN where an angle or rate is
        self._y[:] = [
            y1 - y0 - half * (k1 + k0) + complete
            for y1, y0, k1, k0 in zip(now[:FAST], last, new, rates, strict=False)
        ]
        self._u[:FAST] = now[:FAST]
        self._u[FAST:] = controls
        learnt = super().update(self._y, self._u, p)
        if self._filled:
            self._last, self._rates = now, new
        return learnt

    def run(self, samples: Array, history: bool = True) -> tuple[Array, Array | None, Array | None]:
        """Take in rows [u v w p q r phi theta, controls, p], p within the basis, as `Online.run`
        takes its own.
        """
        samples = np.ascontiguousarray(samples, float)
        parameters = len(self._configuration.structure.parameters)
        width = WIDE + self._controls + parameters
        if samples.ndim != 2 or samples.shape[1] != width:
            raise InputError(f"samples: expected shape (any, {width}), got {samples.shape}")
        if not len(samples):
            return super().run(np.zeros((0, 2 * FAST + self._controls + parameters)), history)
        y = samples[:, :WIDE]
        before = np.array([self._last]) if self._last else np.full((1, WIDE), np.nan)
        added = increments(np.vstack([before, y]), 2 * self._half)[1:, :FAST]
        added = _starting(added, np.hstack([y, samples[:, WIDE:]]))
        out = super().run(np.column_stack([added, y[:, :FAST], samples[:, WIDE:]]), history)
        self._last = tuple(y[-1].tolist()) if self._filled else ()
        self._rates = rates_of(self._last, math) if self._last else ()
        return out

    def forget_past(self) -> None:
        """The next update is a start: after a gap in the data."""
        super().forget_past()
        self._last = ()


def _starting(added: Array, measured: Array) -> Array:
    """Increments (n, 6) with zeros where all of a sample was `measured` (n, any) but not the one
    before: no regressor is complete there, and its lags may be filled from it on.
    """
    unknown = np.logical_or.reduce(np.isnan(added), axis=1)
    start = unknown & np.logical_and.reduce(np.isfinite(measured), axis=1)
    return np.where(start[:, None], 0.0, added)
