"""From records to a model, by the method of choice."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

from identification.excitation import excitation_of
from identification.forgetting import Forgetting
from identification.instrumental_variables import Instruments, instrumental_variables
from identification.least_squares import least_squares_by_group, residual_covariance
from identification.model import LPVARXModel
from identification.recursive_least_squares import RecursiveLeastSquares
from identification.regressors import Regression, as_records, stacked, units_of
from identification.structure import LPVARX
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import FlightRecord
from symheli.lpv.arrays import Array

METHODS = ("ls", "rls", "iv")


def fit(
    structure: LPVARX,
    records: FlightRecord | Iterable[FlightRecord],
    method: Literal["ls", "rls", "iv"] = "ls",
    *,
    forgetting: float | Forgetting = 1.0,
    instruments: Sequence[str] | Instruments = (),
) -> LPVARXModel:
    """Identify the coefficients of `structure` from one record or several (same sample period and units).

    "ls": least squares over all samples. "rls": the same, sample by sample, the older ones weighted by `forgetting` to
    the power of their age, or as `Constant`, `Variable`, `Directional` say. "iv": instrumental variables, for records flown
    in closed loop: `instruments` names the external excitation signals (or is an `Instruments` with its window). Noise fed
    back biases the other two.

    Raises `ExcitationError` (with a report) where the data cannot determine every coefficient, `UnknownNameError` for
    signals the record lacks, `InputError` where p leaves the range of the basis or an option does not fit the method.
    """
    records = as_records(records)
    if method not in METHODS:
        raise UnknownNameError("method", method, METHODS)
    if method != "rls" and forgetting != 1.0:
        raise InputError(f'forgetting is for method="rls"; {method!r} weighs all samples alike')
    if method != "iv" and instruments:
        raise InputError(f'instruments are for method="iv", not {method!r}')
    outputs, inputs = units_of(structure.outputs, records), units_of(structure.inputs, records)
    scheduling = units_of(structure.parameters, records)
    data = stacked(structure, records)
    report = excitation_of(structure, data)
    report.require()
    match method:
        case "ls":
            theta = least_squares_by_group(structure, data.phi, data.y)
            covariance = residual_covariance(structure, data.phi, data.y, theta)
        case "rls":
            theta, covariance = _recursive(structure, data, forgetting)
        case "iv":
            theta = instrumental_variables(structure, records, data, Instruments.of(instruments))
            covariance = residual_covariance(structure, data.phi, data.y, theta)
    return LPVARXModel(
        structure, theta, records[0].dt, outputs, inputs, scheduling, covariance, len(data.phi), data.dropped, method, report
    )


def _recursive(structure: LPVARX, data: Regression, forgetting: float | Forgetting) -> tuple[Array, Array]:
    online = RecursiveLeastSquares(structure, forgetting).online()
    for phi, y in zip(data.phi, data.y, strict=True):
        online.absorb(phi, y)
    state = online.state
    return state.solve(), state.residual_covariance
