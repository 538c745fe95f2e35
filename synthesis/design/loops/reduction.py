"""Reduction of a controller by its reachability and observability within the loop.

The Gramians are those of the closed loop, the block of the controller's states: what disturbances
do to them, and what they do to the performance, averaged over frozen p. One constant projection
for all p keeps the dependence on p what it was (truncation with the closed loop as the weight:
Enns 1984; Anderson and Liu, IEEE Trans. Automatic Control 34 (1989); one projection over p: Wood,
Goddard and Glover, CDC 1996). The analysis of the loop shows whether it was too much.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from symheli import LPVStateSpace
from symheli.errors import InputError, SynthesisError
from symheli.lpv.balancing import (
    REGULAR,
    Balancing,
    balanced_gramians,
    method,
    projected,
    response_gramians,
)
from symheli.lpv.bases.polynomials import lobatto_points
from symheli.lpv.tools import lower_feedback
from symheli.values.arrays import Array
from symheli.values.signal import signals
from synthesis.design.loops.controller import Controller
from synthesis.numerics.linear.norm import norm, stable

NOT_STABLE = (
    "the closed loop is not stable at every frozen p: it has no Gramians by which the states of"
    " the controller could be reduced"
)

NODES = {1: 14, 2: 6}
"""Values of each parameter at which the loop is evaluated (more parameters: 4)."""


def by_itself(controller: Controller, order: int | None, by: str, loss: float | None) -> Controller:
    """Return the controller whose model was reduced without the loop; see `LPVStateSpace.reduce`.

    By "minimal" it is the same controller, and promises what it did. Raises `SynthesisError` where
    the loop is not stable at some frozen p.
    """
    by = method(by, order, loss, "coprime", "balanced", "loop")
    model = controller.model.reduce(order, by=by, loss=loss)
    if len(model.states) == controller.order:
        return controller
    if by == "minimal":
        return replace(controller, model=_numbered(model))
    return _FullController(controller).checked(model)


def reduced(controller: Controller, order: int) -> Controller:
    """Return the controller with at most `order` states. It has no promised gain, and a note gives
    the frozen gains of its loop and of the full one.

    Raises `InputError` for an order below 0, `SynthesisError` where the loop is not stable at some
    frozen p, before or after.
    """
    if isinstance(order, bool) or not isinstance(order, int | np.integer) or order < 0:
        raise InputError(f"order: expected an integer >= 0, got {order!r}")
    if order > controller.order:
        raise InputError(
            f"order: the controller has {controller.order} states, fewer than {order}; give at most"
            f" {controller.order}"
        )
    return controller if order >= controller.order else _FullController(controller).kept(order)


def within(controller: Controller, loss: float) -> Controller:
    """Return the controller of least order whose loop has a frozen gain at most the fraction `loss`
    above the full one.

    Raises `InputError` for a loss that is no number >= 0, `SynthesisError` where the loop is not
    stable at some frozen p.
    """
    if isinstance(loss, bool) or not isinstance(loss, int | float) or not 0 <= loss < math.inf:
        raise InputError(
            f"loss: expected a number >= 0, such as 0.03 for 3 % more gain, got {loss!r}"
        )
    whole = frozen_gain(controller)
    if math.isinf(whole):
        raise SynthesisError(NOT_STABLE)
    return fewest(controller, frozen_gain, (1 + loss) * whole)


def fewest(
    controller: Controller,
    gain: Callable[[Controller], float],
    limit: float,
    orders: Iterable[int] | None = None,
) -> Controller:
    """Return the reduced controller of the first of the `orders` (None: every one, from 0 on) with
    gain at most `limit`; the controller itself where there is none.
    """
    whole = _FullController(controller)
    for order in range(controller.order) if orders is None else orders:
        try:
            fewer = whole.kept(order)
        except SynthesisError:
            continue
        if gain(fewer) <= limit:
            return fewer
    return controller


class _FullController:
    """The controller of full order, with the Gramians and gain that all reductions use."""

    def __init__(self, controller: Controller) -> None:
        self.controller = controller

    @cached_property
    def balanced(self) -> Balancing:
        """Coordinates of the states, in falling order of their Hankel singular values in the loop;
        the first rows and columns project on a reduced order.
        """
        reached, seen = gramians(self.controller)
        return balanced_gramians(seen, reached, REGULAR)

    @cached_property
    def gain(self) -> float:
        """Frozen gain of the full loop."""
        return frozen_gain(self.controller)

    def kept(self, order: int) -> Controller:
        """Return the controller of `order` states; raises `SynthesisError` where the loop is not
        stable.
        """
        into, out = self.balanced.into[:order], self.balanced.out[:, :order]
        return self.checked(projected(self.controller.model, into, out))

    def checked(self, model: LPVStateSpace) -> Controller:
        """Return the controller with a model of fewer states; raises `SynthesisError` where the
        loop is not stable.
        """
        controller, n, order = self.controller, self.controller.order, len(model.states)
        made = replace(
            controller,
            model=_numbered(model),
            method=f"{controller.method}, {order} of {n} states kept",
            promised=math.nan,
            optimum=None,
        )
        gain = frozen_gain(made)
        if math.isinf(gain):
            raise SynthesisError(
                f"with {order} of {n} states the closed loop is not stable at every frozen p: keep"
                " more, or reduce(loss=0.03) finds the least order"
            )
        note = (
            f"the largest gain of the loop at frozen p is {gain:.6g}, {self.gain:.6g} of all {n}"
            " states"
        )
        return replace(made, notes=(note,))


def _numbered(model: LPVStateSpace) -> LPVStateSpace:
    return replace(model, states=signals(f"k{i + 1}" for i in range(len(model.states))), trim=None)


def frozen_gain(controller: Controller) -> float:
    """Return the largest H-infinity norm of the frozen loops, inf where one is not stable."""
    return max(norm(*each, controller.loop_plant.dt)[0] for each in _loops(controller))


def gramians(controller: Controller) -> tuple[Array, Array]:
    """Return the reachability and observability Gramians (n, n) of the controller's states in the
    loop: means over frozen p, each in units of its own size.
    """
    n, dt = controller.order, controller.loop_plant.dt
    P, Q = np.zeros((n, n)), np.zeros((n, n))
    loops = list(_loops(controller))
    for A, B, C, _ in loops:
        if not stable(np.linalg.eigvals(A), dt):
            raise SynthesisError(NOT_STABLE)
        seen, reach = response_gramians(A, B, C, dt)
        P += reach[-n:, -n:]
        Q += seen[-n:, -n:]
    return P / len(loops), Q / len(loops)


def _loops(controller: Controller) -> Iterator[tuple[Array, Array, Array, Array]]:
    """A, B, C, D of the closed loops at frozen p; where no basis holds the loop as a function of
    p, plant and controller are closed at each p.
    """
    try:
        loop: LPVStateSpace = controller.closed()
    except InputError:
        return _closed_apart(controller)
    return zip(*loop.matrices(_conditions(loop)), strict=True)


def _closed_apart(controller: Controller) -> Iterator[tuple[Array, Array, Array, Array]]:
    plant, model = controller.loop_plant, controller.model
    open_loop: Any = plant.model
    names = [str(s.name) for s in open_loop.parameters]
    own = [names.index(str(s.name)) for s in model.parameters]
    for p in _conditions(open_loop).reshape(-1, len(names)):
        loop: Any = lower_feedback(
            open_loop.at(*p),
            model.at(*p[own]),
            inputs=plant.disturbances,
            outputs=plant.performance,
        )
        yield loop.A[0], loop.B[0], loop.C[0], loop.D[0]


def _conditions(loop: LPVStateSpace) -> Array:
    return lobatto_points(NODES.get(len(loop.parameters), 4), loop.box)
