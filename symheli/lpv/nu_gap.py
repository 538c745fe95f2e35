"""Vinnicombe's nu-gap between linear models: how far apart they are for feedback."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import matrix_balance, schur

from symheli.errors import InputError
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.linear_models import LinearModels
from symheli.values.arrays import Array, frozen
from symheli.values.sample_period import same_period

ON_THE_CIRCLE = 1e3 * np.finfo(float).eps
"""A pole this close to the unit circle may be on it: what rounding moves the eigenvalues of a small
matrix by.
"""

LEAST_LEFT = 1e-2
"""Fraction of a column that one projection must leave to be enough."""

ROUNDING = 1e-10
"""Largest rounding of norms and their squares, where 1 is the largest."""

STRIDE, STEEPER = 4, 2.0
"""Two models are compared on every fourth frequency first. Between two of these the distance is
taken to rise at most twice as much as it changes about there.
"""

TURN = np.pi / 4
"""Largest turn of the determinant between two frequencies, rad."""

MAX_REFINEMENTS = 30
"""Largest number of bisections of a frequency interval until the phase of the determinant changes
little in it.
"""

SCALE_LIMITS = 1e-60, 1e60
"""Permitted channel scales; their squares neither overflow nor underflow."""

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
    around them: every fourth first, then the others where the distance may reach the largest, and
    points between them where the response turns by more than an eighth of a circle.

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
    grid = angles(np.concatenate(poles), points)
    graphs = [_graphs(m.A, m.B, m.C, m.D, su, sy) for m in (first, second)]
    angle = np.append(grid[:-1:STRIDE], grid[-1])
    Q = [own(angle) for own in graphs]
    more = grid[_between(len(grid), Q[0], Q[1])]
    for left in reversed(range(MAX_REFINEMENTS + 1)):
        if len(more):
            at = np.searchsorted(angle, more)
            angle = np.insert(angle, at, more)
            Q = [np.insert(Q[i], at, own(more), axis=2) for i, own in enumerate(graphs)]
        cosines = _cosines(*Q)
        turns = _turns(cosines)
        coarse = np.flatnonzero(np.abs(turns) > TURN)
        more = 0.5 * (angle[coarse] + angle[coarse + 1])
        if not len(more) or not left:
            break
    if _winding(turns) + unstable[0] - unstable[1] != 0:
        return 1.0
    return _largest(Q[0], Q[1], cosines)[0]


def _between(count: int, Q1: Array, Q2: Array) -> Array:
    """Return the indices of the points that are needed besides every `STRIDE`th of `count`.

    They lie where the determinant turns, and where the distance may reach the largest by `STEEPER`
    times its changes about there. Q1 and Q2 are the bases at every `STRIDE`th point and the last.
    """
    cosines = _cosines(Q1, Q2)
    distance, turns = _norms(_apart(Q1, Q2, cosines)), _turns(cosines)
    change = np.pad(np.abs(np.diff(distance)), 1, mode="edge")
    steepest = np.max([change[:-2], change[1:-1], change[2:]], axis=0)
    highest = np.maximum(distance[1:], distance[:-1]) + STEEPER * steepest
    most = max(distance.max(), ROUNDING)
    wanted = (highest >= most) | (np.abs(turns) > TURN)
    k = np.arange(count - 1)
    return np.flatnonzero(wanted[k // STRIDE] & (k % STRIDE > 0))


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
    Q1, Q2 = (
        _orthonormal(
            m.frequency_response(omega).transpose(1, 2, 0) * su[:, None] / sy[:, None, None]
        )
        for m in (first, second)
    )
    return _norms(_apart(Q1, Q2, _cosines(Q1, Q2)))


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
    one = _graphs(model.A, model.B, model.C, model.D, su, sy)
    Q1, out = one(angle), np.zeros(len(others))
    for k, matrices in enumerate(zip(others.A, others.B, others.C, others.D, strict=True)):
        two = _graphs(*matrices, su, sy)
        Q2 = two(angle)
        cosines = _cosines(Q1, Q2)
        turns = _turns(cosines)
        if np.abs(turns).max() > TURN:
            out[k] = nu_gap(
                model, others[k], input_scale=su, output_scale=sy, points=FINER * points
            )
        elif _winding(turns) + extra[k] != 0:
            out[k] = 1.0
        else:
            largest, peak = _largest(Q1, Q2, cosines)
            ends = angle[max(peak - 1, 0)], angle[min(peak + 1, len(angle) - 1)]
            near = np.linspace(*ends, REFINED_FREQUENCIES)
            Q3, Q4 = one(near), two(near)
            out[k] = max(largest, _largest(Q3, Q4, _cosines(Q3, Q4))[0])
    return out


def _graphs(
    A: Array, B: Array, C: Array, D: Array, su: Array, sy: Array
) -> Callable[[Array], Array]:
    """Return the function from angles (n,) of z to orthonormal bases of the pairs (u, G(z) u) in
    units of the scales (nu + ny, nu, n).

    It takes one Schur form of the balanced A, and solves a triangular system at each z.
    """
    balanced, (scale, _) = matrix_balance(A, permute=False, separate=True)
    T, Q = schur(balanced, output="complex")  # type: ignore[misc]
    B, C, D = (
        Q.conj().T @ (B * su / scale[:, None]),
        (C * scale / sy[:, None]) @ Q,
        D * su / sy[:, None],
    )
    (nx, nu), ny = B.shape, len(C)

    def graphs(angle: Array) -> Array:
        z = np.exp(1j * angle)
        X = np.repeat(B, len(z), axis=1)  # (nx, nu n): of each input at every z
        inverse = 1.0 / (z - T.diagonal()[:, None])
        for i in reversed(range(nx)):
            X[i] += T[i, i + 1 :] @ X[i + 1 :]
            X[i].reshape(nu, len(z))[:] *= inverse[i]
        return _orthonormal((C @ X).reshape(ny, nu, len(z)) + D[:, :, None])

    return graphs


def _orthonormal(P: Array) -> Array:
    """Return orthonormal bases (nu + ny, nu, n) of [I; P] for P (ny, nu, n), by Gram and Schmidt.

    A column is projected again where little of it is left. Squares of P would lose the identity at
    the gains near an integrator's pole.
    """
    _, nu, n = P.shape
    Q = np.concatenate([np.broadcast_to(np.eye(nu)[:, :, None], (nu, nu, n)), P])
    for j in range(nu):
        v, where = Q[:, j], slice(None)
        left = size = np.linalg.norm(v, axis=0)
        for _ in range(2 if j else 0):
            before, own = Q[:, :j, where], v[:, where]
            own = own - np.einsum("ikn,kn->in", before, np.einsum("ikn,in->kn", before.conj(), own))
            v[:, where] = own
            left = np.linalg.norm(v, axis=0)
            where = np.flatnonzero(left < LEAST_LEFT * size)
            if not len(where):
                break
        v /= left
    return Q


def _cosines(Q1: Array, Q2: Array) -> Array:
    """Q2* Q1 (nu, nu, n)."""
    return np.einsum("kin,kjn->ijn", Q2.conj(), Q1)


def _turns(cosines: Array) -> Array:
    """Angles (n - 1,) by which det(Q2* Q1), and with it det(I + P2* P1), turns from one frequency
    to the next.
    """
    f = np.linalg.det(np.moveaxis(cosines, 2, 0))
    return np.angle(f[1:] / f[:-1])


def _winding(turns: Array) -> int:
    """Clockwise turns about 0 of det(I + P2* P1) along the unit circle (upper half, doubled by
    symmetry): zeros less poles outside it.
    """
    return -round(float(np.sum(turns) / np.pi))  # both half circles: 2 x sum / (2 pi)


def _apart(Q1: Array, Q2: Array, cosines: Array) -> Array:
    """Return Q1 less its projection on Q2 (n, nu + ny, nu).

    Its largest singular value is the chordal distance, that of (I + P2 P2*)^-1/2 (P1 - P2)(I + P1*
    P1)^-1/2.
    """
    return np.moveaxis(Q1 - np.einsum("kin,ijn->kjn", Q2, cosines), 2, 0)


def _norms(W: Array) -> Array:
    """Return the largest singular value of each W (n, .., ..), at most 1."""
    square = np.linalg.eigvalsh(W.conj().swapaxes(1, 2) @ W)[:, -1]
    return np.sqrt(np.clip(square, 0.0, 1.0))


def _largest(Q1: Array, Q2: Array, cosines: Array) -> tuple[float, int]:
    """Return the largest chordal distance, and where it is.

    It is computed only where the sum of the squares of all singular values allows it.
    """
    nu = len(cosines)
    squares = nu - np.einsum("ijn,ijn->n", cosines, cosines.conj()).real
    near = np.flatnonzero(squares >= squares.max() / nu - ROUNDING)
    W = _apart(Q1[:, :, near], Q2[:, :, near], cosines[:, :, near])
    sizes = np.linalg.norm(W, axis=(1, 2))
    least = _norms(W[[sizes.argmax()]]) * (1 - ROUNDING)
    large = np.flatnonzero(sizes >= least)
    found = _norms(W[large])
    return float(found.max()), int(near[large[found.argmax()]])
