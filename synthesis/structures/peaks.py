"""Largest gain and largest pole of a loop over flight conditions, with their slopes by the gains of
a structure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symheli.errors import AccuracyError, InputError
from symheli.values.arrays import Array
from symheli.values.signal import indices
from synthesis.design.plant.generalized import Generalized, blocks
from synthesis.numerics.linear.norm import below, norm
from synthesis.structures.structure import TunableController

if TYPE_CHECKING:
    from synthesis.design.lpv.objectives import L2
    from synthesis.design.plant.plant import Plant

SAME = 1e-9
"""Relative excess up to which a peak counts as known: that of `norm`, rounded up."""

STEEP = 100.0
"""Slope of the penalty of a bound that is exceeded, in logarithms of the gain per unit of the gain
of the structure: steeper than the largest gain by exceeding one that was seen.
"""


SLOW = 10.0
"""The same of the decay, per unit of the required one."""

TINY = 1e-300
"""In place of a divisor that is zero."""


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


@dataclass(frozen=True, eq=False)
class StructureLoops:
    """The plant at K conditions around the frame of a structure, whose gains close them.

    `open`: matrices with a leading axis; `shares` (K, n, g): of every free number in every gain;
    `channels`: disturbances, performance and bound of each specification; `low`, `high` (g,) hold
    where the shares are `bounded` (M, n, g); `units` (g,): of a gain, about its size;
    `decay`: every pole is to lie left of minus this, 1/s.
    """

    open: Generalized
    shares: Array
    channels: tuple[tuple[Array, Array, float], ...]
    low: Array
    high: Array
    bounded: Array
    units: Array
    decay: float
    dt: float | None

    @classmethod
    def of(
        cls,
        plant: Plant,
        structure: TunableController,
        points: Array,
        specifications: Sequence[L2],
        units: Array,
        bounded: Array,
        decay: float = 0.0,
    ) -> StructureLoops:
        """At `points` (K, m) of the parameters; bounds hold at those and at `bounded` (M, m)."""
        channels = [
            (
                np.array(_own(one.disturbances, plant.disturbances, "disturbance")),
                np.array(_own(one.performance, plant.performance, "performance signal")),
                one.bound or 1.0,
            )
            for one in specifications
        ]
        return cls(
            _around_frame(plant, structure, points),
            shares(structure, points) * units,
            tuple(channels),
            np.array([gain.low for gain in structure.gains]),
            np.array([gain.high for gain in structure.gains]),
            shares(structure, np.vstack([bounded, points])) * units,
            units,
            decay,
            plant.dt,
        )

    def gains(self, x: Array) -> Array:
        """Gains (K, g) for free numbers x (n,)."""
        return np.einsum("n,kng->kg", x, self.shares)

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
        more, steeper = self._beyond(x)
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
        more, steeper = self._beyond(x)
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
        each = (y.conj() @ closed.B[k][:, w:]) * (closed.C[k][z:] @ x_r)
        each = each / scale if abs(scale) > TINY else np.zeros(each.shape)
        if self.dt is None:
            return Value(pole.real, self.shares[k] @ np.real(each))
        size = max(abs(pole), TINY)
        return Value(
            math.log(size) / self.dt,
            self.shares[k] @ np.real(each * (pole.conjugate() / size) / size) / self.dt,
        )

    @property
    def _sizes(self) -> tuple[int, int]:
        """Numbers of disturbances and of performance signals."""
        return self.open.B1.shape[-1] - len(self.units), self.open.C1.shape[-2] - len(self.units)

    def _closed(self, x: Array) -> _Closed | None:
        if not np.isfinite(x).all():
            return None
        K = self.gains(x)
        count, g = K.shape
        A, B, C = (np.zeros(s) for s in ((count, 0, 0), (count, 0, g), (count, g, 0)))
        try:
            found = self.open.closed(A, B, C, K[:, :, None] * np.eye(g))
        except (InputError, np.linalg.LinAlgError):
            return None
        return _Closed(*found) if all(np.isfinite(M).all() for M in found) else None

    def _channel(self, closed: _Closed, k: int, s: int) -> tuple[Array, Array, Array, Array]:
        w, z, bound = self.channels[s]
        C, D = closed.C[k][z] / bound, closed.D[k][z][:, w] / bound
        return closed.A[k], closed.B[k][:, w], C, D

    def _slope(self, closed: _Closed, active: Active) -> Array:
        """Slope of that singular value: dsigma/dk_j = Re (u* T_zj)(T_jw v), T_zj from the output of
        gain j to the performance, T_jw from the disturbances to its input.
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
        return self.shares[k] @ np.real(by_output * by_input)

    def _exceeded(self, x: Array) -> tuple[Array, Array]:
        """By how much bounds are exceeded (M, g), in units; and of which sign."""
        gains = np.einsum("n,mng->mg", x, self.bounded)
        over, under = gains - self.high, self.low - gains
        return np.maximum(np.maximum(over, under), 0.0) / self.units, np.where(over > under, 1, -1)

    def _beyond(self, x: Array) -> tuple[float, Array]:
        """Penalty of the bound that is exceeded most, and its slope."""
        if not np.any(np.isfinite(self.low) | np.isfinite(self.high)):
            return 0.0, np.zeros(len(x))
        beyond, sign = self._exceeded(x)
        m, j = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
        if beyond[m, j] <= 0:
            return 0.0, np.zeros(len(x))
        slope = STEEP * sign[m, j] * self.bounded[m, :, j] / self.units[j]
        return STEEP * float(beyond[m, j]), slope

    def within(self, x: Array, inside: Array) -> Array:
        """Return numbers whose gains keep every bound: as much of constant gains `inside` (n,)
        added as that takes, gain by gain.
        """
        x = x.copy()
        gains = np.einsum("n,mng->mg", x, self.bounded)
        centre = np.einsum("n,mng->mg", inside, self.bounded)
        target = np.clip(gains, self.low, self.high)
        far = np.abs(gains - centre)
        share = np.where(far > 0, np.abs(gains - target) / np.maximum(far, 1e-300), 0.0)
        for j in range(gains.shape[1]):
            own = np.any(self.bounded[:, :, j] != 0, axis=0)
            t = min(float(share[:, j].max()), 1.0)
            x[own] += t * (inside[own] - x[own])
        return x


def _own(given: Sequence[str] | None, known: Sequence[str], kind: str) -> list[int]:
    return list(range(len(known))) if given is None else indices(given, known, kind)


def _around_frame(plant: Plant, structure: TunableController, points: Array) -> Generalized:
    """Return the plant under the frame: from (disturbances, gain outputs) and gain outputs to
    (performance, gain inputs) and gain inputs, at points (K, m).
    """
    one = points[:, 0] if points.shape[1] == 1 else points
    P = plant.matrices(one)
    u = indices(structure.controls, plant.controls, "control")
    y = indices(structure.measurements, plant.measurements, "measurement")
    P = P._replace(
        B2=P.B2[..., u], D12=P.D12[..., u], C2=P.C2[..., y, :], D21=P.D21[..., y, :],
        D22=P.D22[..., y, :][..., u],
    )  # fmt: skip
    names = [gain.name for gain in structure.gains]
    frame = structure.frame
    rows = indices((*structure.controls, *names), frame.outputs, "output")
    columns = indices((*structure.measurements, *names), frame.inputs, "input")
    g, count = len(names), len(points)
    nw, nz = P.B1.shape[-1], P.C1.shape[-2]
    eye = np.eye(g)

    def wide(M: Array) -> Array:
        return blocks([[M, np.zeros((M.shape[-2], g))]])

    def tall(M: Array) -> Array:
        return blocks([[M], [np.zeros((g, M.shape[-1]))]])

    def corner(M: Array, block: Array) -> Array:
        ny, nu = M.shape[-2:]
        return blocks([[M, np.zeros((ny, g))], [np.zeros((g, nu)), block]])

    passing = Generalized(
        P.A, wide(P.B1), wide(P.B2), tall(P.C1), tall(P.C2),
        corner(P.D11, 0 * eye), corner(P.D12, eye), corner(P.D21, eye), corner(P.D22, 0 * eye),
    )  # fmt: skip
    stacked = [
        np.broadcast_to(M, (count, *M.shape))
        for M in (
            frame.A,
            frame.B[:, columns],
            frame.C[rows],
            frame.D[np.ix_(rows, columns)],
        )
    ]
    A, B, C, D = passing.closed(*stacked)
    B2, C2 = B[..., nw:], C[..., nz:, :]
    through, into = D[..., nz:, :], D[..., nw:]
    return Generalized(
        A, B, B2, C, C2, D, into, through, D[..., nz:, :][..., nw:],
    )  # fmt: skip


def shares(structure: TunableController, points: Array) -> Array:
    """Share (K, n, g) of every free number in every gain at points (K, m)."""
    count, g = len(points), len(structure.gains)
    out = np.zeros((count, structure.numbers, g))
    values = None
    if structure.basis is not None:
        values = structure.basis(points[:, 0] if points.shape[1] == 1 else points)
    at = 0
    for j, gain in enumerate(structure.gains):
        size = structure.numbers_of(gain)
        own = values if values is not None and gain.scheduled else np.ones((count, 1))
        out[:, at : at + size, j] = own
        at += size
    return out
