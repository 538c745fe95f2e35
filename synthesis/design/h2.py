"""H2 output feedback for one model: the least mean square of the performance in white noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import linalg

from symheli.lpv import LinearModel
from synthesis.design.diagnosis import reasons
from synthesis.design.generalized import Channels, Generalized
from synthesis.design.linear_quadratic import Matrices, given_direct_way, lqg
from synthesis.design.point_design import (
    DesignStatus,
    PointDesign,
    as_model,
    named_controller,
    named_loop,
)

Array = np.ndarray

DIRECT = 1e-9
"""Direct gain from disturbances to performance below this part of its terms is none."""

DIRECT_NOISE = (
    "the performance feels the disturbances directly (D11), in continuous time white noise of"
    " infinite variance: filter the one or the other"
)


def h2(
    model: LinearModel,
    controls: Sequence[str],
    measurements: Sequence[str],
    *,
    disturbances: Sequence[str] | None = None,
    performance: Sequence[str] | None = None,
) -> PointDesign:
    """The H2-optimal output-feedback controller of one model, continuous or sampled.

    A linear-quadratic regulator on a Kalman filter. Of a continuous model the direct way from
    disturbances to performance must be one that a static gain can cancel; a sampled one may have
    any, and its controller uses the measurement of the same sample.

    Parameters
    ----------
    model : LinearModel or system of python-control
        From disturbances and controls to performance and measurements.
    controls, measurements : sequence of str
        Inputs that the controller commands, outputs that it reads.
    disturbances, performance : sequence of str, optional
        The inputs and outputs between which the norm counts; default all others.

    Returns
    -------
    PointDesign
        The controller u = K y; `gamma` is the H2 norm of its loop, recomputed, and the `optimum`.
        Where there is no controller, `reasons`.

    Raises
    ------
    InputError
        Another type of model.
    UnknownNameError
        A signal that the model does not have.

    References
    ----------
    Zhou, Doyle, Glover (1996), section 14.5; Chen and Francis (1995), Optimal Sampled-Data Control
    Systems, section 6.6.

    Examples
    --------
    >>> from symheli.lpv import LinearModel
    >>> plant = LinearModel(
    ...     [[-1.0]], [[1.0, 1.0]], [[1.0], [1.0]], [[0.0, 1.0], [1.0, 0.0]],
    ...     ["x"], ["w", "u"], ["z", "y"],
    ... )
    >>> K = h2(plant, ["u"], ["y"]).controller
    >>> print(K.A, K.B, K.C, K.D)
    [[-3.]] [[1.]] [[-1.]] [[0.]]
    """
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
    if not math.isfinite(size):
        return PointDesign.without(DesignStatus.FAILED, ["the loop is not stable"])
    return PointDesign(DesignStatus.SOLVED, controller, loop, size, size)


def _cancelling(P: Generalized) -> Array | None:
    """The static gain (nu, ny) that takes away D11, to rounding; None where there is none."""
    static = -np.linalg.pinv(P.D12) @ P.D11 @ np.linalg.pinv(P.D21)
    left = np.abs(P.D11 + P.D12 @ static @ P.D21).max(initial=0.0)
    return static if left <= DIRECT * np.abs(P.D11).max(initial=0.0) else None


def _around(P: Generalized, static: Array, dt: float | None) -> Matrices | None:
    """The best controller beside a static gain, with it."""
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
    """Root of the variance of the outputs with white noise of unit intensity at the inputs; inf
    where it is not stable, or continuous with a direct way.
    """
    if not model.is_stable():
        return math.inf
    A, B, C, D = model.A, model.B, model.C, model.D
    if model.dt is not None:
        W = linalg.solve_discrete_lyapunov(A, B @ B.T)
        return math.sqrt(max(float(np.trace(C @ W @ C.T) + np.sum(D**2)), 0.0))
    W = linalg.solve_continuous_lyapunov(A, -B @ B.T)
    return math.inf if np.any(D) else math.sqrt(max(float(np.trace(C @ W @ C.T)), 0.0))
