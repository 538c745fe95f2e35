"""State-space models by the closest free run, from a difference equation in balanced form."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from identification.estimators.prediction_error import ADVICE, OutputError
from identification.model.lpvarx_model import LPVARXModel
from identification.model.state_space_model import StateSpaceModel, pieces_of, start_of
from identification.model.state_space_run import StateSpaceRun
from identification.structure.state_space import StateSpace
from symheli import LPVStateSpace
from symheli.errors import ConvergenceWarning, ExcitationError, InputError
from symheli.records import FlightRecord
from symheli.values import Signal
from symheli.values.arrays import Array


def state_space_of(
    structure: StateSpace,
    records: Sequence[FlightRecord],
    begin: LPVARXModel,
    options: OutputError,
) -> StateSpaceModel:
    """Minimise the error of the free run, each output divided by its spread, over all matrices and
    the states that runs start from, from a model of the structure's regression.

    Every basis of the states serves: the search goes along the directions that change the response,
    by singular values. Raises `ExcitationError` where no record has a stretch long enough.
    """
    run = StateSpaceRun(structure)
    parts = [piece for record in records for piece in pieces_of(structure, record)]
    if not parts:
        raise ExcitationError(f"no unbroken stretch of more than {structure.order} samples")
    given = begin.to_state_space()
    unknowns = _started(run, given)
    spread = np.nanstd(np.concatenate([y for _, y, _, _ in parts]), axis=0)
    scale = np.where(spread > 0, spread, 1.0)
    nx, first = structure.order, run.size
    starts = [start_of(run, unknowns, y, u, p) for _, y, u, p in parts]

    def left(z: Array) -> Array:
        own = z[first:].reshape(len(parts), nx)
        return np.concatenate(
            [run.outputs(z, x, u, p) - y for x, (_, y, u, p) in zip(own, parts, strict=True)]
        )

    def residuals(z: Array) -> Array:
        scaled = left(z) / scale
        return scaled[~np.isnan(scaled)]

    def jacobian(z: Array) -> Array:
        out = []
        for i, (_, y, u, p) in enumerate(parts):
            own = slice(first + i * nx, first + (i + 1) * nx)
            full = np.zeros((*y.shape, len(z)))
            slopes = run.sensitivities(z, z[own], u, p) / scale[None, :, None]
            full[:, :, :first], full[:, :, own] = slopes[:, :, :first], slopes[:, :, first:]
            out.append(full[np.isfinite(y)])
        return np.concatenate(out)

    z = np.concatenate([unknowns, *starts])
    if not np.isfinite(residuals(z)).all():
        raise InputError(
            "the free run from the difference equation diverges: fit over shorter records, or with"
            " another order"
        )
    found = least_squares(
        residuals,
        z,
        jac=jacobian,  # type: ignore[arg-type]
        method="trf",
        x_scale="jac",
        max_nfev=options.evaluations,
        ftol=options.tolerance,
        xtol=options.tolerance,
        gtol=options.tolerance,
    )
    if not found.status > 0:
        warnings.warn(ConvergenceWarning(f"the free run did not settle: {ADVICE}"), stacklevel=3)
    error = left(found.x)
    error = error[np.isfinite(error).all(axis=1)]
    return StateSpaceModel(
        structure=structure,
        unknowns=found.x[:first],
        state_space=_design(run, found.x, given),
        residual_covariance=error.T @ error / max(len(error), 1),
        details={
            "evaluations": int(found.nfev),
            "converged": bool(found.status > 0),
            "message": str(found.message),
        },
    )


def _started(run: StateSpaceRun, given: LPVStateSpace) -> Array:
    """The unknowns of a state-space model, reduced to the order where it has more states: balanced
    for the response where it is stable, else for feedback.
    """
    order = run.structure.order
    if len(given.states) > order:
        try:
            given = given.truncate(order, balance="response").model
        except InputError:
            given = given.truncate(order).model
    middle = given.basis(np.array([np.mean(r) for r in given.basis.ranges]).squeeze())
    C, D = np.tensordot(middle, given.C, 1), np.tensordot(middle, given.D, 1)
    parts = [given.A, given.B, C, D if run.structure.feedthrough else np.zeros((len(C), 0))]
    return np.concatenate([np.asarray(part).reshape(-1) for part in parts])


def _design(run: StateSpaceRun, unknowns: Array, given: LPVStateSpace) -> LPVStateSpace:
    A, B, C, D = run.matrices(unknowns)
    one = run.structure.basis.constant()[:, None, None]
    states = tuple(Signal(f"x{i + 1}", "1") for i in range(run.structure.order))
    return LPVStateSpace(
        run.structure.basis,
        A,
        B,
        one * C,
        one * D,
        given.parameters,
        states,
        given.inputs,
        given.outputs,
        given.dt,
    )
