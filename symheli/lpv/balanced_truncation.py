"""Model reduction: truncation balanced over the whole range of the scheduling, for stable and
unstable models.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
from scipy.linalg import solve_continuous_are, solve_discrete_are

from symheli.errors import InputError
from symheli.lpv.bases.function_space import tensor_grid
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.nu_gap import angles, channel_scales, nu_gap
from symheli.values.arrays import Array
from symheli.values.signal import Signal
from symheli.values.summary import summarized

Model = TypeVar("Model", LPVStateSpace, LinearModel)

NEGLIGIBLE = 1e-7
"""A state with a singular value below this fraction of the largest counts as absent: the square
root of the rounding of Riccati solutions.
"""


@dataclass(frozen=True, eq=False)
class BalancedTruncation(Generic[Model]):
    """The truncated `model`, and its error with p frozen at each of `p` (K,), between the points
    that were balanced.

    `singular_values` (nx,): importance of each balanced state, those beyond the order were left
    out. `nu_gap` (K,) in [0, 1] between truncated and full model. `error` (K,): largest gain of
    their difference over frequency by that of the full model, NaN where one of them is unstable.
    Both with scaled channels, on a frequency grid. With d scheduling parameters `p` is (K, d).
    Nothing is promised for p that moves.
    """

    model: Model
    singular_values: Array
    p: Array
    nu_gap: Array
    error: Array

    __repr__ = summarized


def balanced_truncation(
    model: Model,
    order: int,
    *,
    nodes: int = 21,
    input_scale: object = 1.0,
    output_scale: object = 1.0,
) -> BalancedTruncation[Model]:
    """Reduce the number of states by one constant projection that balances the means over p of the
    frozen Gramians.

    The Gramians are those of the normalised coprime factors, solutions of the Riccati equations of
    u'u + y'y: they exist for unstable models and belong to the nu-gap. One projection for all p
    keeps the dependence on p in its basis and adds no terms where p moves. Poles on the stability
    boundary (a heading) are refused by the nu-gap: leave such states out first.

    Parameters
    ----------
    model : LPVStateSpace or LinearModel
        With nx states.
    order : int
        States to keep.
    nodes : int
        Values of p over which the Gramians are averaged.
    input_scale, output_scale : float or array
        Inputs and outputs are divided by it (one a channel, in their units); what counts as
        important depends on it.

    Returns
    -------
    BalancedTruncation
        The model and the frozen error it makes.

    Raises
    ------
    InputError
        An order that is not below the number of states that matter, or a frozen model that is not
        stabilisable and detectable.

    References
    ----------
    Jonckheere and Silverman (1983), IEEE Trans. Automatic Control 28; Meyer (1990), 35; means of
    frozen Gramians after Wood, Goddard and Glover (1996), CDC.

    Examples
    --------
    >>> sampled = spring.discretize(0.1)
    >>> small = lpv.balanced_truncation(sampled, 1)
    >>> small.model.at(0.5).A.shape, bool(small.nu_gap.max() < 1)
    ((1, 1), True)
    """
    nx = len(model.states)
    if not isinstance(order, int) or isinstance(order, bool) or not 0 < order < nx:
        raise InputError(
            f"order: expected an integer from 1 to {nx - 1} (the model has {nx} states), got"
            f" {order!r}"
        )
    su = channel_scales(input_scale, "input_scale", len(model.inputs))
    sy = channel_scales(output_scale, "output_scale", len(model.outputs))
    balanced = _nodes(model, nodes)
    gramians = [_gramians(m, su, sy, p) for p, m in balanced]
    X, Y = (np.mean(parts, axis=0) for parts in zip(*gramians, strict=True))
    Lx, Ly = _root(X), _root(Y)
    U, values, V = np.linalg.svd(Lx.T @ Ly)
    if values[order - 1] <= NEGLIGIBLE * values[0]:
        count = int(np.sum(values > NEGLIGIBLE * values[0]))
        raise InputError(
            f"order: only {count} of the {nx} states can be excited and seen; keep {count} or fewer"
        )
    size = np.sqrt(values[:order])
    left, right = Lx @ U[:, :order] / size, Ly @ V[:order].T / size
    small = _projected(model, left, right)
    pairs = list(zip(_between(model, nodes), _between(small, nodes), strict=True))
    compared = [_comparable(full, reduced) for (_, full), (_, reduced) in pairs]
    gaps = [nu_gap(*pair, input_scale=su, output_scale=sy) for pair in compared]
    errors = [_relative_error(*pair, su, sy) for pair in compared]
    p = np.array([np.squeeze(p) for (p, _), _ in pairs])
    return BalancedTruncation(small, values, p, np.array(gaps), np.array(errors))


def _nodes(model: LPVStateSpace | LinearModel, count: int) -> list[tuple[Array, LinearModel]]:
    """Models at `count` values of every parameter."""
    if isinstance(model, LinearModel):
        return [(np.array([np.nan]), model)]
    axes = [np.linspace(s.low, s.high, count) for s in model.parameters]
    return [(p, model.at(*p)) for p in tensor_grid(axes)]


def _between(model: LPVStateSpace | LinearModel, count: int) -> list[tuple[Array, LinearModel]]:
    """Models half way between those."""
    if isinstance(model, LinearModel):
        return _nodes(model, count)
    axes = [np.linspace(s.low, s.high, 2 * count - 1)[1::2] for s in model.parameters]
    return [(p, model.at(*p)) for p in tensor_grid(axes)]


def _gramians(model: LinearModel, su: Array, sy: Array, p: Array) -> tuple[Array, Array]:
    """Solutions of the control and filter Riccati equations with scaled channels."""
    A, B, C, D = model.A, model.B * su, model.C / sy[:, None], model.D * su / sy[:, None]
    solve = solve_continuous_are if model.dt is None else solve_discrete_are
    try:
        X = solve(A, B, C.T @ C, np.eye(B.shape[1]) + D.T @ D, s=C.T @ D)
        Y = solve(A.T, C.T, B @ B.T, np.eye(C.shape[0]) + D @ D.T, s=B @ D.T)
    except (np.linalg.LinAlgError, ValueError) as error:
        where = "" if np.isnan(p).any() else f" at p = {', '.join(f'{v:.4g}' for v in p)}"
        raise InputError(
            f"the frozen model{where} is not stabilisable and detectable, it cannot be balanced"
            f" ({error})"
        ) from error
    return X, Y


def _root(M: Array) -> Array:
    values, vectors = np.linalg.eigh(0.5 * (M + M.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))


def _projected(model: Model, left: Array, right: Array) -> Model:
    states = tuple(Signal(f"x{i + 1}") for i in range(right.shape[1]))
    parts = dict(A=left.T @ model.A @ right, B=left.T @ model.B, C=model.C @ right, states=states)
    if isinstance(model, LinearModel):
        return replace(model, **parts, point=None)
    trim = model.trim and model.trim.projected(left)
    return replace(model, **parts, trim=trim, residuals=None)


def _comparable(full: LinearModel, small: LinearModel) -> tuple[LinearModel, LinearModel]:
    """Return both as discrete models: continuous ones by the same bilinear transformation, which
    preserves gains and the nu-gap.
    """
    if full.dt is not None:
        return full, small
    fastest = float(np.abs(full.poles()).max(initial=0.0))
    dt = 2.0 / fastest if fastest > 0 else 1.0  # maps the fastest pole to a quarter of the circle
    return _bilinear(full, dt), _bilinear(small, dt)


def _bilinear(model: LinearModel, dt: float) -> LinearModel:
    inverse = np.linalg.inv(np.eye(len(model.A)) - 0.5 * dt * model.A)
    A, B = inverse @ (np.eye(len(model.A)) + 0.5 * dt * model.A), inverse @ model.B * dt
    return replace(model, A=A, B=B, C=model.C @ inverse, D=model.D + 0.5 * model.C @ B, dt=dt)


def _relative_error(one: LinearModel, two: LinearModel, su: Array, sy: Array) -> float:
    if not (one.is_stable() and two.is_stable()):
        return float("nan")
    omega = angles(np.concatenate([one.poles(), two.poles()]), 1000) / one.dt  # type: ignore[operator]
    G, R = (m.frequency_response(omega) * su / sy[:, None] for m in (one, two))
    size = np.linalg.norm(G, 2, axis=(1, 2)).max()
    return float(np.linalg.norm(G - R, 2, axis=(1, 2)).max() / size) if size > 0 else 0.0
