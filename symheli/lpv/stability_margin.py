"""The margin b(P, C) of a loop: how far, in the nu-gap, the plant may move before it is lost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from symheli.errors import InputError
from symheli.lpv.equilibration import loop_inverse
from symheli.lpv.linear_model import LinearModel, feedback_matrix
from symheli.lpv.nu_gap import angles, channel_scales, sampled_alike
from symheli.values.arrays import Array
from symheli.values.sample_period import same_period
from symheli.values.signal import indices

Feedback = Mapping[tuple[str, str], float] | LinearModel
"""u = K y as {(input, output): gain}, or a controller from outputs to inputs."""

MAX_REFINEMENTS = 12
"""Largest number of times that the frequencies around a peak are refined by a factor of ten."""


def stability_margin(
    plant: LinearModel,
    feedback: Feedback,
    *,
    input_scale: object = 1.0,
    output_scale: object = 1.0,
) -> float:
    """Return the normalized coprime stability margin b(P, C) of the loop u = C y.

        1/b = sup over frequency of |[P; I] (I - C P)^-1 [-C, I]|

    Every plant within b of P in the nu-gap is stabilised by C as well, and one at that distance is
    not. 0 for a loop that is unstable as it is.

    Parameters
    ----------
    plant : LinearModel
        P, without a direct way from u to y that makes the loop singular.
    feedback : mapping or LinearModel
        {(input, output): gain} as in `LinearModel.feedback`; or C, with the same period or
        continuous as P, from outputs of the plant to inputs of it. What is not named is not fed
        back.
    input_scale, output_scale : float or array
        Inputs and outputs are divided by it, as in `nu_gap`: the margin depends on it.

    Returns
    -------
    float
        In [0, 1].

    Raises
    ------
    InputError
        A controller with another sample period.
    UnknownNameError
        A signal that the plant does not have.

    See Also
    --------
    symheli.lpv.nu_gap : distance of two models in feedback
    synthesis.disk_margin : margin of all channels at once

    References
    ----------
    Vinnicombe (2001), Uncertainty and Feedback, ch. 3.

    Examples
    --------
    Of an integrator with u = -y, and of a plant of gain 1, whose graph is orthogonal to that of
    u = -y:

    >>> lag = symheli.LinearModel([[0.0]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"])
    >>> round(lpv.stability_margin(lag, {("u", "y"): -1.0}), 6)
    0.707107
    >>> one = symheli.LinearModel([[0.0]], [[0.0]], [[0.0]], [[1.0]], ["x"], ["u"], ["y"], dt=0.1)
    >>> round(lpv.stability_margin(one, {("u", "y"): -1.0}), 6)
    1.0
    """
    nu, ny = len(plant.inputs), len(plant.outputs)
    su = channel_scales(input_scale, "input_scale", nu)
    sy = channel_scales(output_scale, "output_scale", ny)
    plant, controller = sampled_alike(plant, as_controller(feedback, plant))
    A, B, C, D = closed_loop(plant, controller)
    poles = np.linalg.eigvals(A)
    if np.any(np.abs(poles) >= 1):
        return 0.0
    rows, columns = np.concatenate([1 / sy, 1 / su]), np.concatenate([sy, su])

    def gain(angle: Array) -> Array:
        pencil = np.exp(1j * angle)[:, None, None] * np.eye(len(A)) - A
        G = C @ np.linalg.solve(pencil, np.broadcast_to(B, (len(angle), *B.shape))) + D
        return np.linalg.svd(rows[:, None] * G * columns, compute_uv=False)[:, 0]

    angle = angles(np.concatenate([poles, [0.5]]), 400)
    values = gain(angle)
    largest = float(values.max())
    for _ in range(MAX_REFINEMENTS):
        peak, before = int(np.argmax(values)), largest
        angle = np.linspace(angle[max(peak - 1, 0)], angle[min(peak + 1, len(angle) - 1)], 21)
        values = gain(angle)
        largest = max(before, float(values.max()))
        if largest <= before * (1 + 1e-9):
            break
    return 1 / largest


def closed_loop(plant: LinearModel, controller: LinearModel) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D from (v, w) to (y, u) of the loop y = P u, u = C (y - v) + w with a controller
    from `as_controller`; the states of the plant stand first.
    """
    n, nc = len(plant.A), len(controller.A)
    nu, ny = len(plant.inputs), len(plant.outputs)
    y_u = np.zeros((ny + nu, ny + nu))  # (y, u) from (y, u)
    y_u[:ny, ny:], y_u[ny:, :ny] = plant.D, controller.D
    x_q = np.zeros((n + nc, ny + nu))  # states from (y, u)
    x_q[:n, ny:], x_q[n:, :ny] = plant.B, controller.B
    added = np.zeros((ny + nu, ny + nu))  # (y, u) from (v, w)
    added[ny:, :ny], added[ny:, ny:] = -controller.D, np.eye(nu)
    x_d = np.zeros_like(x_q)  # states from (v, w)
    x_d[n:, :ny] = -controller.B
    q_x = np.asarray(block_diag(plant.C, controller.C))
    A = np.asarray(block_diag(plant.A, controller.A))
    solved = loop_inverse(y_u)
    return A + x_q @ solved @ q_x, x_d + x_q @ solved @ added, solved @ q_x, solved @ added


def as_controller(feedback: Feedback, plant: LinearModel) -> LinearModel:
    """The feedback as a model from all outputs of the plant to all inputs of it."""
    if not isinstance(feedback, LinearModel):
        K = feedback_matrix(feedback, plant.inputs, plant.outputs)
        return replace(LinearModel.gain(K, plant.outputs, plant.inputs), dt=plant.dt)
    if not same_period(feedback.dt, plant.dt):
        raise InputError(
            f"the controller's sample period is {feedback.dt} s, the plant's {plant.dt} s; make"
            " them equal"
        )
    from_y = indices(feedback.inputs, plant.outputs, "output of the plant")
    to_u = indices(feedback.outputs, plant.inputs, "input of the plant")
    nc, nu, ny = len(feedback.A), len(plant.inputs), len(plant.outputs)
    B, C, D = np.zeros((nc, ny)), np.zeros((nu, nc)), np.zeros((nu, ny))
    B[:, from_y], C[to_u] = feedback.B, feedback.C
    D[np.ix_(to_u, from_y)] = feedback.D
    return replace(feedback, B=B, C=C, D=D, inputs=plant.outputs, outputs=plant.inputs)
