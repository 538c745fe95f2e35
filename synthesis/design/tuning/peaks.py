"""Largest gain and largest pole of several loops around one gain matrix, with their slopes."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from symheli.errors import AccuracyError, InputError
from symheli.values.arrays import Array
from synthesis.design.plant.generalized import Generalized, blocks
from synthesis.numerics.linear.norm import below, norm

SAME = 1e-9
"""Relative excess up to which a peak counts as known: that of `norm`, rounded up."""

STEEP = 100.0
"""Slope of the penalty of a bound that is exceeded, in logarithms of the gain per unit of the gain
of the structure: steeper than the largest gain by exceeding one that was seen.
"""

SLOW = 10.0
"""Slope of the penalty of the decay, in logarithms of the gain, per unit of the required one."""

TINY = 1e-300
"""In place of a divisor that is zero."""

Channel = tuple[Array, Array, float]
"""Positions of disturbances and of performance signals, and the bound of the gain between."""


class Active(NamedTuple):
    """The condition, specification and frequency (rad/s) of the largest gain over its bound."""

    gain: float
    condition: int
    specification: int
    omega: float


class Value(NamedTuple):
    """A number to minimise, and its slope (n,)."""

    value: float
    slope: Array


class _Closed(NamedTuple):
    """Loops from (disturbances, gain outputs) to (performance, gain inputs), a leading axis."""

    A: Array
    B: Array
    C: Array
    D: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class LoopPeaks(ABC):
    """Plants at K conditions, closed by gain matrices of free numbers x (n,).

    `open`: matrices with a leading axis, of which disturbances and performance end with the outputs
    and the inputs of the gains; `channels`: disturbances, performance and bound of each
    specification; `decay`: every pole is to lie left of minus this, 1/s.
    """

    open: Generalized
    channels: tuple[Channel, ...]
    dt: float | None
    decay: float = 0.0

    @abstractmethod
    def matrix(self, x: Array) -> Array:
        """Gain matrices (K, outputs, inputs) for free numbers x (n,)."""

    @abstractmethod
    def pulled(self, condition: int, left: Array, right: Array) -> Array:
        """Slope (n,) by the free numbers of Re left' M right, M the gain matrix."""

    def beyond(self, x: Array) -> tuple[float, Array]:
        """Penalty of bounds that are exceeded, and its slope."""
        return 0.0, np.zeros(len(x))

    def _largest(self, closed: _Closed, known: Active | None, limit: float) -> Active:
        """Return the largest gain, as a ratio to its bound, or some gain above the `limit`;
        infinite where a loop is not stable.
        """
        order = [(k, s) for k in range(len(closed.A)) for s in range(len(self.channels))]
        if known is not None:
            order.sort(key=lambda at: at != (known.condition, known.specification))
        worst = Active(0.0, 0, 0, 0.0)
        for k, s in order:
            matrices = self._channel(closed, k, s)
            if worst.gain > 0 and below(*matrices, worst.gain * (1 + SAME), self.dt):
                continue
            try:
                gain, omega = norm(*matrices, self.dt)
            except (AccuracyError, np.linalg.LinAlgError):
                gain, omega = math.inf, math.nan
            if gain > worst.gain:
                worst = Active(gain, k, s, omega)
            if gain > limit:
                break
        return worst

    def gain(
        self, x: Array, known: Active | None = None, limit: float = math.inf
    ) -> tuple[Value, Active]:
        """Return the logarithm of the largest gain as a ratio to its bound, with the penalty of
        bounds that are exceeded, and where that gain is; infinite where a loop is not stable.
        `known`: where it was near by, which is looked at first. Above the `limit` of the logarithm
        it may be another gain than the largest.
        """
        closed = self._closed(x)
        if closed is None:
            return Value(math.inf, np.zeros(len(x))), Active(math.inf, 0, 0, math.nan)
        active = self._largest(closed, known, math.exp(min(limit, 700.0)))
        if not math.isfinite(active.gain) or active.gain <= 0:
            return Value(math.inf, np.zeros(len(x))), active
        slope = self._slope(closed, active) / active.gain
        return self._penalised(x, closed, Value(math.log(active.gain), slope)), active

    def mean(self, x: Array, level: float) -> Value:
        """Return the mean logarithm of the gains over their bounds, with penalties: of the largest
        above `level`, and those of `gain`; infinite where a loop is not stable.
        """
        closed = self._closed(x)
        nothing = Value(math.inf, np.zeros(len(x)))
        if closed is None:
            return nothing
        at = [(k, s) for k in range(len(closed.A)) for s in range(len(self.channels))]
        try:
            found = [norm(*self._channel(closed, k, s), self.dt) for k, s in at]
        except (AccuracyError, np.linalg.LinAlgError):
            return nothing
        each = [Active(gain, k, s, omega) for (gain, omega), (k, s) in zip(found, at, strict=True)]
        if not all(0 < one.gain < math.inf for one in each):
            return nothing
        values = np.log([one.gain for one in each])
        slopes = np.array([self._slope(closed, one) / one.gain for one in each])
        worst = int(np.argmax(values))
        above = max(float(values[worst]) - level, 0.0)
        slope = slopes.mean(axis=0) + STEEP * (above > 0) * slopes[worst]
        own = Value(float(values.mean()) + STEEP * above, slope)
        return self._penalised(x, closed, own)

    def _penalised(self, x: Array, closed: _Closed, own: Value) -> Value:
        """Return the value with the penalties of bounds and of the decay."""
        more, steeper = self.beyond(x)
        if self.decay > 0 and (pole := self._pole(closed)).value > -self.decay:
            more += SLOW * (1 + pole.value / self.decay)
            steeper = steeper + SLOW / self.decay * pole.slope
        return Value(own.value + more, own.slope + steeper)

    def pole(self, x: Array) -> Value:
        """Return the largest real part of a pole (1/s; of sampled loops log|z| over the period)
        with its slope, and the penalty of bounds that are exceeded.
        """
        closed = self._closed(x)
        if closed is None:
            return Value(math.inf, np.zeros(len(x)))
        value, slope = self._pole(closed)
        more, steeper = self.beyond(x)
        return Value(value + more, slope + steeper)

    def _pole(self, closed: _Closed) -> Value:
        values = np.linalg.eigvals(closed.A)
        sizes = np.real(values) if self.dt is None else np.abs(values)
        k = int(np.argmax(sizes.max(axis=1)))
        poles, right = np.linalg.eig(closed.A[k])
        j = int(np.argmax(np.real(poles) if self.dt is None else np.abs(poles)))
        pole, x_r = complex(poles[j]), right[:, j]
        adjoint, left = np.linalg.eig(closed.A[k].conj().T)
        y = left[:, int(np.argmin(np.abs(adjoint - pole.conjugate())))]
        scale = y.conj() @ x_r
        w, z = self._sizes
        turn = 1 / scale if abs(scale) > TINY else 0.0
        left, right = turn * (y.conj() @ closed.B[k][:, w:]), closed.C[k][z:] @ x_r
        if self.dt is None:
            return Value(pole.real, self.pulled(k, left, right))
        size = max(abs(pole), TINY)
        left = left * (pole.conjugate() / size) / size / self.dt
        return Value(math.log(size) / self.dt, self.pulled(k, left, right))

    @property
    def _sizes(self) -> tuple[int, int]:
        """Numbers of disturbances and of performance signals."""
        into, out = self.open.B2.shape[-1], self.open.C2.shape[-2]
        return self.open.B1.shape[-1] - into, self.open.C1.shape[-2] - out

    def _closed(self, x: Array) -> _Closed | None:
        if not np.isfinite(x).all():
            return None
        K = self.matrix(x)
        count, into, out = K.shape
        A, B, C = (np.zeros(s) for s in ((count, 0, 0), (count, 0, out), (count, into, 0)))
        try:
            found = self.open.closed(A, B, C, K)
        except (InputError, np.linalg.LinAlgError):
            return None
        return _Closed(*found) if all(np.isfinite(M).all() for M in found) else None

    def _channel(self, closed: _Closed, k: int, s: int) -> tuple[Array, Array, Array, Array]:
        w, z, bound = self.channels[s]
        C, D = closed.C[k][z] / bound, closed.D[k][z][:, w] / bound
        return closed.A[k], closed.B[k][:, w], C, D

    def _slope(self, closed: _Closed, active: Active) -> Array:
        """Slope of that singular value: dsigma = Re (u* T_zg) dM (T_gw v), T_zg from the outputs of
        the gains to the performance, T_gw from the disturbances to their inputs.
        """
        k, s, omega = active.condition, active.specification, active.omega
        A, B, C, D = (M[k] for M in closed)
        w, z, bound = self.channels[s]
        first_w, first_z = self._sizes
        if math.isfinite(omega):
            point = 1j * omega if self.dt is None else np.exp(1j * omega * self.dt)
            T = C @ np.linalg.solve(point * np.eye(len(A)) - A, B) + D
        else:
            T = D.astype(complex)
        u, _, v = np.linalg.svd(T[z][:, w] / bound)
        by_output = u[:, 0].conj() @ T[z, first_w:] / bound
        by_input = T[first_z:, w] @ v[0].conj()
        return self.pulled(k, by_output, by_input)


def gathered(P: Generalized) -> Generalized:
    """Return plants whose disturbances and performance end with the controls and measurements."""
    return Generalized(
        P.A, blocks([[P.B1, P.B2]]), P.B2, blocks([[P.C1], [P.C2]]), P.C2,
        blocks([[P.D11, P.D12], [P.D21, P.D22]]), blocks([[P.D12], [P.D22]]),
        blocks([[P.D21, P.D22]]), P.D22,
    )  # fmt: skip
