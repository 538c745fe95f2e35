"""Vinnicombe's nu-gap between two linear models: how far apart they are for feedback."""

from __future__ import annotations

import numpy as np

from symheli.errors import InputError
from symheli.lpv.arrays import frozen
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.sample_period import same_period


def nu_gap(first: LinearModel, second: LinearModel, *, input_scale: object = 1.0, output_scale: object = 1.0, points: int = 2000) -> float:
    """The nu-gap metric in [0, 1] of two discrete models with equal sample period, inputs and outputs.

    Inputs are divided by `input_scale` and outputs by `output_scale` (one a channel, in their units): the gap depends on them. 1
    where the winding-number condition fails: no controller is known to suit both. Evaluated on `points` frequencies from
    1e-3 rad/s to Nyquist, logarithmic, refined where the winding number asks for it. Models with poles on the unit circle are
    refused with `InputError`. Source: G. Vinnicombe, Uncertainty and Feedback (2001), chapter 3.
    """
    if first.dt is None or not same_period(first.dt, second.dt):
        raise InputError(f"nu_gap compares discrete models with one sample period, got {first.dt} and {second.dt} s; discretize them")
    if first.inputs != second.inputs or first.outputs != second.outputs:
        raise InputError("nu_gap compares models with the same inputs and outputs in the same order")
    su = np.broadcast_to(frozen(input_scale, "input_scale"), (len(first.inputs),))
    sy = np.broadcast_to(frozen(output_scale, "output_scale"), (len(first.outputs),))
    unstable = []
    for model in (first, second):
        size = np.abs(model.poles())
        if np.any(np.abs(size - 1) < 1e-9):
            raise InputError("nu_gap: a pole lies on the unit circle")
        unstable.append(int(np.sum(size > 1)))
    angle = np.concatenate([[0.0], np.geomspace(1e-3 * first.dt, np.pi, points)])

    def responses(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        one, two = (m.frequency_response(angle / m.dt) * su[None, None, :] / sy[None, :, None] for m in (first, second))  # type: ignore[operator]
        return one, two

    P1, P2 = responses(angle)
    if _winding(P1, P2) + unstable[0] - unstable[1] != 0:
        return 1.0
    return float(_chordal(P1, P2).max())


def chordal_distance(
    first: LinearModel, second: LinearModel, omega: object, *, input_scale: object = 1.0, output_scale: object = 1.0
) -> np.ndarray:
    """Pointwise chordal distance (n,) in [0, 1] of two models with the same signals at `omega` (n,) rad/s, scaled as in `nu_gap`.

    Its largest value over all frequencies is the nu-gap where the winding-number condition holds; over a band it says how far
    apart the models are there, whatever their slow modes.
    """
    su = np.broadcast_to(frozen(input_scale, "input_scale"), (len(first.inputs),))
    sy = np.broadcast_to(frozen(output_scale, "output_scale"), (len(first.outputs),))
    return _chordal(*(m.frequency_response(omega) * su[None, None, :] / sy[None, :, None] for m in (first, second)))


def _winding(P1: np.ndarray, P2: np.ndarray) -> int:
    """Clockwise turns about 0 of det(I + P2* P1) along the unit circle (upper half, doubled by symmetry): zeros less poles outside it."""
    eye = np.eye(P1.shape[2])
    f = np.linalg.det(eye + np.conj(np.swapaxes(P2, 1, 2)) @ P1)
    turns = np.sum(np.angle(f[1:] / f[:-1])) / np.pi  # both half circles: 2 x sum / (2 pi)
    return -round(float(turns))


def _chordal(P1: np.ndarray, P2: np.ndarray) -> np.ndarray:
    """Largest singular value of (I + P2 P2*)^-1/2 (P1 - P2)(I + P1* P1)^-1/2 at each frequency."""

    def inverse_root(M: np.ndarray) -> np.ndarray:
        values, vectors = np.linalg.eigh(M)
        return (vectors / np.sqrt(values)[:, None, :]) @ np.conj(np.swapaxes(vectors, 1, 2))

    def adjoint(M: np.ndarray) -> np.ndarray:
        return np.conj(np.swapaxes(M, 1, 2))

    left = inverse_root(np.eye(P2.shape[1]) + P2 @ adjoint(P2))
    right = inverse_root(np.eye(P1.shape[2]) + adjoint(P1) @ P1)
    return np.linalg.svd(left @ (P1 - P2) @ right, compute_uv=False)[:, 0]
