"""Comparison of experiments by the information of their records, within limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from identification.design.excitation import RANK_TOLERANCE, column_scale
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import as_records, regression
from symheli.errors import ExcitationError, InputError
from symheli.records import FlightRecord
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import positive, whole
from symheli.values.summary import summarized


@dataclass(frozen=True, eq=False)
class Experiment:
    """A candidate with its information.

    Parameters
    ----------
    name : str
        Of the candidate.
    duration : float
        s.
    factor : array (n, n)
        Upper triangular, with R' R = phi' phi, the information of the regressors (never squared: it
        would lose half its digits).
    exceeded : mapping
        {signal: largest value} beyond its limit.

    Raises
    ------
    InputError
        A factor that is not square or not finite, a duration that is not positive.

    Examples
    --------
    >>> whole, half = idn.design.compare_experiments(
    ...     arx, {"whole": record, "half": record.split(0.5)[0]}, limits={"y": 10.0}
    ... )
    >>> whole.name, whole.allowed, bool(np.all(whole.bounds < half.bounds))
    ('whole', True, True)
    """

    name: str
    duration: float
    factor: Array
    exceeded: Mapping[str, float]

    __repr__ = summarized

    def __post_init__(self) -> None:
        factor = frozen(self.factor, "factor", (None, None))
        if factor.shape[0] != factor.shape[1]:
            raise InputError(f"factor: expected a square matrix, got {factor.shape}")
        object.__setattr__(self, "factor", factor)
        object.__setattr__(self, "duration", positive(self.duration, "duration"))

    @property
    def allowed(self) -> bool:
        """Whether every limit is kept."""
        return not self.exceeded

    @property
    def bounds(self) -> Array:
        """(n,)"""
        return standard_errors(self.factor)


@dataclass(frozen=True, eq=False)
class Plan:
    """The chosen experiments in order.

    Parameters
    ----------
    experiments : tuple of Experiment
        The first is the best alone.
    gains : tuple of float
        The growth of log det of the information with each, per regressor, from the second on.

    Examples
    --------
    >>> early, late = record.split(0.5)
    >>> found = idn.design.compare_experiments(arx, {"early": early, "late": late}, limits={})
    >>> plan = idn.choose_experiments(found, 2)
    >>> len(plan.experiments), len(plan.gains), plan.bounds.shape
    (2, 1, (4,))
    """

    experiments: tuple[Experiment, ...]
    gains: tuple[float, ...]

    __repr__ = summarized

    @property
    def bounds(self) -> Array:
        """(n,)"""
        return standard_errors(_triangle(*(e.factor for e in self.experiments)))


def compare_experiments(
    structure: LPVARX, candidates: Mapping[str, FlightRecord], limits: Mapping[str, float]
) -> tuple[Experiment, ...]:
    """Compute the information in each candidate's record (simulated, or flown), for a structure
    whose equations share their regressors.

    Parameters
    ----------
    structure : LPVARX
        What is to be identified.
    candidates : mapping of str to FlightRecord
        By name.
    limits : mapping of str to float
        {signal: largest absolute value} in the units of the record.

    Returns
    -------
    tuple of Experiment
        Order as given.

    Raises
    ------
    InputError
        A record leaves the range of the basis.

    References
    ----------
    Morelli (2012), Flight test maneuvers for efficient aerodynamic modeling, J. Aircraft 49.

    Examples
    --------
    >>> (one,) = idn.design.compare_experiments(arx, {"flown": record}, limits={"u": 0.5})
    >>> one.allowed, list(one.exceeded)
    (False, ['u'])
    """
    if len(structure.groups) > 1:
        raise InputError(
            "compare_experiments needs equations that share their regressors; compare one output at"
            " a time"
        )
    records = dict(zip(candidates, as_records(candidates.values()), strict=True))
    out = []
    for name, record in records.items():
        exceeded = {}
        for signal, limit in limits.items():
            top = float(np.nanmax(np.abs(record[signal])))
            if top > limit:
                exceeded[signal] = top
        phi = regression(structure, record).phi
        out.append(
            Experiment(name, float(record.time[-1] - record.time[0]), _triangle(phi), exceeded)
        )
    return tuple(out)


def choose_experiments(experiments: tuple[Experiment, ...], count: int) -> Plan:
    """Choose the most informative of the allowed experiments one by one: each is the one that most
    increases log det of the information per second.

    A sequential D-optimal design: independent of the units of the coefficients.

    Parameters
    ----------
    experiments : tuple of Experiment
        The candidates.
    count : int
        At most so many.

    Returns
    -------
    Plan
        The chosen ones in order.

    Raises
    ------
    ExcitationError
        None is allowed.

    See Also
    --------
    identification.design.compare_experiments : all experiments, ranked
    symheli.Excitation : test signals on the inputs

    References
    ----------
    Fedorov (1972), Theory of Optimal Experiments; for flight tests Morelli (2012).

    Examples
    --------
    >>> quiet = record.with_signals({"u": "1", "y": "1"}, u=0.1 * record["u"], y=0.1 * record["y"])
    >>> found = idn.design.compare_experiments(arx, {"quiet": quiet, "loud": record}, limits={})
    >>> [e.name for e in idn.choose_experiments(found, 1).experiments]
    ['loud']
    """
    count = whole(count, "count", 1)
    left = [e for e in experiments if e.allowed]
    if not left:
        worst = "; ".join(f"{e.name}: {', '.join(e.exceeded)}" for e in experiments)
        raise ExcitationError(
            f"no candidate keeps its limits ({worst}); lower the amplitudes or widen the limits"
        )
    scale = np.maximum(
        np.max([np.linalg.norm(e.factor, axis=0) for e in left], axis=0), np.finfo(float).tiny
    )
    total, chosen, gains = np.zeros_like(left[0].factor), [], []
    for _ in range(min(count, len(left))):
        value = {e.name: _logdet(_triangle(total, e.factor) / scale) for e in left}
        start = _logdet(total / scale)
        best = max(left, key=lambda e: (value[e.name] - start) / e.duration)
        if chosen:
            gains.append((value[best.name] - start) / len(scale))
        chosen.append(best)
        left.remove(best)
        total = _triangle(total, best.factor)
    return Plan(tuple(chosen), tuple(gains))


def standard_errors(factor: Array) -> Array:
    """sqrt(diag((R'R)^-1)) (n,) of a factor R (n, n), infinite for coefficients whose direction it
    leaves open.
    """
    scale = column_scale(factor)
    _, values, directions = np.linalg.svd(factor / scale)
    open_ = values <= RANK_TOLERANCE * values[0]
    out = np.sqrt(np.sum((directions[~open_].T / values[~open_]) ** 2, axis=1)) / scale
    return np.where(np.any(np.abs(directions[open_]) > 1e-6, axis=0), np.inf, out)


def _triangle(*factors: Array) -> Array:
    """R (n, n) with R' R the sum of F' F of the factors (m, n)."""
    n = factors[0].shape[1]
    stacked = np.vstack([*factors, np.zeros((max(n - sum(map(len, factors)), 0), n))])
    return np.asarray(np.linalg.qr(stacked, mode="r"))


def _logdet(factor: Array) -> float:
    """Log determinant of R'R, singular values no lower than what rounding leaves of the largest
    possible one.
    """
    return float(
        2 * np.sum(np.log(np.maximum(np.linalg.svd(factor, compute_uv=False), RANK_TOLERANCE)))
    )
