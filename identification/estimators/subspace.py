"""Subspace identification of LPV state-space models: a predictor with long past, its state by
singular values, the matrices by least squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.linalg import eigh

from identification.estimators.method import Estimate, Method
from identification.model.state_space_model import spread_of
from identification.model.state_space_run import StateSpaceRun
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Regression, basis_values
from identification.structure.state_space import StateSpace
from symheli.errors import ExcitationError, InputError
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.numbers import whole

LANDMARKS = 600
"""Largest number of windows that span the predictor; other windows are seen through these."""

MOVING = 0.15
"""Weight of what moves with p beside what is constant, lag by lag."""

DROPPED = 1e-12
"""Share of the largest eigenvalue below which a direction of the predictor is left out."""

WEIGHTS = np.logspace(-14, 1, 31)
"""Weights of the ridge, of the largest eigenvalue, among which cross-validation chooses."""

BRIDGED = 5
"""Longest gap in an output, in samples, that the start looks across."""

SMALL = 1e-4
"""Innovations below this share of an output's spread hardly enter the gain K."""


@dataclass(frozen=True)
class Subspace(Method):
    """Subspace method of a `StateSpace`: a predictor from a long past, whose response after the
    present has the state as its coordinates. Consistent in closed loop; needs no start.

    The predictor contains all products of p along the past; it is found in its dual form, with a
    ridge whose weight generalised cross-validation chooses. The state are the largest singular
    values of the response that it gives without further inputs, p held.

    Parameters
    ----------
    past : int, optional
        Samples of the past; default twice the order, at least 12, and fewer where gaps leave too
        few windows of these.

    Raises
    ------
    InputError
        A past below 1.

    References
    ----------
    van Wingerden and Verhaegen (2009), Subspace identification of bilinear and LPV systems for
    open- and closed-loop data, Automatica 45, 372-381.

    Examples
    --------
    >>> found = idn.fit(idn.StateSpace("y", "u", order=2), record, idn.methods.Subspace(past=8))
    >>> len(found.details["singular_values"])
    4
    """

    past: int | None = field(default=None, kw_only=True)
    shorthand: ClassVar[str] = "subspace"
    of_states: ClassVar[bool] = True
    needs_excitation: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if self.past is not None:
            whole(self.past, "past", 1)

    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """Raise `InputError`: there are no states to find in a difference equation."""
        raise InputError(
            f"method {self.shorthand!r} finds states: fit a StateSpace(...), got an LPVARX"
        )


class Piece(NamedTuple):
    """An unbroken stretch of outputs (m, ny), inputs (m, nu) and p."""

    y: Array
    u: Array
    p: Array


class Start(NamedTuple):
    """Unknowns with K, as `StateSpaceRun` orders them, and the singular values of the states."""

    unknowns: Array
    singular_values: Array


def subspace_start(structure: StateSpace, pieces: Sequence[Piece], past: int | None) -> Start:
    """The matrices by the subspace method, from stretches of records.

    Raises `ExcitationError` where no stretch is long enough.
    """
    nx, ny = structure.order, len(structure.outputs)
    least, chosen = -(-nx // ny), past is not None
    past = max(2 * nx, 12) if past is None else past
    data = _Data.of(structure, pieces, past)
    while (steps := int(np.sum(np.diff(data.rows) == 1))) < 2 * nx + 2:
        if chosen or past == least:
            shorter = ", or give Subspace(past=...) a shorter past" if chosen else ""
            raise ExcitationError(
                f"{steps} windows of {past + 2} samples without a gap are too few for"
                f" {nx} states: record longer, with fewer gaps, or take fewer states{shorter}"
            )
        past = max(2 * past // 3, least)
        data = _Data.of(structure, pieces, past)
    future = max(least + 1, past // 2)
    response = _responses(structure, data, past, min(future, past))
    _, singular, V = np.linalg.svd(response, full_matrices=False)
    if len(singular) < nx:
        raise InputError(f"past: expected at least {-(-nx // ny)} samples for {nx} states")
    x = response @ V[:nx].T / np.sqrt(len(response))
    x = x / np.sqrt(np.maximum(singular[:nx] / np.sqrt(len(response)), np.finfo(float).tiny))
    return Start(_matrices(structure, data, x), singular / singular[0])


class _Data(NamedTuple):
    """Stretches one after the other: functions `mu` (n, m) with the constant first and signals z
    (n, nz), scaled; outputs, inputs, f as they are; `rows` that have a complete past.
    """

    mu: Array
    z: Array
    y: Array
    u: Array
    f: Array
    rows: Array
    scale: Array

    @classmethod
    def of(cls, structure: StateSpace, pieces: Sequence[Piece], past: int) -> _Data:
        y = np.concatenate([_bridged(piece.y) for piece in pieces])
        u = np.concatenate([piece.u for piece in pieces])
        p = np.concatenate([piece.p for piece in pieces])
        if structure.own_scheduling:
            p = np.clip(p, *structure.basis.ranges[0])
        f = basis_values(structure.regression, p)
        known = np.asarray(np.isfinite(y).all(axis=1) & np.isfinite(f).all(axis=1))
        before = np.full(len(y), -1)  # the last sample that is not in a row with this one
        starts = np.cumsum([0, *(len(piece.y) for piece in pieces)])[:-1]
        before[starts] = starts - 1
        before[~known] = np.flatnonzero(~known)
        run = np.arange(len(y)) - np.maximum.accumulate(before)
        scale = spread_of(y)
        signals = np.column_stack([np.nan_to_num(y) / scale, _scaled(u)])
        if structure.offset:
            signals = np.column_stack([signals, np.ones(len(y))])
        moving = np.where(known[:, None], f, 0.0)
        moving = moving - moving[known].mean(axis=0)
        U, s, _ = np.linalg.svd(np.where(known[:, None], moving, 0.0), full_matrices=False)
        kept = s > 1e-9 * max(s.max(initial=0.0), 1e-300)
        kept &= s > 1e-9 * np.sqrt(len(y))
        mu = np.column_stack([np.ones(len(y)), MOVING * np.sqrt(known.sum()) * U[:, kept]])
        return cls(mu, signals, y, u, f, np.flatnonzero(run > past), scale)


def _bridged(y: Array) -> Array:
    """Outputs (m, ny) with short gaps filled by straight lines: a slow sensor has one each time."""
    out = y.copy()
    for column in out.T:
        known = np.flatnonzero(np.isfinite(column))
        for a, b in pairwise(known.tolist()):
            if 1 < b - a <= BRIDGED + 1:
                column[a:b] = np.linspace(column[a], column[b], b - a + 1)[:-1]
    return out


def _scaled(u: Array) -> Array:
    size = np.sqrt(np.mean(u**2, axis=0))
    return u / np.where(size > 0, size, 1.0)


def _responses(structure: StateSpace, data: _Data, past: int, future: int) -> Array:
    """(rows, future ny) outputs, in their spreads, that the predictor gives from the past of each
    row on, without further signals and p at its mean.
    """
    rows = data.rows
    marks = rows[np.linspace(0, len(rows) - 1, min(len(rows), LANDMARKS)).astype(int)]
    kernel = _kernel(data, rows, marks, past, 0)
    own = _kernel(data, marks, marks, past, 0)
    values, vectors = eigh(0.5 * (own + own.T))
    kept = values > DROPPED * values[-1]
    to_features = vectors[:, kept] / np.sqrt(values[kept])
    phi = kernel @ to_features
    through = _scaled(data.u)[rows] if structure.feedthrough else np.zeros((len(rows), 0))
    theta = _ridge(np.column_stack([phi, through]), data.y[rows] / data.scale)
    theta = theta[: phi.shape[1]]
    later = [_kernel(data, rows, marks, past, i) @ (to_features @ theta) for i in range(1, future)]
    return np.column_stack([phi @ theta, *later])


def _kernel(data: _Data, rows: Array, marks: Array, past: int, shift: int) -> Array:
    """(rows, marks) products of windows: of `rows`, followed by `shift` samples without signals and
    with p at its mean, and of `marks`.
    """
    out, product = np.zeros((len(rows), len(marks))), np.ones((len(rows), len(marks)))
    for j in range(1, past - shift + 1):
        mine, other = rows - j, marks - j - shift
        product *= data.mu[mine] @ data.mu[other].T
        out += product * (data.z[mine] @ data.z[other].T)
    return out


def _ridge(phi: Array, y: Array) -> Array:
    """Coefficients (n, ny) by ridge regression, its weight by generalised cross-validation.

    What is left and its freedom are sums of positive parts: where the features are as many as the
    samples both vanish with the weight, and differences of large numbers would choose it.
    """
    values, vectors = eigh(phi.T @ phi)
    across = vectors.T @ (phi.T @ y)
    seen = values > np.finfo(float).eps * values[-1]
    values, vectors, across = values[seen], vectors[:, seen], across[seen]
    total, power = float(np.sum(y**2)), np.sum(across**2, axis=1) / values
    beside = max(total - float(np.sum(power)), 0.0)
    spare, best = max(len(y) - len(values), 0), (np.inf, 0.0)
    for weight in WEIGHTS * values[-1]:
        share = weight / (values + weight)
        left, freedom = beside + float(share**2 @ power), spare + float(np.sum(share))
        best = min(best, (max(left, 1e-14 * total) / freedom**2, float(weight)))
    return vectors @ (across / (values + best[1])[:, None])


def _matrices(structure: StateSpace, data: _Data, x: Array) -> Array:
    """The unknowns by least squares from states x at `data.rows`."""
    rows, run = data.rows, StateSpaceRun(structure, innovations=True)
    y, u, f = data.y[rows], data.u[rows], data.f[rows]
    through = u if structure.feedthrough else u[:, :0]
    seen = np.column_stack([x, through])
    CD = np.linalg.lstsq(seen, y, rcond=None)[0].T
    e = y - seen @ CD.T
    driven = np.column_stack([u, np.ones(len(u))]) if structure.offset else u
    follows = np.flatnonzero(np.diff(rows) == 1)
    blocks = [
        (f[follows, :, None] * signal[follows, None, :]).reshape(len(follows), -1)
        for signal in (x, driven, e)
    ]
    nx, n, ny = structure.order, f.shape[1], y.shape[1]
    held = SMALL * np.sqrt(len(follows)) * np.tile(data.scale, n)
    phi = np.vstack([np.hstack(blocks), np.zeros((len(held), sum(b.shape[1] for b in blocks)))])
    phi[len(follows) :, -len(held) :] = np.diag(held)
    target = np.vstack([x[follows + 1], np.zeros((len(held), nx))])
    size = np.linalg.norm(phi, axis=0)
    size = np.where(size > 0, size, 1.0)
    ABK = np.linalg.lstsq(phi / size, target, rcond=1e-10)[0] / size[:, None]
    ends = np.cumsum([b.shape[1] for b in blocks])[:-1]
    A, B, K = (part.reshape(n, -1, nx).transpose(0, 2, 1) for part in np.split(ABK, ends))
    assert K.shape[2] == ny  # noqa: S101
    return run.unknowns(A, B, CD[:, :nx], CD[:, nx:], K)
