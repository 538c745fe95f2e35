"""Which orders and which degree: fits on data that were not used, beside information criteria."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from identification.estimators.estimate import fit
from identification.estimators.method import Method
from identification.judge.scores import predicted
from identification.model.lpvarx_model import LPVARXModel
from identification.model.prediction import named_fit
from identification.model.state_space_model import StateSpaceModel
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import as_records, stacked
from identification.structure.state_space import StateSpace
from symheli.errors import ExcitationError, InputError
from symheli.lpv import Polynomial
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.summary import summarized


@dataclass(frozen=True, eq=False, kw_only=True)
class ScannedOrder:
    """One structure of a scan: fits in percent by output, mean over validation records.

    Parameters
    ----------
    structure : LPVARX or StateSpace
        The one tried.
    bic : float
        Bayesian information criterion of the training residuals, smaller is better; NaN where
        refused.
    one_step, ahead, free_run : array (ny,)
        Fits one step, `OrderScan.horizon` samples and a free run ahead, %; NaN where refused, and
        where a validation record is too short for one.
    refused : str
        Why the data do not determine it, empty where they do.

    Examples
    --------
    >>> scan = idn.order_scan(arx, *record.split(0.6), orders=(1, 2), degrees=(0, 1), horizon=5)
    >>> trial = scan.trials[0]
    >>> trial.na, trial.degree, trial.one_step.shape
    (1, 0, (1,))
    """

    structure: LPVARX | StateSpace
    bic: float
    one_step: Array
    ahead: Array
    free_run: Array
    refused: str = ""

    __repr__ = summarized

    @property
    def na(self) -> int:
        """Order: lags, or states."""
        if isinstance(self.structure, StateSpace):
            return self.structure.order
        return int(self.structure.na)  # type: ignore[arg-type]

    @property
    def degree(self) -> int:
        """Degree of the coefficients."""
        return self.structure.basis.size - 1


@dataclass(frozen=True, eq=False)
class OrderScan:
    """All structures tried in a scan; `str()` is a table.

    Parameters
    ----------
    trials : tuple of ScannedOrder
        Order by order, degree by degree.
    horizon : int
        Samples ahead of the middle fit.

    Examples
    --------
    >>> scan = idn.order_scan(arx, *record.split(0.6), orders=(1, 2), degrees=(0, 1), horizon=5)
    >>> scan.best().na, scan.best().degree
    (1, 1)
    """

    trials: tuple[ScannedOrder, ...]
    horizon: int

    __repr__ = summarized

    def best(self, by: str = "ahead") -> ScannedOrder:
        """The trial of the largest median fit over the outputs "one_step", "ahead" or in
        "free_run"; or of the least "bic".

        Raises `ExcitationError` where the data determine none, `InputError` where no trial has such
        a fit: validation records are too short for it.
        """
        tried = [t for t in self.trials if not t.refused]
        if not tried:
            raise ExcitationError(
                f"the data determine none of the structures: {self.trials[0].refused}"
            )
        if by == "bic":
            return min(tried, key=lambda t: t.bic)
        if by not in ("one_step", "ahead", "free_run"):
            raise InputError(f'by: expected "one_step", "ahead", "free_run" or "bic", got {by!r}')
        fits = [(float(np.median(getattr(t, by))), t) for t in tried]
        known = [each for each in fits if not np.isnan(each[0])]
        if not known:
            raise InputError(
                f"by: no trial has a fit {by!r}: the validation records are too short for it, or"
                " lack an output; scan with a shorter horizon, or on others"
            )
        return max(known, key=lambda each: each[0])[1]

    def __str__(self) -> str:
        outputs = self.trials[0].structure.outputs
        head = "  ".join(f"{y:>22s}" for y in outputs)
        lines = [
            (
                f"fit in percent: one step / {self.horizon} samples / free run (worse: below -1000,"
                " inf: diverges)"
            ),
            f"{'na':>3s} {'degree':>6s} {'BIC':>10s}  {head}",
        ]
        for t in self.trials:
            if t.refused:
                lines.append(f"{t.na:3d} {t.degree:6d} {'':>10s}  refused: {t.refused}")
                continue
            fits = "  ".join(
                " /".join(map(_cell, three))
                for three in zip(t.one_step, t.ahead, t.free_run, strict=True)
            )
            lines.append(f"{t.na:3d} {t.degree:6d} {t.bic:10.0f}  {fits}")
        return "\n".join(lines)


def _cell(fit: float) -> str:
    return (
        f"{fit:6.1f}" if fit > -1000 else f"{'worse':>6s}" if np.isfinite(fit) else f"{'inf':>6s}"
    )


def order_scan(
    structure: LPVARX | StateSpace,
    training: FlightRecord | Iterable[FlightRecord],
    validation: FlightRecord | Iterable[FlightRecord],
    *,
    orders: Sequence[int] = (1, 2, 3, 4),
    degrees: Sequence[int] = (0, 1, 2, 3),
    horizon: int = 50,
    hold_p: bool = False,
    method: Method | str | None = None,
) -> OrderScan:
    """Fit a structure with every order na = nb, or number of states, and every polynomial degree,
    and score it on other records.

    Parameters
    ----------
    structure : LPVARX or StateSpace
        Its basis a polynomial of one parameter; nb follows na.
    training, validation : FlightRecord or iterable of FlightRecord
        To fit and to score.
    orders, degrees : sequence of int
        Degree 0 is the LTI model.
    horizon : int
        Samples ahead of the middle fit.
    hold_p : bool
        As in `LPVARXModel.predict`: for a measured p; not of states.
    method : Method or str, optional
        As of `fit`; default "ls", of states "subspace".

    Returns
    -------
    OrderScan
        `best()` of it, or `str()` for a table.

    Raises
    ------
    InputError
        The basis is no polynomial of one parameter.

    See Also
    --------
    identification.fit : coefficients from records
    identification.scores : one step ahead to free run
    identification.residual_analysis : whiteness and correlations

    References
    ----------
    Schwarz (1978), Estimating the dimension of a model, Annals of Statistics 6 (the criterion).

    Examples
    --------
    >>> training, validation = record.split(0.6)
    >>> scan = idn.order_scan(arx, training, validation, orders=(1,), degrees=(0, 1), horizon=5)
    >>> [trial.degree for trial in scan.trials], scan.best().degree
    ([0, 1], 1)
    """
    basis = structure.basis
    if not isinstance(basis, Polynomial):
        raise InputError(
            f"an order scan varies the degree of a polynomial basis; this one is {basis}"
        )
    if not (orders and degrees):
        raise InputError("orders, degrees: name at least one of each")
    train, test = as_records(training), as_records(validation)
    trials = []
    states = isinstance(structure, StateSpace)
    for degree, na in product(degrees, orders):
        trial = replace(structure, basis=Polynomial(degree, basis.low, basis.high))
        if isinstance(trial, StateSpace):
            trial = replace(trial, order=na)
        else:
            trial = replace(trial, na=na, nb=na if trial.inputs else 0)
        how = method or ("subspace" if states else "ls")
        trials.append(_judge(trial, train, test, horizon, hold_p, how))
    return OrderScan(tuple(trials), horizon)


def _judge(
    structure: LPVARX | StateSpace,
    train: Sequence[FlightRecord],
    test: Sequence[FlightRecord],
    horizon: int,
    hold_p: bool,
    method: Method | str,
) -> ScannedOrder:
    nothing = np.full(len(structure.outputs), np.nan)
    try:
        model: LPVARXModel | StateSpaceModel = fit(structure, train, method)  # type: ignore[arg-type]
    except ExcitationError as error:
        return ScannedOrder(
            structure=structure,
            bic=np.nan,
            one_step=nothing,
            ahead=nothing,
            free_run=nothing,
            refused=str(error),
        )
    n, covariance, unknowns = _left(model, train)
    sign, logdet = np.linalg.slogdet(covariance)
    bic = n * logdet + unknowns * np.log(n) if sign > 0 else -np.inf
    one_step, ahead, free_run = (
        np.mean(
            [
                named_fit(model.outputs, record, predicted(model, record, n, hold_p)).array
                for record in test
            ],
            axis=0,
        )
        for n in (1, horizon, None)
    )
    return ScannedOrder(
        structure=structure, bic=float(bic), one_step=one_step, ahead=ahead, free_run=free_run
    )


def _left(
    model: LPVARXModel | StateSpaceModel, train: Sequence[FlightRecord]
) -> tuple[int, Array, int]:
    """Number of residuals, their covariance (ny, ny), number of unknowns that show in them."""
    if isinstance(model, StateSpaceModel):
        count = model.run.size - model.run.undetermined
        return sum(map(len, train)), model.residual_covariance, count
    error = stacked(model.structure, train).residuals(model.theta)
    return len(error), error.T @ error / len(error), int(model.structure.free.sum())
