"""nu-gaps from one model to many at once."""

from __future__ import annotations

import numpy as np

from symheli.errors import InputError
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.linear_models import LinearModels
from symheli.lpv.nu_gap import ON_THE_CIRCLE, angles, channel_scales, nu_gap, require_same_signals
from symheli.values.arrays import Array
from symheli.values.sample_period import same_period

AT_ONCE = 2_000_000
"""Entries of the pencils zI - A that are solved together."""

CLOSER = 12
"""Frequencies between the neighbours of the largest distance of each model."""


def nu_gaps(
    model: LinearModel,
    others: LinearModels,
    *,
    input_scale: object = 1.0,
    output_scale: object = 1.0,
    points: int = 100,
) -> Array:
    """Return the nu-gap from one discrete model to each of many, as `nu_gap` does for two.

    All on the frequencies of the one model's poles, then closer around the largest distance of
    each. A model in which the winding number cannot be told on these goes through `nu_gap` itself.

    Parameters
    ----------
    model : LinearModel
        Discrete.
    others : LinearModels
        K of them, with its signals and sample period; their states may be others.
    input_scale, output_scale : float or array
        As in `nu_gap`.
    points : int
        Frequencies to begin with, beside those around the poles.

    Returns
    -------
    array (K,)
        In [0, 1].

    Raises
    ------
    InputError
        As `nu_gap`.

    Examples
    --------
    >>> ladder = lpv.LinearModels.of([spring.at(p).discretize(0.1) for p in (0.0, 0.5, 1.0)])
    >>> lpv.nu_gaps(ladder[0], ladder).round(2)
    array([0.  , 0.09, 0.16])
    """
    if model.dt is None or not same_period(model.dt, others.dt):
        raise InputError(
            f"nu_gaps compares discrete models with one sample period, got {model.dt} and"
            f" {others.dt} s; discretize them"
        )
    require_same_signals(model, others)
    su = channel_scales(input_scale, "input_scale", len(model.inputs))
    sy = channel_scales(output_scale, "output_scale", len(model.outputs))
    poles, many = model.poles(), np.linalg.eigvals(others.A)
    if any(np.any(np.abs(np.abs(each) - 1) < ON_THE_CIRCLE) for each in (poles, many)):
        raise InputError("nu_gaps: a pole lies on the unit circle")
    extra = np.sum(np.abs(poles) > 1) - np.sum(np.abs(many) > 1, axis=1)
    angle = angles(poles, points)
    one = LinearModels.of([model])
    P1, out = _responses(one, angle[None], su, sy), np.zeros(len(others))
    size = others.A.shape[1] ** 2 * len(angle)
    step = max(AT_ONCE // max(size, 1), 1)
    for start in range(0, len(others), step):
        rows = np.arange(start, min(start + step, len(others)))
        part = others.at(rows)
        P2 = _responses(part, np.broadcast_to(angle, (len(rows), len(angle))), su, sy)
        f = np.linalg.det(np.eye(len(su)) + _adjoint(P2) @ P1)
        turns = np.angle(f[:, 1:] / f[:, :-1])
        same = -np.rint(turns.sum(axis=1) / np.pi) + extra[rows] == 0
        distance = _chordal(P1, P2)
        peak = distance.argmax(axis=1)
        low, high = angle[np.maximum(peak - 1, 0)], angle[np.minimum(peak + 1, len(angle) - 1)]
        near = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, CLOSER)
        closer = _chordal(
            _responses(one.at(np.zeros(len(rows), int)), near, su, sy),
            _responses(part, near, su, sy),
        )
        largest = np.maximum(distance.max(axis=1), closer.max(axis=1))
        out[rows] = np.where(same, np.minimum(largest, 1.0), 1.0)
        for k in np.flatnonzero(np.abs(turns).max(axis=1) > np.pi / 4):
            out[rows[k]] = nu_gap(model, part[int(k)], input_scale=su, output_scale=sy)
    return out


def _responses(models: LinearModels, angle: Array, su: Array, sy: Array) -> Array:
    """(K, n, ny, nu) at angles (K, n) of z, in units of the scales."""
    z = np.exp(1j * angle)[:, :, None, None]
    pencil = z * np.eye(models.A.shape[1]) - models.A[:, None]
    B = np.broadcast_to(models.B[:, None], (*angle.shape, *models.B.shape[1:]))
    G = models.C[:, None] @ np.linalg.solve(pencil, B) + models.D[:, None]
    return G * su / sy[:, None]


def _chordal(P1: Array, P2: Array) -> Array:
    """(K, n) of the largest singular value of (I + P2 P2*)^-1/2 (P1 - P2) (I + P1* P1)^-1/2.

    By (I + P2 P2*)^-1 = I - P2 (I + P2* P2)^-1 P2* its square is an eigenvalue of a matrix the size
    of the inputs.
    """
    eye, E = np.eye(P1.shape[-1]), P1 - P2
    F = _adjoint(P2) @ E
    inner = _adjoint(E) @ E - _adjoint(F) @ np.linalg.solve(eye + _adjoint(P2) @ P2, F)
    root = np.linalg.inv(np.linalg.cholesky(eye + _adjoint(P1) @ P1))
    square = np.linalg.eigvalsh(root @ inner @ _adjoint(root))[..., -1]
    return np.sqrt(np.maximum(square, 0.0))


def _adjoint(M: Array) -> Array:
    return np.conj(np.swapaxes(M, -1, -2))
