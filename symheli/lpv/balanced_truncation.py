"""Model reduction: truncation balanced over the whole range of the scheduling, for stable and
unstable models.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Generic, Literal

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.balancing import Model, balanced_gramians, method, projected, response_gramians
from symheli.lpv.bases.function_space import tensor_grid
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.minimal_realization import minimal_realization
from symheli.lpv.nu_gap import angles, channel_scales, nu_gap, sampled_alike
from symheli.lpv.riccati import regulator
from symheli.values.arrays import Array
from symheli.values.numbers import positive
from symheli.values.summary import summarized

Balance = Literal["factors", "response"]

METHODS: dict[str, Balance] = {"coprime": "factors", "balanced": "response"}
"""Methods of `reduce` by their names, with the Gramians that each balances."""
NODES = 21
"""Values of each parameter over which Gramians are averaged."""
BETWEEN = slice(1, None, 2)
"""Of twice as many values those half way between."""
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
    Nothing is promised for p that moves. `bound`, of a linear model: neither the nu-gap (balanced
    for feedback) nor the largest gain of the difference (balanced for the response, in the units of
    the scaled channels) is above it; NaN over a parameter, of
    `synthesis.designs.bounded_truncation` for any motion of p.
    """

    model: Model
    singular_values: Array
    p: Array
    nu_gap: Array
    error: Array
    bound: float

    __repr__ = summarized


def balanced_truncation(
    model: Model,
    order: int,
    *,
    balance: Balance = "factors",
    nodes: int = NODES,
    input_scale: object = 1.0,
    output_scale: object = 1.0,
) -> BalancedTruncation[Model]:
    """Reduce the number of states by one constant projection that balances the means over p of the
    frozen Gramians.

    For use in feedback the Gramians are those of the normalised coprime factors, solutions of the
    Riccati equations of u'u + y'y: they exist for unstable models and belong to the nu-gap, but
    modes that a controller moves anyway count little. For the open-loop response they are those of
    a stable model itself. One projection for all p keeps the dependence on p in its basis and adds
    no terms where p moves. Poles on the stability boundary (a heading) are refused by the nu-gap:
    leave such states out first.

    Parameters
    ----------
    model : LPVStateSpace or LinearModel
        With nx states.
    order : int
        States to keep.
    balance : str
        "factors" (of normalised coprime factors, for feedback) or "response" (open loop).
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
        stabilisable and detectable, for the response not stable.

    See Also
    --------
    symheli.lpv.minimal_realization : fewer states, the same response
    synthesis.designs.bounded_truncation : with an error bound while p moves

    References
    ----------
    Jonckheere and Silverman (1983), IEEE Trans. Automatic Control 28; Meyer (1990), 35; the bounds
    of Enns (1984), IEEE CDC, and Glover (1984), Int. J. Control 39; means of frozen Gramians after
    Wood, Goddard and Glover (1996), CDC.

    Examples
    --------
    >>> sampled = spring.discretize(0.1)
    >>> small = lpv.balanced_truncation(sampled, 1)
    >>> small.model.at(0.5).A.shape, bool(small.nu_gap.max() < 1)
    ((1, 1), True)
    """
    check_order(order, model)
    su = channel_scales(input_scale, "input_scale", len(model.inputs))
    sy = channel_scales(output_scale, "output_scale", len(model.outputs))
    gramians = mean_gramians(model, balance, nodes, su, sy)
    found = truncated_by(gramians, model, order, balance, nodes, su, sy)
    return found if isinstance(model, LinearModel) else replace(found, bound=np.nan)


def reduced(
    model: Model, order: int | None = None, by: str | None = None, loss: float | None = None
) -> Model:
    """See `LPVStateSpace.reduce`."""
    if by == "bounded":
        raise InputError(
            "by: the method with a bound while p moves solves matrix inequalities; it is"
            " synthesis.designs.bounded_truncation(model, order).model"
        )
    by = method(by, order, loss, *METHODS)
    if by == "minimal":
        return minimal_realization(model)
    if order == len(model.states) or (order is None and not model.states):
        return model
    if order is not None:
        return balanced_truncation(model, order, balance=METHODS[by]).model
    allowed = math.inf if loss is None else positive(loss, "loss", or_zero=True)
    balance = METHODS[by]
    su, sy = np.ones(len(model.inputs)), np.ones(len(model.outputs))
    gramians = mean_gramians(model, balance, NODES, su, sy)
    matter = _matter(balanced_gramians(*gramians).values)
    for k in range(matter if loss is None else 1, min(matter + 1, len(model.states))):
        found = truncated_by(gramians, model, k, balance, NODES, su, sy)
        error = found.nu_gap if balance == "factors" else found.error
        if loss is None or error.max() <= allowed:
            return found.model
    return model


def _matter(values: Array) -> int:
    """Return how many states can be excited and seen, by their falling singular values."""
    return int(np.sum(values > NEGLIGIBLE * values.max(initial=0.0)))


def mean_gramians(
    model: LPVStateSpace | LinearModel, balance: Balance, nodes: int, su: Array, sy: Array
) -> tuple[Array, Array]:
    """The means over frozen p of the Gramians of observability and reachability, or of those of
    control and filtering; raises `InputError` where there are none.
    """
    if balance not in (rules := {"factors": _of_factors, "response": _of_response}):
        raise UnknownNameError("balance", balance, list(rules))
    each = [rules[balance](m, su, sy, p) for p, m in _frozen(model, nodes)]
    X, Y = (np.mean(parts, axis=0) for parts in zip(*each, strict=True))
    return X, Y


def check_order(order: int, model: LPVStateSpace | LinearModel) -> None:
    """Raises `InputError` unless there are more states than `order`."""
    nx = len(model.states)
    if not isinstance(order, int) or isinstance(order, bool) or not 0 < order < nx:
        if nx < 2:
            raise InputError(f"order: a model of {nx} states cannot be truncated")
        raise InputError(
            f"order: expected an integer from 1 to {nx - 1} (the model has {nx} states), got"
            f" {order!r}"
        )


def truncated_by(
    gramians: tuple[Array, Array],
    model: Model,
    order: int,
    balance: Balance,
    nodes: int,
    su: Array,
    sy: Array,
) -> BalancedTruncation[Model]:
    """Project on the states of the largest singular values of these Gramians, of observability (of
    factors: of control) and of reachability (of filtering); `bound` is twice the tail, which is one
    for all p where the Gramians are.
    """
    into, out, values = balanced_gramians(*gramians)
    if (count := _matter(values)) < order:
        raise InputError(
            f"order: only {count} of the {len(values)} states can be excited and seen; keep"
            f" {count} or fewer"
        )
    small = projected(model, into[:order], out[:, :order])
    between = (_frozen(each, 2 * nodes - 1, BETWEEN) for each in (model, small))
    pairs = list(zip(*between, strict=True))
    compared = [sampled_alike(full, reduced) for (_, full), (_, reduced) in pairs]
    gaps = [nu_gap(full, reduced, input_scale=su, output_scale=sy) for full, reduced in compared]
    errors = [_relative_error(full, reduced, su, sy) for full, reduced in compared]
    p = np.array([np.squeeze(p) for (p, _), _ in pairs])
    tail = values[order:]
    if balance == "factors":
        tail = tail / np.sqrt(1 + tail**2)  # Hankel singular values of the factors
    bound = 2.0 * float(tail.sum())
    return BalancedTruncation(small, values, p, np.array(gaps), np.array(errors), bound)


def _frozen(
    model: LPVStateSpace | LinearModel, count: int, those: slice = slice(None)
) -> list[tuple[Array, LinearModel]]:
    """Models at those of `count` values of every parameter."""
    if isinstance(model, LinearModel):
        return [(np.array([np.nan]), model)]
    axes = [np.linspace(s.low, s.high, count)[those] for s in model.parameters]
    return [(p, model.at(*p)) for p in tensor_grid(axes)]


def _of_response(model: LinearModel, su: Array, sy: Array, p: Array) -> tuple[Array, Array]:
    """Observability and reachability Gramians with scaled channels."""
    if not model.is_stable():
        raise InputError(
            f"the frozen model{_where(p)} is not stable: its response has no Gramians; balance the"
            ' coprime factors, balance="factors" or reduce(by="coprime")'
        )
    return response_gramians(model.A, model.B * su, model.C / sy[:, None], model.dt)


def _where(p: Array) -> str:
    return "" if np.isnan(p).any() else f" at p = {', '.join(f'{v:.4g}' for v in np.ravel(p))}"


def _of_factors(model: LinearModel, su: Array, sy: Array, p: Array) -> tuple[Array, Array]:
    """Solutions of the control and filter Riccati equations with scaled channels."""
    A, B, C, D = model.A, model.B * su, model.C / sy[:, None], model.D * su / sy[:, None]
    R, S = np.eye(B.shape[1]) + D.T @ D, np.eye(C.shape[0]) + D @ D.T
    sides = {"": (A, B, C.T @ C, R, C.T @ D), " for the adjoint": (A.T, C.T, B @ B.T, S, B @ D.T)}
    found = []
    for side, equation in sides.items():
        try:
            found.append(regulator(*equation, dt=model.dt).X)
        except InputError as error:
            raise InputError(
                f"the frozen model{_where(p)} is not stabilisable and detectable, it cannot be"
                f" balanced ({error}{side}); .reduce() leaves out states that no input reaches or"
                " no output shows"
            ) from error
    return found[0], found[1]


def _relative_error(one: LinearModel, two: LinearModel, su: Array, sy: Array) -> float:
    if not (one.is_stable() and two.is_stable()):
        return float("nan")
    omega = angles(np.concatenate([one.poles(), two.poles()]), 1000) / one.dt  # type: ignore[operator]
    G, R = (m.frequency_response(omega) * su / sy[:, None] for m in (one, two))
    size = np.linalg.norm(G, 2, axis=(1, 2)).max()
    return float(np.linalg.norm(G - R, 2, axis=(1, 2)).max() / size) if size > 0 else 0.0
