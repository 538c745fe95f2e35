"""From records to a model, by the method of choice."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from typing import Any, Literal

import numpy as np

from identification.design.excitation import excitation_of
from identification.design.leakage import warn_of_leakage
from identification.estimators.first_stage import WEAK, FirstStage
from identification.estimators.instrumental_variables import (
    Instruments,
    explained,
    instrumental_variables,
)
from identification.estimators.lasso import Lasso, lasso
from identification.estimators.least_squares import least_squares_by_group, residual_covariance
from identification.estimators.output_error import OutputError, output_error
from identification.estimators.refined_instruments import Refined, refined_instruments
from identification.estimators.ridge import Ridge, ridge
from identification.estimators.self_check import check_least_squares, check_recursion
from identification.model.lpvarx_model import LPVARXModel
from identification.recursive.forgetting import Constant, Forgetting
from identification.recursive.recursive_least_squares import RecursiveLeastSquares
from identification.structure.lpvarx import LPVARX, require_structure
from identification.structure.regressors import Regression, as_records, stacked, units_of
from symheli.errors import (
    ConvergenceWarning,
    DataWarning,
    ExcitationError,
    InputError,
    UnknownNameError,
)
from symheli.records import FlightRecord
from symheli.values.arrays import Array

Method = Literal["ls", "rls", "ridge", "lasso", "iv", "riv", "oe"]
Options = Ridge | Lasso | Refined | OutputError
METHODS: tuple[str, ...] = ("ls", "rls", "ridge", "lasso", "iv", "riv", "oe")
OPTIONS: dict[str, type[Options]] = {
    "ridge": Ridge,
    "lasso": Lasso,
    "riv": Refined,
    "oe": OutputError,
}
NOT_SETTLED = {
    "riv": (
        'a plant that is unstable in open loop needs instruments=("name", ...), the external'
        ' excitation; where the model is simpler than the plant, method "iv" is the better one'
    ),
    "oe": "allow more evaluations, or fit a smaller structure",
}
"""What to try where an iteration stops early."""

PENALISED = ("ridge", "lasso")
"""Methods whose penalty decides what the data leave open: the excitation report travels with the
model and refuses nothing.
"""

NOISE_FREE = 1e-6
"""A residual below this part of every output biases no estimate."""

TINY = np.finfo(float).tiny


def fit(
    structure: LPVARX,
    records: FlightRecord | Iterable[FlightRecord],
    method: Method = "ls",
    *,
    forgetting: float | Forgetting = 1.0,
    instruments: Sequence[str] | Instruments = (),
    options: Options | None = None,
) -> LPVARXModel:
    """Identify the coefficients of `structure` from one record or several (same sample period and
    units).

    "ls": least squares over all samples. "rls": the same, sample by sample, the older ones weighted
    by `forgetting` to the power of their age, or as `Constant`, `Variable`, `Directional` say.
    "ridge", "lasso": with a price on coefficients (options `Ridge`, `Lasso`). Noise on the outputs
    biases all of these.

    "iv": instrumental variables: `instruments` names the external excitation signals (or is an
    `Instruments` with its window): in closed loop what is added to the stabilised inputs, in open
    loop the inputs; `details["first_stage_F"]` says how strong they are. "riv": the same refined
    with the simulated response (`Refined`); in closed loop it needs `instruments` too, and then the
    plant may be unstable. "oe": the closest free run (`OutputError`), from the least-squares or
    (with `instruments`) instrumental-variables estimate and its refinement; in closed loop coloured
    noise biases it.

    Raises `ExcitationError` (with a report) where the data cannot determine every coefficient
    (ridge and lasso: where the penalty does not either), `UnknownNameError` for signals the record
    lacks, `InputError` where p leaves the range of the basis or an option does not fit the method,
    `AccuracyError` where "ls" or "rls" fail the check that their residual is orthogonal to every
    regressor. Warns (`ConvergenceWarning`) where an iteration does not settle, and (`DataWarning`)
    where the scheduling signal tells the model its own answer, the samples are means and the delay
    is not 0, or instruments are weak.
    """
    require_structure(structure)
    records = as_records(records)
    _check(method, forgetting, instruments, options)
    outputs, inputs = units_of(structure.outputs, records), units_of(structure.inputs, records)
    scheduling = units_of(structure.parameters, records)
    warn_of_leakage(structure, records)
    data = stacked(structure, records)
    report = excitation_of(structure, data)
    if method not in PENALISED or len(data.phi) == 0:
        report.require()
    chosen = options or (OPTIONS[method]() if method in OPTIONS else None)
    covariance, details = None, {}
    match chosen:
        case Ridge():
            theta, weights = ridge(structure, data, chosen)
            details = {"weight": weights.tolist(), "towards": chosen.towards}
        case Lasso():
            theta, weights = lasso(structure, data, chosen)
            details = {"weight": weights.tolist(), "kept": np.count_nonzero(theta, axis=0).tolist()}
        case Refined():
            theta, details = _refined(structure, records, data, instruments, chosen)
        case OutputError():
            theta, details = _output_error(structure, records, data, instruments, chosen)
        case _ if method == "rls":
            theta, covariance = _recursive(structure, data, forgetting)
            if forgetting == 1.0 or forgetting == Constant(1.0):
                check_least_squares(structure, data.phi, data.y, theta, method)
        case _ if method == "iv":
            theta, weakest = instrumental_variables(
                structure, records, data, Instruments.of(instruments)
            )
            details = {"first_stage_F": weakest.F, "weakest": weakest.direction}
            _warn_of_weakness(
                weakest,
                np.sqrt(
                    np.mean((data.y - data.phi @ theta) ** 2, axis=0)
                    / np.mean(data.y**2, axis=0).clip(TINY)
                ),
            )
        case _:
            theta = least_squares_by_group(structure, data.phi, data.y)
            check_least_squares(structure, data.phi, data.y, theta, method)
    if not details.get("converged", True):
        warnings.warn(
            f"{method!r} did not settle: {NOT_SETTLED[method]}", ConvergenceWarning, stacklevel=2
        )
    if covariance is None:
        covariance = residual_covariance(structure, data.phi, data.y, theta)
    return LPVARXModel(
        structure,
        theta,
        records[0].dt,
        outputs,
        inputs,
        scheduling,
        covariance,
        len(data.phi),
        data.dropped,
        method,
        report,
        details,
    )


def _check(
    method: str,
    forgetting: float | Forgetting,
    instruments: Sequence[str] | Instruments,
    options: Options | None,
) -> None:
    if method not in METHODS:
        raise UnknownNameError("method", method, METHODS)
    if method != "rls" and forgetting != 1.0:
        raise InputError(f'forgetting is for method="rls"; {method!r} weighs all samples alike')
    if method not in ("iv", "riv", "oe") and instruments:
        raise InputError(f'instruments are for method="iv", "riv" and "oe", not {method!r}')
    wanted = OPTIONS.get(method)
    if options is not None and (wanted is None or not isinstance(options, wanted)):
        expected = f"{wanted.__name__}(...)" if wanted else "none"
        raise InputError(f"options of method {method!r}: expected {expected}, got {options!r:.80}")


def _warn_of_weakness(weakest: FirstStage, residual: Array) -> None:
    if weakest.F < WEAK and np.any(residual > NOISE_FREE):
        warnings.warn(
            f"the instruments are weak (first-stage F {weakest.F:.2g}, usual least {WEAK:g}): along"
            f" {weakest.direction} the estimate is nearly as biased as least squares; excite more,"
            " name more instruments, widen their window, or lower the order or the degree",
            DataWarning,
            stacklevel=3,
        )


def _start(
    structure: LPVARX,
    records: Sequence[FlightRecord],
    data: Regression,
    instruments: Sequence[str] | Instruments,
) -> Array:
    if instruments:
        return instrumental_variables(structure, records, data, Instruments.of(instruments))[0]
    return least_squares_by_group(structure, data.phi, data.y)


def _refined(
    structure: LPVARX,
    records: Sequence[FlightRecord],
    data: Regression,
    instruments: Sequence[str] | Instruments,
    options: Refined,
) -> tuple[Array, dict[str, Any]]:
    start, exogenous = _start(structure, records, data, instruments), None
    if instruments:
        records, exogenous = explained(structure, records, Instruments.of(instruments))
    found = refined_instruments(structure, records, exogenous, start, options)
    return found.theta, {
        "iterations": found.iterations,
        "converged": found.converged,
        "noise": found.noise.tolist(),
    }


def _output_error(
    structure: LPVARX,
    records: Sequence[FlightRecord],
    data: Regression,
    instruments: Sequence[str] | Instruments,
    options: OutputError,
) -> tuple[Array, dict[str, Any]]:
    starts = [_start(structure, records, data, instruments)]
    try:
        starts.append(
            _refined(structure, records, data, instruments, Refined(iterations=10, tolerance=1e-3))[
                0
            ]
        )
    except ExcitationError:  # a refinement that fails leaves the first start
        pass
    found = output_error(structure, records, starts, options)
    return found.theta, {
        "evaluations": found.evaluations,
        "converged": found.converged,
        "message": found.message,
        "simulation_covariance": found.simulation_covariance.tolist(),
    }


def _recursive(
    structure: LPVARX, data: Regression, forgetting: float | Forgetting
) -> tuple[Array, Array]:
    online = RecursiveLeastSquares(structure, forgetting).online()
    for phi, y in zip(data.phi, data.y, strict=True):
        online.absorb(phi, y)
    state = online.state
    check_recursion(state, data.phi, data.y)
    return state.solve(), state.residual_covariance
