"""H2 output feedback for one model: the least mean square of the performance in white noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, overload

import numpy as np
from scipy import linalg

from symheli import LinearModel
from symheli.lpv.linear_model import as_model
from symheli.lpv.riccati import lyapunov
from symheli.values.arrays import Array
from synthesis.design.loops.controller import Controller
from synthesis.design.lti.linear_quadratic import Matrices, given_direct_way, lqg
from synthesis.design.lti.point_design import (
    DesignStatus,
    PointDesign,
    named_controller,
    named_loop,
    on_plant,
)
from synthesis.design.plant.diagnosis import reasons
from synthesis.design.plant.generalized import Channels, Generalized
from synthesis.design.plant.plant import Plant

NEGLIGIBLE_FEEDTHROUGH = 1e-9
"""Feedthrough from disturbances to performance below this fraction of its terms counts as zero."""

MEAN_SQUARE_TOLERANCE = 1e-6
"""Largest relative error of a mean square; with a larger error the norm is NaN."""
CANCELLATION = 1e-12
"""Fraction of the terms of a mean square below which the remainder after cancellation is rounding,
and small.
"""
REFINEMENTS = 3
"""Number of refinement steps of the solution of a Lyapunov equation."""

DIRECT_NOISE = (
    "the performance feels the disturbances directly (D11), in continuous time white noise of"
    " infinite variance: filter the one or the other"
)

INACCURATE = (
    "the norm of the loop is lost in rounding: its states move by far more than the performance"
    " shows; bring slow and fast modes closer, or leave out what hardly matters"
)


@overload
def h2(model: Plant) -> Controller: ...
@overload
def h2(
    model: LinearModel,
    controls: Sequence[str],
    measurements: Sequence[str],
    *,
    disturbances: Sequence[str] | None = None,
    performance: Sequence[str] | None = None,
) -> PointDesign: ...
def h2(
    model: Any,
    controls: Sequence[str] = (),
    measurements: Sequence[str] = (),
    *,
    disturbances: Sequence[str] | None = None,
    performance: Sequence[str] | None = None,
) -> Any:
    """Design the H2-optimal output-feedback controller of one model, continuous or sampled: of a
    `Plant` that depends on no parameter, or of a `LinearModel` with its channels.

    A linear-quadratic regulator on a Kalman filter. Of a continuous model the direct way from
    disturbances to performance must be one that a static gain can cancel; a sampled one may have
    any, and its controller uses the measurement of the same sample.

    Parameters
    ----------
    model : Plant, LinearModel or system of python-control
        From disturbances and controls to performance and measurements.
    controls, measurements : sequence of str
        Inputs that the controller commands, outputs that it reads; a plant names its own.
    disturbances, performance : sequence of str, optional
        The inputs and outputs between which the norm counts; default all others.

    Returns
    -------
    Controller or PointDesign
        Of a plant the controller. Of a model the controller u = K y; `hinf_norm` is the H2 norm of
        its loop, recomputed, and the `optimum`. Where there is no controller, `reasons`.

    Raises
    ------
    InputError
        Another type of model, a plant that depends on p.
    SynthesisError
        No controller of a plant; with the reasons.
    UnknownNameError
        A signal that the model does not have.

    See Also
    --------
    synthesis.lqg : the regulator on a Kalman filter
    synthesis.hinf : least worst-case gain of one model
    synthesis.h2_gain : variance in white noise

    References
    ----------
    Zhou, Doyle, Glover (1996), section 14.5; Chen and Francis (1995), Optimal Sampled-Data Control
    Systems, section 6.6.

    Examples
    --------
    >>> from symheli import LinearModel
    >>> plant = LinearModel(
    ...     [[-1.0]], [[1.0, 1.0]], [[1.0], [1.0]], [[0.0, 1.0], [1.0, 0.0]],
    ...     ["x"], ["w", "u"], ["z", "y"],
    ... )
    >>> K = h2(plant, ["u"], ["y"]).controller
    >>> print(K.A, K.B, K.C, K.D)
    [[-3.]] [[1.]] [[-1.]] [[0.]]
    """
    if isinstance(model, Plant):
        names = controls, measurements, disturbances, performance
        return on_plant(model, names, h2, "H2", gain=False)
    model = as_model(model)
    names = Channels.of(model, controls, measurements, disturbances, performance)
    plant = Generalized.between(model, names)
    if against := reasons(plant, names, dt=model.dt):
        return PointDesign.without(DesignStatus.IMPOSSIBLE, against)
    static = _cancelling(plant) if model.dt is None else np.zeros(plant.D22.T.shape)
    if static is None:
        return PointDesign.without(DesignStatus.IMPOSSIBLE, [DIRECT_NOISE])
    K = _around(plant, static, model.dt)
    if K is None:
        return PointDesign.without(DesignStatus.FAILED, ["a Riccati equation was not solved"])
    controller = named_controller(K, names, model.dt)
    loop = named_loop(plant, controller, names)
    if model.dt is None:  # cancelled, to rounding
        loop = replace(loop, D=np.zeros(loop.D.shape))
    size = h2_norm(loop)
    if math.isnan(size):
        return PointDesign.without(DesignStatus.FAILED, [INACCURATE])
    if not math.isfinite(size):
        return PointDesign.without(DesignStatus.FAILED, ["the loop is not stable"])
    return PointDesign(DesignStatus.SOLVED, controller, loop, size, size)


def _cancelling(P: Generalized) -> Array | None:
    """Return the static gain (nu, ny) that cancels D11, to rounding; None where there is none."""
    static = -np.linalg.pinv(P.D12) @ P.D11 @ np.linalg.pinv(P.D21)
    left = np.abs(P.D11 + P.D12 @ static @ P.D21).max(initial=0.0)
    return static if left <= NEGLIGIBLE_FEEDTHROUGH * np.abs(P.D11).max(initial=0.0) else None


def _around(P: Generalized, static: Array, dt: float | None) -> Matrices | None:
    """Return the best controller in parallel with a static gain, with that gain added."""
    into, out = P.B2 @ static, P.D12 @ static
    K = lqg(
        P._replace(
            A=P.A + into @ P.C2,
            B1=P.B1 + into @ P.D21,
            C1=P.C1 + out @ P.C2,
            D11=P.D11 + out @ P.D21,
            D22=np.zeros(P.D22.shape),
        ),
        dt,
    )
    if K is None:
        return None
    A, B, C, D = K
    return given_direct_way(P.D22, A, B, C, D + static)


def h2_norm(model: LinearModel) -> float:
    """Root of the variance of the outputs with white noise of unit intensity at the inputs, in any
    units of the states; inf where the model is unstable, or continuous with feedthrough.

    Computed from the reachability and from the observability Gramian, each with a bound of its
    rounding error. Where the terms nearly cancel in the outputs (`CANCELLATION`), the upper bound
    is returned; NaN where rounding decides more than that, or the two results contradict.
    """
    if not model.is_stable() or (model.dt is None and np.any(model.D)):
        return math.inf
    A, B, C = _in_units_of_one_size(model.A, model.B, model.C)
    through = 0.0 if model.dt is None else float(np.sum(model.D**2))
    found = _variance(A, B, C, model.dt), _variance(A.T, C.T, B.T, model.dt)
    if None in found:
        return math.nan
    every = [v for v in found if v is not None]
    least, most = min(v.value for v in every), max(v.value for v in every)
    unknown = most - least + max(v.doubt for v in every)
    if unknown <= MEAN_SQUARE_TOLERANCE * (least + through):
        return math.sqrt(through + 0.5 * (least + most))
    cancelled = most + unknown <= CANCELLATION * min(v.terms for v in every)
    return math.sqrt(through + most + unknown) if cancelled else math.nan


def _in_units_of_one_size(A: Array, B: Array, C: Array) -> tuple[Array, Array, Array]:
    """Return A, B and C with the states in units, powers of two, in which inputs to and outputs
    from each state are of similar size: no digit is lost.
    """
    n = len(A)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n] = A
    whole[:n, n], whole[n, :n] = np.linalg.norm(B, axis=1), np.linalg.norm(C, axis=0)
    _, (units, _) = linalg.matrix_balance(whole, permute=False, separate=True)
    units = units[:n] / units[n]
    return A * units / units[:, None], B / units[:, None], C * units


class _Variance(NamedTuple):
    """The `value`, its error bound, and `terms`, the sizes of the terms of the sum."""

    value: float
    doubt: float
    terms: float


def _variance(A: Array, B: Array, C: Array, dt: float | None) -> _Variance | None:
    """tr C W C' with A W + W A' + B B' = 0, sampled A W A' - W + B B' = 0; None where there is no
    W of a variance.

    W is refined; the last change, and the rounding of the sum, bound the error.
    """

    def shown(M: Array) -> Any:
        return np.sum((C @ M) * C)

    W, values = np.zeros(A.shape, dtype=np.longdouble), []
    driven = B.astype(np.longdouble) @ B.T
    try:
        for _ in range(1 + REFINEMENTS):
            left = (A @ W + W @ A.T if dt is None else A @ W @ A.T - W) + driven
            more = lyapunov(A, np.asarray(left, dtype=float), dt)
            W = W + 0.5 * (more + more.T)
            values.append(float(shown(W)))
    except (np.linalg.LinAlgError, ValueError):
        return None
    value = values[-1]
    terms = float(np.sum((np.abs(C) @ np.abs(W)) * np.abs(C)))
    rounding = len(W) * float(np.finfo(np.longdouble).eps) * terms
    doubt = max(rounding, *(abs(value - v) for v in values[1:]))
    if not (np.all(np.diag(W) >= -rounding) and math.isfinite(doubt)):
        return None
    return _Variance(max(value, 0.0), doubt + max(-value, 0.0), terms)
