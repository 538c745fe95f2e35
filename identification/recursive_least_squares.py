"""Recursive least squares as a square-root information filter: one triangular factor for all outputs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import get_lapack_funcs

from identification.excitation import RANK_TOLERANCE
from identification.history import History
from identification.regressors import Samples, as_records, regression, regressor_rows, units_of
from identification.structure import LPVARX
from symheli.errors import InputError
from symheli.lpv import FlightRecord
from symheli.lpv.arrays import Array

dtpqrt, dtrtrs = get_lapack_funcs(("tpqrt", "trtrs"), dtype=np.float64)  # rotate rows into a triangle; solve with a triangle

DETERMINED = 1e-8
"""Below this sine between a column of R and those before it, coefficients come from a rank-revealing solve, not from the gain."""


@dataclass(frozen=True, eq=False)
class RLSState:
    """All the estimator remembers; every update returns a new one.

    `factor` (n + ny, n + ny), upper triangular, [[R, Z], [0, S]]: R'R is the weighted information of the regressors,
    R theta = Z, and S'S the weighted sum of squared residuals. `theta` (n, ny) coefficients. `peak` (n,) largest regressor
    seen. `past` the last samples [y, u, p, f(p)], at most memory + 1 rows. `count` regressors absorbed, `weight` their sum of
    weights. `determined`: whether the data fix every coefficient.
    """

    factor: Array
    theta: Array
    peak: Array
    past: Array
    count: int = 0
    weight: float = 0.0
    determined: bool = False

    def solve(self) -> Array:
        """The least-squares coefficients (n, ny) from the factor itself, R theta = Z; `theta` agrees with them to rounding."""
        n = len(self.theta)
        R, Z = self.factor[:n, :n], self.factor[:n, n:]
        return dtrtrs(R, Z)[0] if self.determined else _minimum_norm(R, Z)

    @property
    def residual_covariance(self) -> Array:
        """Weighted covariance (ny, ny) of the residuals, per degree of freedom left."""
        n = len(self.theta)
        S = np.triu(self.factor[n:, n:])
        return S.T @ S / max(self.weight - n, 1.0)


class RLSInfo(NamedTuple):
    """What one sample did: `innovation` (ny,) y minus its prediction before the update, `gain` (n,), `coefficients` (n, ny).

    Without a complete regressor (`available` False) innovation and gain are NaN and nothing was learnt.
    """

    available: bool
    innovation: Array
    gain: Array
    coefficients: Array
    determined: bool


@dataclass(frozen=True)
class RecursiveLeastSquares:
    """Exponentially forgetting least squares, sample by sample: `init`, `update`, or `run` over a record.

    Each sample rotates the row [phi', y'] into [sqrt(l) R, sqrt(l) Z] by Householder reflections; the covariance is never
    formed, so nothing can lose its definiteness. Outputs share the factor. The coefficients move along the gain
    g = R^-1 (R^-T phi): theta += g (y - theta' phi)'. There is no prior: until the data determine every coefficient, theta is the
    least-squares solution of minimum norm. With `forgetting` 1 the result is that of batch least squares.

    `forgetting` l in (0, 1]: a sample k steps old has the weight l^k. `floor` keeps the filter awake when excitation stops:
    with l < 1 the information on a coefficient never falls below that of `floor` samples with its regressor at its largest.
    It is fed in coefficient by coefficient, as a measurement saying "as it is now", which moves no coefficient; 0 turns it off.

    Raises `InputError` for a forgetting factor or floor out of range.
    """

    structure: LPVARX
    forgetting: float = 1.0
    floor: float = 1e-3

    def __post_init__(self) -> None:
        if len(self.structure.groups) > 1 or len(self.structure.parameters) > 1:
            raise InputError('the recursive filter takes one scheduling parameter and the same orders in all equations; fit with "ls"')
        if not 0 < self.forgetting <= 1:
            raise InputError(f"forgetting: expected a factor in (0, 1], got {self.forgetting!r}; 0.99 forgets within 100 samples")
        if not (np.isfinite(self.floor) and self.floor >= 0):
            raise InputError(f"floor: expected a number of samples >= 0, got {self.floor!r}")

    def init(self) -> RLSState:
        """The state that knows nothing."""
        n, ny = self.structure.n_regressors, self.structure.ny
        width = ny + self.structure.nu + 1 + self.structure.basis.size
        return RLSState(np.zeros((n + ny, n + ny), order="F"), np.zeros((n, ny)), np.zeros(n), np.zeros((0, width)))

    def update(self, state: RLSState, y: object, u: object, p: object) -> tuple[RLSState, RLSInfo]:
        """Take in the sample y (ny,), u (nu,), p of one instant; returns the new state and what it did.

        A NaN anywhere is a missing sample: nothing is learnt and the lags start afresh. Raises `InputError` for wrong
        shapes, infinite values and p outside the basis.
        """
        arx = self.structure
        sample = np.concatenate([_vector(y, arx.ny, "y"), _vector(u, arx.nu, "u"), _vector(p, 1, "p")])
        if np.isnan(sample).any():
            return replace(state, past=state.past[:0]), self._idle(state)
        past = np.vstack([state.past, np.concatenate([sample, arx.basis(sample[-1])])])[-(arx.memory + 1) :]
        state = replace(state, past=past)
        if len(past) <= arx.memory:
            return state, self._idle(state)
        ny, nu = arx.ny, arx.nu
        phi = regressor_rows(arx, past[:, :ny], past[:, ny : ny + nu], past[:, ny + nu], past[:, ny + nu + 1 :])[0]
        return self.absorb(state, phi, sample[:ny])

    def absorb(self, state: RLSState, phi: Array, y: Array) -> tuple[RLSState, RLSInfo]:
        """Take in one regressor phi (n,) with the outputs y (ny,) it must explain."""
        n, decay = len(phi), np.sqrt(self.forgetting)
        innovation = y - phi @ state.theta
        peak = np.maximum(state.peak, np.abs(phi))
        rows = np.concatenate([phi, y])[None, :]
        floor = self._floor_row(state, peak)
        if floor is not None:
            rows = np.vstack([rows, floor])
        factor = dtpqrt(0, min(8, n), decay * state.factor, rows)[0]
        R = factor[:n, :n]
        determined = _is_determined(R)
        if determined:
            gain = dtrtrs(R, dtrtrs(R, phi, trans=1)[0])[0]
            theta = state.theta + np.outer(gain, innovation) if state.determined else dtrtrs(R, factor[:n, n:])[0]
        else:
            gain, theta = np.full(n, np.nan), _minimum_norm(R, factor[:n, n:])
        state = replace(
            state, factor=factor, theta=theta, peak=peak, count=state.count + 1, weight=self.forgetting * state.weight + 1.0,
            determined=determined,
        )  # fmt: skip
        return state, RLSInfo(True, innovation, gain, theta, determined)

    def run(self, record: FlightRecord, state: RLSState | None = None) -> History:
        """Every sample of a record in turn, from `state` or from nothing; lags never reach across a gap.

        The same as `update` sample by sample, with the regressors built at once.
        """
        arx, (record,) = self.structure, as_records(record)
        state = replace(state or self.init(), past=self.init().past)
        data = regression(arx, record)
        at_row = dict(zip(data.rows.tolist(), range(len(data.rows)), strict=True))
        n = len(record)
        coefficients, innovations = np.empty((n, *state.theta.shape)), np.full((n, arx.ny), np.nan)
        for k in range(n):
            i = at_row.get(k)
            if i is not None:
                state, info = self.absorb(state, data.phi[i], data.y[i])
                innovations[k] = info.innovation
            coefficients[k] = state.theta
        state = replace(state, past=_tail(arx, record))
        return History(
            structure=arx, time=record.time, coefficients=coefficients, innovations=innovations, state=state, dt=record.dt,
            outputs=units_of(arx.outputs, [record]), inputs=units_of(arx.inputs, [record]),
            scheduling=units_of(arx.parameters, [record]), dropped=data.dropped,
        )  # fmt: skip

    def _floor_row(self, state: RLSState, peak: Array) -> Array | None:
        """[sqrt(w) e_j', sqrt(w) theta_j'] for one coefficient j, each in its turn; w makes up for what one round forgets."""
        n = len(peak)
        if self.forgetting == 1 or self.floor == 0:
            return None
        j = state.count % n
        kept = self.forgetting**n
        row = np.zeros(n + self.structure.ny)
        size = np.sqrt(self.floor * (1 - kept) / max(kept, 1e-12)) * peak[j]
        row[j], row[n:] = size, size * state.theta[j]
        return row

    def _idle(self, state: RLSState) -> RLSInfo:
        n, ny = state.theta.shape
        return RLSInfo(False, np.full(ny, np.nan), np.full(n, np.nan), state.theta, state.determined)


def _vector(value: object, size: int, name: str) -> Array:
    try:
        array = np.atleast_1d(np.asarray(value, dtype=float))
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected {size} numbers, got {value!r:.80}") from error
    if array.shape != (size,):
        raise InputError(f"{name}: expected shape ({size},), got {array.shape}")
    if np.isinf(array).any():
        raise InputError(f"{name} is infinite; mark a missing sample as NaN")
    return array


def _is_determined(R: Array) -> bool:
    """Whether every column of R stands out of the span of those before it."""
    length = np.sqrt(np.einsum("ij,ij->j", R, R))
    return bool(np.all(np.abs(np.diagonal(R)) > DETERMINED * length))


def _minimum_norm(R: Array, Z: Array) -> Array:
    """Least-squares solution of R theta = Z, of minimum norm in scaled columns where R is singular."""
    R = np.triu(R)
    scale = np.linalg.norm(R, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    return np.linalg.lstsq(R / scale, Z, rcond=RANK_TOLERANCE)[0] / scale[:, None]


def _tail(arx: LPVARX, record: FlightRecord) -> Array:
    """The last complete samples of a record, as `RLSState.past` keeps them."""
    s = Samples.of(arx, record)
    table = np.hstack([s.y, s.u, s.p[:, None], s.f])[s.segments[-1]][-(arx.memory + 1) :]
    missing = np.flatnonzero(np.isnan(table).any(axis=1))
    return table[missing[-1] + 1 :] if len(missing) else table
