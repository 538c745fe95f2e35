"""Whether the coefficients depend on p at other instants than the structure says."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import f as fisher

from identification.design.criterion import Criterion, concluded, judged
from identification.design.excitation import RANK_TOLERANCE, column_scale
from identification.model.lpvarx_model import LPVARXModel
from identification.structure.regressors import as_records, stacked
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.summary import summarized

SIGNIFICANT = 1e-3
"""A probability below this is not chance."""

WORTH = 0.01
"""Share of the residual; less than this is not worth another structure, however significant."""

MOST = 0.95
"""Share of the residual; what explains less may not be the whole story."""

ROUNDING = 1e-9
"""A residual below this fraction of the output is rounding: there is nothing left to explain."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DependenceReport:
    """How much of the one-step residuals p at other instants explains, one entry per output.

    Parameters
    ----------
    outputs : tuple of str
        ny names.
    at, other : str
        The instants of the model and those tried.
    residual : array (ny,)
        Root mean square as a fraction of that of the output.
    explained : array (ny,)
        Share of the squared residual in [0, 1].
    probability : array (ny,)
        That chance explains as much (F test, white residuals assumed).
    chance : array (ny,)
        Share that chance explains with probability 1e-3.

    Examples
    --------
    >>> report = idn.judge.dependence_report(model, record)
    >>> report.at, report.other, bool(report.explained[0] < 0.05)
    ('lag', 'now', True)
    """

    outputs: tuple[str, ...]
    at: str
    other: str
    residual: Array
    explained: Array
    probability: Array
    chance: Array

    __repr__ = summarized

    @property
    def criteria(self) -> tuple[Criterion, ...]:
        """Percent of the residual of each output that p at other instants explains."""
        other = {"lag": "p(k - lag)", "now": "p(k)"}[self.other]
        rows = zip(self.outputs, self.residual, self.explained, self.chance, strict=True)
        return tuple(
            judged(
                f"{output}: residual explained by {other}, %",
                100 * float(share),
                100 * max(WORTH, float(chance)),
                "fit" if residual <= ROUNDING else "not fit",
                where=f"residual {100 * residual:.3g} % of the output"
                + (": nothing left to explain" if residual <= ROUNDING else ""),
            )
            for output, residual, share, chance in rows
        )

    @property
    def dynamic(self) -> tuple[bool, ...]:
        """For which outputs the dependence on p is not the one of the structure."""
        return tuple(row.verdict == "not fit" for row in self.criteria)

    def __str__(self) -> str:
        rest = (
            "; the rest is noise, or dependence on several instants at once, which higher orders"
            " come nearer to"
        )
        advice = [
            f"{output}: the coefficients do NOT depend on p as the structure says; try"
            f' scheduling_at="{self.other}"{rest if explained < MOST else ""}'
            for output, explained, dynamic in zip(
                self.outputs, self.explained, self.dynamic, strict=True
            )
            if dynamic
        ]
        return "\n".join([concluded(self.criteria), *advice])


def dependence_report(
    model: LPVARXModel, records: FlightRecord | Iterable[FlightRecord]
) -> DependenceReport:
    """Test whether p at other instants explains the one-step residuals of a model: regress them on
    the same signals with the basis at p(k) for "lag", at p(k - lag) for "now".

    What a static dependence cannot express stays in the residual; where p moves slowly from sample
    to sample the two hardly differ and little can be seen. Only what the regressors of the model do
    not explain themselves counts.

    Parameters
    ----------
    model : LPVARXModel
        Fitted by any method.
    records : FlightRecord or iterable of FlightRecord
        Of its sample period and units.

    Returns
    -------
    DependenceReport
        `str()` of it is a table, one row an output.

    Raises
    ------
    InputError
        Another sample period or unit, coefficients that leave residuals beyond all measure.

    Examples
    --------
    >>> print(idn.judge.dependence_report(model, record).dynamic)
    (False,)
    """
    arx, records = model.structure, as_records(records)
    for record in records:
        model.require_same_kind(record)
    other = replace(arx, scheduling_at="now" if arx.scheduling_at == "lag" else "lag")
    data, extra = stacked(arx, records), stacked(other, records)
    common, of_data, theirs = np.intersect1d(data.rows, extra.rows, return_indices=True)
    phi, y, psi = data.phi[of_data], data.y[of_data], extra.phi[theirs]
    error, m = data.residuals(model.theta)[of_data], len(common)
    explained, probability, chance = np.zeros(arx.ny), np.ones(arx.ny), np.ones(arx.ny)
    for group in arx.groups:
        regressors = arx.regressors(group)
        Q = _range(phi[:, regressors])
        new = psi[:, regressors] - Q @ (Q.T @ psi[:, regressors])
        P = _range(new, psi[:, regressors])
        left = m - Q.shape[1] - P.shape[1]
        for output in group.outputs:
            total, gained = (
                float(error[:, output] @ error[:, output]),
                float(np.sum((P.T @ error[:, output]) ** 2)),
            )
            if P.shape[1] and left > 0 and total > 0:
                explained[output] = gained / total
                statistic = (gained / P.shape[1]) / max(
                    (total - gained) / left, np.finfo(float).tiny
                )
                probability[output] = fisher.sf(statistic, P.shape[1], left)
                likely = P.shape[1] * fisher.isf(SIGNIFICANT, P.shape[1], left)
                chance[output] = likely / (likely + left)
    size = np.sqrt(np.mean(y**2, axis=0))
    residual = np.sqrt(np.mean(error**2, axis=0)) / np.where(size > 0, size, 1.0)
    return DependenceReport(
        outputs=arx.outputs,
        at=arx.scheduling_at,
        other=other.scheduling_at,
        residual=residual,
        explained=explained,
        probability=probability,
        chance=chance,
    )


def _range(X: Array, measure: Array | None = None) -> Array:
    """Orthonormal basis of the columns of X; what is rounding beside the columns of `measure`
    (default X) is dropped.
    """
    U, values, _ = np.linalg.svd(
        X / column_scale(X if measure is None else measure), full_matrices=False
    )
    return U[:, values > RANK_TOLERANCE * max(values[0], 1.0)] if len(values) else U
