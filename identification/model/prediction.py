"""Predictions of a model along a record: h steps ahead, or in free run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.model.coefficients import Coefficients
from identification.model.noise_model import NoiseModel
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Samples, regressor_rows
from symheli.errors import InputError
from symheli.records import FlightRecord
from symheli.values import NamedVector, Signal
from symheli.values.arrays import Array
from symheli.values.runs import runs

DIVERGED = 1e100
"""A response beyond this is reported as infinite."""


@dataclass(frozen=True, eq=False)
class OutputRecursion:
    """y(k) = -sum_i A[k, i-1] y(k-i) + known[k] along a record: A (n, na, ny, ny), known (n, ny),
    NaN without a full past.
    """

    y: Array
    A: Array
    known: Array
    segments: tuple[slice, ...]
    memory: int

    @classmethod
    def along(cls, arx: LPVARX, theta: Array, record: FlightRecord) -> OutputRecursion:
        """Return the coefficients at every sample of `record`, and the contribution of inputs and
        scheduling.
        """
        s = Samples.of(arx, record)
        n, na, split = (
            len(record),
            len(arx.output_lags),
            sum(len(t.signals) for t in arx.terms if t.kind == "output") * arx.basis.size,
        )
        by_lag = Coefficients.of(arx, theta).A
        A, known = np.full((n, na, arx.ny, arx.ny), np.nan), np.full((n, arx.ny), np.nan)
        for part in s.segments:
            rows = slice(part.start + arx.memory, part.stop)
            if rows.start >= rows.stop:
                continue
            exogenous = regressor_rows(
                arx,
                s.y[part],
                s.u[part],
                s.p[part],
                s.f[part],
                kinds=("input", "offset", "increment"),
            )
            known[rows] = exogenous @ theta[split:]
            for i in arx.output_lags:
                back = i if arx.scheduling_at == "lag" else 0
                A[rows, i - 1] = np.tensordot(
                    s.f[rows.start - back : rows.stop - back], by_lag[i - 1], axes=1
                )
        return cls(s.y, A, known, s.segments, arx.memory)

    @property
    def na(self) -> int:
        """Number of output lags."""
        return self.A.shape[1]


def predict(run: OutputRecursion, horizon: int, noise: NoiseModel | None = None) -> Array:
    """Predictions (n, ny) of y(t) from outputs up to t - horizon, inputs and p up to t; NaN where
    not available.

    All starts advance together: P_j(t) = known(t) + v_j(t) - sum_i A_i(t) P_{max(j-i, 0)}(t-i),
    where P_0 = y and P_j(t) is the prediction of y(t) made j steps before, v_j(t) that of what the
    equation leaves. With noise at the outputs it is the free run and the prediction of what it
    leaves.
    """
    require_horizon(horizon)
    if noise is not None and noise.enters == "output":
        free = simulate(run)
        return free + _expected(noise, run.y - free, int(horizon))
    if horizon >= max(part.stop - part.start for part in run.segments):
        return np.full_like(run.y, np.nan)
    ahead, left = [run.y], None if noise is None else run.y - predict(run, 1)
    with np.errstate(all="ignore"):
        for j in range(1, int(horizon) + 1):
            new = run.known.copy()
            if noise is not None and left is not None:
                new += _expected(noise, left, j)
            for i in range(1, run.na + 1):
                past = ahead[max(j - i, 0) - j]  # P_{j-1} is ahead[-1]
                new[i:] -= np.einsum("kij,kj->ki", run.A[i:, i - 1], past[:-i])
            ahead = [*ahead, np.clip(new, -DIVERGED, DIVERGED)][-(run.na + 1) :]
    return _flagged(ahead[-1])


def _expected(noise: NoiseModel, v: Array, horizon: int) -> Array:
    """(n, ny) what noise v makes expect; NaN, behind which it starts from rest, where v is."""
    out = np.full_like(v, np.nan)
    for start, stop in runs(np.asarray(np.isfinite(v).all(axis=1))):
        out[start:stop] = noise.ahead(v[start:stop], horizon)
    return out


def predict_holding(arx: LPVARX, theta: Array, record: FlightRecord, horizon: int) -> Array:
    """Return predictions (n, ny) of y(t) from outputs and p up to t - horizon and inputs up to t, p
    held at its last known value.

    As an autopilot predicts that schedules on a measurement: the coefficients stay, and p does not
    change. NaN as in `predict`.
    """
    require_horizon(horizon)
    s, starts = Samples.of(arx, record), _starts(arx, record.segments(), horizon)
    if not len(starts):
        return np.full_like(s.y, np.nan)
    size, ahead = arx.basis.size, np.full((horizon + 1, len(starts), arx.ny), np.nan)
    with np.errstate(all="ignore"):
        for j in range(1, horizon + 1):
            new, row = np.zeros((len(starts), arx.ny)), 0
            for term in arx.terms:
                count, step = len(term.signals), j - term.lag
                block, row = (
                    theta[row : row + count * size].reshape(count, size, arx.ny),
                    row + count * size,
                )
                match term.kind:
                    case "output":
                        signal = -(s.y[starts + step] if step <= 0 else ahead[step])[
                            :, list(term.signals)
                        ]
                    case "input":
                        signal = s.u[starts + step][:, list(term.signals)]
                    case "offset":
                        signal = np.ones((len(starts), 1))
                    case "increment":
                        continue
                new += np.einsum(
                    "ks,kf,sfy->ky",
                    signal,
                    s.f[starts + min(j - term.p_lag, 0)],
                    block,
                    optimize=True,
                )
            ahead[j] = np.clip(new, -DIVERGED, DIVERGED)
    out = np.full_like(s.y, np.nan)
    out[starts + horizon] = ahead[horizon]
    return _flagged(out)


def _starts(arx: LPVARX, segments: tuple[slice, ...], horizon: int) -> Array:
    """The last known sample of every prediction that has a past and an end in one segment."""
    parts = [
        np.arange(part.start + max(arx.memory - 1, 0), part.stop - horizon) for part in segments
    ]
    return np.concatenate(parts).astype(int)


def require_horizon(horizon: object) -> None:
    """Raises `InputError` unless `horizon` is a number of steps."""
    if not isinstance(horizon, int | np.integer) or isinstance(horizon, bool) or horizon < 1:
        raise InputError(
            f"horizon: expected a whole number of steps >= 1, got {horizon!r}; a free run is"
            " simulate()"
        )


def simulate(run: OutputRecursion) -> Array:
    """Free response (n, ny): each segment starts from its first measured outputs, then only inputs
    and p are used.

    NaN before a run has its initial outputs and where inputs or p are missing (it starts again,
    from measured outputs, behind them); a run that diverges is infinite from there to the end of
    its segment.
    """
    out = np.full_like(run.y, np.nan)
    with np.errstate(all="ignore"):
        for part in run.segments:
            _free_run(run, part, out)
    return _flagged(out)


def _free_run(run: OutputRecursion, part: slice, out: Array) -> None:
    na, ny = run.na, run.y.shape[1]
    A = run.A.transpose(0, 2, 1, 3).reshape(len(run.y), ny, na * ny)
    past, alive = np.zeros(na * ny), False
    known = np.asarray(np.isfinite(run.known).all(axis=1))
    for k in range(part.start + run.memory, part.stop):
        if not known[k]:
            alive = False
            continue
        if not alive:
            past = run.y[k - na : k][::-1].reshape(-1).copy()
            alive = bool(np.isfinite(past).all() and np.isfinite(A[k]).all())
            if not alive:
                continue
        y = run.known[k] - A[k] @ past
        if not np.all(np.abs(y) < DIVERGED):
            out[k : part.stop] = np.inf
            return
        out[k] = y
        past[ny:] = past[:-ny].copy()
        past[:ny] = y[: len(past)]


def _flagged(y: Array) -> Array:
    return np.where(np.abs(y) >= DIVERGED, np.inf, y)


LARGEST = 1e150
"""Largest measurement: the square of a larger one may overflow."""


def named_fit(outputs: Sequence[Signal], record: FlightRecord, guess: Array) -> NamedVector:
    """`fit_percent` of a prediction (n, ny) of the `outputs` of a record, by name."""
    fit = fit_percent(record.columns(outputs), guess)
    return NamedVector(tuple(Signal(s, "%") for s in outputs), fit)


def fit_percent(y: object, yhat: object) -> Array:
    """100 (1 - |y - yhat| / |y - mean y|) per output: 100 is perfect, 0 no better than the mean.

    Parameters
    ----------
    y, yhat : array (n, ny) or (n,)
        Measured and predicted. Rows where either is NaN are left out, output by output.

    Returns
    -------
    array (ny,)
        Dimensionless; -inf where yhat diverged, NaN where no row is left.

    Raises
    ------
    InputError
        The shapes differ, or a measurement is infinite or too large to be squared.

    References
    ----------
    Ljung (1999), System Identification (the normalised fit of the MATLAB toolbox).

    Examples
    --------
    >>> print(idn.judge.fit_percent([1.0, 2.0, 3.0], [1.0, 2.0, 2.5]).round(1))
    [64.6]
    """
    y, yhat = np.asarray(y, float), np.asarray(yhat, float)
    if y.shape != yhat.shape or y.ndim not in (1, 2):
        raise InputError(
            f"expected two arrays of one shape (n, outputs), got {y.shape} and {yhat.shape}"
        )
    if np.any(np.abs(y) >= LARGEST):
        raise InputError(
            f"y: expected measurements below {LARGEST:.0e} in magnitude; mark bad samples as NaN"
        )
    columns = zip(y.reshape(len(y), -1).T, yhat.reshape(len(y), -1).T, strict=True)
    return np.array([_fit(a, b) for a, b in columns])


def _fit(y: Array, yhat: Array) -> float:
    keep = ~(np.isnan(y) | np.isnan(yhat))
    if not keep.any():
        return float("nan")
    y, yhat = y[keep], yhat[keep]
    if np.any(np.abs(yhat) >= LARGEST):
        return float("-inf")
    error, spread = np.linalg.norm(y - yhat), np.linalg.norm(y - y.mean())
    if spread == 0:
        return 100.0 if error == 0 else float("-inf")
    return float(100.0 * (1.0 - error / spread))
