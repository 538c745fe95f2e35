"""Vinnicombe's nu-gap between linear models: how far apart they are for feedback."""

from __future__ import annotations

import numpy as np

from symheli.errors import InputError
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.linear_models import LinearModels
from symheli.values.arrays import Array, frozen
from symheli.values.sample_period import same_period

ON_THE_CIRCLE = 1e3 * np.finfo(float).eps
"""A pole this close to the unit circle may be on it: what rounding moves the eigenvalues of a small
matrix by.
"""

MAX_REFINEMENTS = 30
"""Largest number of bisections of a frequency interval until the phase of the determinant changes
little in it.
"""

SCALE_LIMITS = 1e-60, 1e60
"""Permitted channel scales; their squares neither overflow nor underflow."""

AT_ONCE = 2_000_000
"""Entries of the pencils zI - A that are solved together."""

FINER = 4
"""How many times more frequencies a model is compared on where the winding number cannot be told on
those of all; `nu_gap` adds more where the response turns.
"""

REFINED_FREQUENCIES = 12
"""Number of frequencies between the neighbours of the largest distance of each model."""


def nu_gap(
    first: LinearModel,
    second: LinearModel,
    *,
    input_scale: object = 1.0,
    output_scale: object = 1.0,
    points: int = 2000,
) -> float:
    """Return the nu-gap of two models, both continuous or with one sample period, of equal inputs
    and outputs.

    1 where the winding-number condition fails: no controller is known to suit both. Continuous
    models are compared after the bilinear transformation of both, which preserves it. Evaluated on
    frequencies up to Nyquist, logarithmic, from a thousandth of the slowest pole, at the poles and
    around them, and between them where the response turns by more than an eighth of a circle.

    Parameters
    ----------
    first, second : LinearModel
        With the same signals.
    input_scale, output_scale : float or array
        Inputs and outputs are divided by it (one a channel, in their units): the gap depends on it.
    points : int
        Frequencies to begin with.

    Returns
    -------
    float
        In [0, 1].

    Raises
    ------
    InputError
        Models with poles on the stability boundary, as far as rounding can tell, or with other
        signals or sample periods; scales that are not positive.

    See Also
    --------
    symheli.lpv.stability_margin : distance to the nearest plant that is lost
    symheli.lpv.tools.nu_gaps : nu-gaps of many pairs of models

    References
    ----------
    Vinnicombe (2001), Uncertainty and Feedback, ch. 3.

    Examples
    --------
    >>> soft, stiff = (spring.at(p).discretize(0.1) for p in (0.0, 1.0))
    >>> lpv.nu_gap(soft, soft) < 1e-6, round(lpv.nu_gap(soft, stiff), 2)
    (True, 0.16)
    """
    first, second = sampled_alike(first, second)
    require_same_signals(first, second)
    su = channel_scales(input_scale, "input_scale", len(first.inputs))
    sy = channel_scales(output_scale, "output_scale", len(first.outputs))
    unstable, poles = [], []
    for model in (first, second):
        found = model.poles()
        if np.any(np.abs(np.abs(found) - 1) < ON_THE_CIRCLE):
            raise InputError("nu_gap: a pole lies on the stability boundary")
        unstable.append(int(np.sum(np.abs(found) > 1)))
        poles.append(found)
    angle = angles(np.concatenate(poles), points)

    def responses(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        one, two = (
            m.frequency_response(angle / m.dt) * su[None, None, :] / sy[None, :, None]
            for m in (first, second)
        )  # type: ignore[operator]
        return one, two

    P1, P2 = responses(angle)
    for _ in range(MAX_REFINEMENTS):
        coarse = np.flatnonzero(np.abs(_turns(P1, P2)) > np.pi / 4)
        if not len(coarse):
            break
        between = 0.5 * (angle[coarse] + angle[coarse + 1])
        angle = np.concatenate([angle, between])
        order = np.argsort(angle)
        angle = angle[order]
        P1, P2 = (
            np.concatenate(pair)[order] for pair in zip((P1, P2), responses(between), strict=True)
        )
    if _winding(P1, P2) + unstable[0] - unstable[1] != 0:
        return 1.0
    return float(_chordal(P1, P2).max())


def sampled_alike(*models: LinearModel) -> tuple[LinearModel, ...]:
    """Return discrete models as they are, continuous ones after one bilinear transformation, which
    preserves gains and the nu-gap; raise `InputError` unless they have one sample period.
    """
    for model in models:
        if not isinstance(model, LinearModel):
            raise InputError(
                f"expected a LinearModel, got {type(model).__name__}; an LPV model has .at(p)"
            )
    periods = [m.dt for m in models]
    if not all(same_period(dt, periods[0]) for dt in periods):
        raise InputError(
            "expected models with one sample period, or all continuous, got"
            f" {', '.join('continuous' if dt is None else f'{dt:g} s' for dt in periods)};"
            " discretize them"
        )
    if periods[0] is not None:
        return models
    fastest = float(np.abs(np.concatenate([m.poles() for m in models])).max(initial=0.0))
    dt = 1.0 / fastest if fastest > 0 else 1.0  # no pole is at 2/dt, which would go to infinity
    return tuple(m.discretize(dt, "tustin") for m in models)


def channel_scales(given: object, name: str, channels: int) -> Array:
    """Return one scale for each channel; raise `InputError` unless they are positive and within
    `SCALE_LIMITS`.
    """
    scales = frozen(given, name)
    if scales.shape not in ((), (1,), (channels,)):
        raise InputError(f"{name}: expected a number or {channels} of them, got {scales.shape}")
    if not np.all((scales >= SCALE_LIMITS[0]) & (scales <= SCALE_LIMITS[1])):
        raise InputError(
            f"{name}: expected numbers from {SCALE_LIMITS[0]:.0e} to {SCALE_LIMITS[1]:.0e},"
            f" got {given!r:.60}"
        )
    return np.broadcast_to(scales, (channels,))


def chordal_distance(
    first: LinearModel,
    second: LinearModel,
    omega: object,
    *,
    input_scale: object = 1.0,
    output_scale: object = 1.0,
) -> np.ndarray:
    """Return the pointwise chordal distance of two models with the same signals.

    Its largest value over all frequencies is the nu-gap where the winding-number condition holds;
    over a band it says how far apart the models are there, whatever their slow modes.

    Parameters
    ----------
    first, second : LinearModel
        With the same signals.
    omega : array (n,)
        rad/s.
    input_scale, output_scale : float or array
        As in `nu_gap`.

    Returns
    -------
    array (n,)
        In [0, 1].

    Raises
    ------
    InputError
        Other signals.

    References
    ----------
    Vinnicombe (2001), Uncertainty and Feedback, ch. 3.

    Examples
    --------
    >>> lpv.tools.chordal_distance(spring.at(0.0), spring.at(1.0), [0.1, 1.0]).round(2)
    array([0.08, 0.14])
    """
    require_same_signals(first, second)
    su = channel_scales(input_scale, "input_scale", len(first.inputs))
    sy = channel_scales(output_scale, "output_scale", len(first.outputs))
    return _chordal(
        *(
            m.frequency_response(omega) * su[None, None, :] / sy[None, :, None]
            for m in (first, second)
        )
    )


def require_same_signals(
    first: LinearModel | LinearModels, second: LinearModel | LinearModels
) -> None:
    """Raises `InputError` unless inputs and outputs are the same, in the same order."""
    if first.inputs != second.inputs or first.outputs != second.outputs:
        raise InputError(
            "nu-gap: expected models with the same inputs and outputs in the same order, got"
            f" {first.inputs} to {first.outputs} and {second.inputs} to {second.outputs}"
        )


def angles(poles: np.ndarray, points: int) -> np.ndarray:
    """Angles of z from 0 to pi: logarithmic, and around every pole as dense as it is close to the
    circle.
    """
    speed = np.abs(np.log(poles[poles != 0].astype(complex)))  # in units of 1/dt
    slowest = min(1.0, float(speed.min(initial=1.0)))
    around = np.sinh(np.linspace(-8.0, 8.0, 41))
    near = (np.abs(np.angle(poles))[:, None] + np.abs(np.abs(poles) - 1)[:, None] * around).ravel()
    return np.unique(
        np.concatenate(
            [[0.0], np.geomspace(1e-3 * slowest, np.pi, points), near[(near > 0) & (near < np.pi)]]
        )
    )


def nu_gaps(
    model: LinearModel,
    others: LinearModels,
    *,
    input_scale: object = 1.0,
    output_scale: object = 1.0,
    points: int = 100,
) -> Array:
    """Return the nu-gap from one model to each of many, as `nu_gap` does for two.

    All on the frequencies of the one model's poles, then closer around the largest distance of
    each. A model in which the winding number cannot be told on these goes through `nu_gap` itself.

    Parameters
    ----------
    model : LinearModel
        Discrete, or continuous, which goes through `nu_gap` itself.
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
    >>> ladder = lpv.tools.LinearModels.of([spring.at(p).discretize(0.1) for p in (0.0, 0.5, 1.0)])
    >>> lpv.tools.nu_gaps(ladder[0], ladder).round(2)
    array([0.  , 0.09, 0.16])
    """
    if model.dt is None and others.dt is None:
        each = (others[k] for k in range(len(others)))
        su, sy = input_scale, output_scale
        return np.array([nu_gap(model, m, input_scale=su, output_scale=sy) for m in each])
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
        part = others.take(rows)
        P2 = _responses(part, np.broadcast_to(angle, (len(rows), len(angle))), su, sy)
        turns = _turns(P1, P2)
        same = -np.rint(turns.sum(axis=1) / np.pi) + extra[rows] == 0
        distance = _chordal(P1, P2)
        peak = distance.argmax(axis=1)
        low, high = angle[np.maximum(peak - 1, 0)], angle[np.minimum(peak + 1, len(angle) - 1)]
        near = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, REFINED_FREQUENCIES)
        closer = _chordal(
            _responses(one.take(np.zeros(len(rows), int)), near, su, sy),
            _responses(part, near, su, sy),
        )
        largest = np.maximum(distance.max(axis=1), closer.max(axis=1))
        out[rows] = np.where(same, np.minimum(largest, 1.0), 1.0)
        for k in np.flatnonzero(np.abs(turns).max(axis=1) > np.pi / 4):
            out[rows[k]] = nu_gap(
                model, part[int(k)], input_scale=su, output_scale=sy, points=FINER * points
            )
    return out


def _responses(models: LinearModels, angle: Array, su: Array, sy: Array) -> Array:
    """(K, n, ny, nu) at angles (K, n) of z, in units of the scales."""
    z = np.exp(1j * angle)[:, :, None, None]
    pencil = z * np.eye(models.A.shape[1]) - models.A[:, None]
    B = np.broadcast_to(models.B[:, None], (*angle.shape, *models.B.shape[1:]))
    G = models.C[:, None] @ np.linalg.solve(pencil, B) + models.D[:, None]
    return G * su / sy[:, None]


def _turns(P1: Array, P2: Array) -> Array:
    """Angles (..., n - 1) by which det(I + P2* P1) turns from one frequency to the next."""
    f = np.linalg.det(np.eye(P1.shape[-1]) + _adjoint(P2) @ P1)
    return np.angle(f[..., 1:] / f[..., :-1])


def _winding(P1: Array, P2: Array) -> int:
    """Clockwise turns about 0 of det(I + P2* P1) along the unit circle (upper half, doubled by
    symmetry): zeros less poles outside it.
    """
    return -round(float(np.sum(_turns(P1, P2)) / np.pi))  # both half circles: 2 x sum / (2 pi)


def _chordal(P1: Array, P2: Array) -> Array:
    """Largest singular value of (I + P2 P2*)^-1/2 (P1 - P2)(I + P1* P1)^-1/2 at each frequency.

    A root is any factor: R of the QR decomposition of [I; P2*] has R* R = I + P2 P2*, and forms no
    square, which at the gains near an integrator's pole would lose the identity.
    """
    left = _adjoint(_root(_adjoint(P2)))
    right = _adjoint(_root(P1))
    scaled = np.linalg.solve(right, _adjoint(np.linalg.solve(left, P1 - P2)))
    return np.linalg.svd(scaled, compute_uv=False)[..., 0]


def _root(P: Array) -> Array:
    """R with R* R = I + P* P."""
    eye = np.broadcast_to(np.eye(P.shape[-1]), (*P.shape[:-2], P.shape[-1], P.shape[-1]))
    return np.asarray(np.linalg.qr(np.concatenate([eye, P], axis=-2), mode="r"))


def _adjoint(M: Array) -> Array:
    return np.conj(np.swapaxes(M, -1, -2))
