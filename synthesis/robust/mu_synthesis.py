"""Robust output feedback at one point by D-K iteration: the structured singular value of the loop.

In turns a controller is designed for the plant between scalings D(s) and their inverses, and the
scalings that make the response of its loop the smallest are found frequency by frequency and
fitted. What the last loop is worth is proven for all frequencies, as margins of several blocks are,
if the loop has few states.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, overload

import numpy as np
from scipy import optimize

from symheli import LFT, LinearModel
from symheli.errors import InputError
from symheli.lpv.linear_model import as_model
from symheli.threads import with_one_thread
from symheli.values.arrays import Array
from symheli.values.numbers import whole
from symheli.values.summary import summarized
from synthesis.robust import witness
from synthesis.robust.design_plant import Asked, DesignPlant, size_of
from synthesis.robust.filters import Filter
from synthesis.robust.gain_design import GainDesign, least_gain, require_goal
from synthesis.robust.intervals import LevelProof
from synthesis.robust.structure import BlockLoop, DynamicBlock
from synthesis.robust.worst_case_gain import worst_member

FREQUENCIES = 80
"""Frequencies at which scalings are found, over the poles of plant and controller and a decade
beyond.
"""
NEAR = 1e-4
"""Weight of the squared step, in logarithms, of scalings from one frequency to the next: where they
do not matter they stay.
"""
GAINED = 1e-3
"""Relative decrease of the level below which an iteration has gained nothing."""
STALLS = 2
"""So many of these one after the other, the next one ends the search."""
FAR = 3.0
"""Step of the scalings towards those found for the last loop, from the second iteration on: near
the end these are close, and plain steps many (1.0: plain ones). Where the level rises by more than
`ROOM`, the next step is from the best design, and this times smaller.
"""
ROOM, LEAST = 0.01, 0.1
"""Relative rise of the level from which the iteration goes on all the same; the least step."""
ORDERS = (4, 2, 0)
"""Orders of the filters that are tried, each from the best level so far on."""
ABOVE, DAMPED = 1.2, 0.7
"""First worst-case gain that is asked for, by that without uncertainty; power of the level by which
it follows.
"""
NOT_STABILISED = "no controller was found that stabilises every member of the set"

NOT_SAMPLED = "the controller of the continuous plant has no sampled one: it would not be causal"


@dataclass(frozen=True, eq=False)
class MuDesign:
    """A controller u = K y with a bound `mu` of the structured singular value of its loop: blocks
    and performance within 1/mu of what was stated keep a gain of mu.

    `mu` is proven for all frequencies where `verified`. Of a loop of more than 24 states it is the
    peak at the frequencies of the design, and computed.

    Parameters
    ----------
    controller : LinearModel or None
        K from measurements to controls, with positive feedback; None where no design was found.
    mu : float
        The bound; inf without a controller.
    omega : float
        The frequency that decides it, rad/s; NaN where `mu` is not proven.
    levels : tuple of float
        The least level found at the frequencies looked at, of each controller that was better than
        those before.
    scalings : tuple of LinearModel
        D of each part for which the controller was designed: parameters, blocks, performance.
    reasons : tuple of str
        Why there is no controller.
    proof : LevelProof, optional
        The numbers that `mu` rests on; None where it is inf or computed.
    asked : tuple, optional
        Model, controls, measurements and blocks.
    """

    controller: LinearModel | None
    mu: float
    omega: float
    levels: tuple[float, ...]
    scalings: tuple[LinearModel, ...]
    reasons: tuple[str, ...] = ()
    proof: LevelProof | None = None
    asked: Asked | None = None

    __repr__ = summarized

    @property
    def verified(self) -> bool:
        """Whether there is a proof, which was checked in exact arithmetic as it was found."""
        return self.proof is not None

    def verify(self, rigorous: bool = False) -> bool:
        """Check the proof of `mu` again in exact arithmetic, from the plant, its blocks and the
        controller; `rigorous`: and the inequality at single frequencies, by a second writing of it.
        """
        if self.proof is None or self.asked is None or self.controller is None:
            return False
        plant, level = DesignPlant.of(*self.asked), self.proof.bound
        loop = plant.loop.in_rationals.behind(self.controller)
        if level is None or self.proof.performance or level > self.mu:
            return False
        return self.proof.verified(loop, plant.parts) and (
            not rigorous or witness.level_is_kept(self.proof, loop)
        )


@overload
def mu_synthesis(
    model: LinearModel | LFT,
    controls: Sequence[str],
    measurements: Sequence[str],
    blocks: Sequence[DynamicBlock] = (),
    *,
    goal: Literal["mu"] = "mu",
    order: int | None = None,
    iterations: int = 8,
    states: int | None = None,
) -> MuDesign: ...
@overload
def mu_synthesis(
    model: LinearModel | LFT,
    controls: Sequence[str],
    measurements: Sequence[str],
    blocks: Sequence[DynamicBlock] = (),
    *,
    goal: Literal["gain"],
    order: int | None = None,
    iterations: int = 8,
    states: int | None = None,
) -> GainDesign: ...
@with_one_thread
def mu_synthesis(
    model: LinearModel | LFT,
    controls: Sequence[str],
    measurements: Sequence[str],
    blocks: Sequence[DynamicBlock] = (),
    *,
    goal: str = "mu",
    order: int | None = None,
    iterations: int = 8,
    states: int | None = None,
) -> MuDesign | GainDesign:
    """Design the output feedback of one model for its uncertain blocks and constant parameters: for
    the least structured singular value by D-K iteration, or for the least worst-case gain.

    D is one stable filter with a stable inverse a block and a parameter, times the identity. Of a
    parameter that is repeated a full matrix, and that it is real, count in the proof alone. A new D
    is kept where the level falls; else a smaller step towards it is tried. The iteration need not
    end at the least mu.

    With `goal="gain"` the uncertainty is the one that is stated, and D-K iteration is the start
    alone. From its best loop BFGS descends on the largest gain over the members of the set that are
    worst. These have real parameters at fixed values, and stable dynamics in the blocks. New worst
    members are added until none is worse, and more states are tried. The gain of the set is then
    proven as by `worst_case_gain` in up to 32 cells. It is a local minimum.

    Parameters
    ----------
    model : LinearModel, system of python-control or LFT
        From disturbances, block inputs and controls to performance, block outputs and measurements;
        the parameters of an LFT are constant and not known.
    controls, measurements : sequence of str
        Inputs that the controller commands, outputs that it reads. What belongs to no block besides
        is the performance.
    blocks : sequence of DynamicBlock
        The unknown dynamics, with their bounds and weights.
    goal : "mu" or "gain"
        What is made small.
    order : int, optional
        Number of states of each filter, even; 0: constants. None: 4, and 2 and 0 where these gain
        more; for the gain 0.
    iterations : int
        Largest number of designs of the iteration, of each order.
    states : int, optional
        For the gain: number of states of the controller, from that of the start on. None: that of
        the start, and two more where these lower the gain by .2 %.

    Returns
    -------
    MuDesign or GainDesign
        The best loop of all iterations, of the order of the plant, its weights and twice its
        scalings: `symheli.lpv.balanced_truncation` makes it smaller, `robust_margin` proves what is
        left. Where no design was found, `reasons`.

    Raises
    ------
    InputError
        As of `robust_margin`; another goal; an order that is odd, a number below 1; `states` for
        the goal mu.
    UnknownNameError
        A signal that the model does not have.

    References
    ----------
    `musyn` of MATLAB; Skogestad and Postlethwaite, Multivariable Feedback Control (2005), sec.
    8.12; Packard and Doyle, Automatica 29 (1993). For the gain: Apkarian, Dao and Noll, "Parametric
    robust structured control design", IEEE Trans. Automatic Control 60 (2015).

    Examples
    --------
    x' = u + w, of which a tenth of u is not known; y = x + n, z = (x, u):

    >>> from symheli import LinearModel
    >>> plant = LinearModel(
    ...     [[0.0]], [[1.0, 1.0, 0.0, 1.0]], [[0.0], [1.0], [0.0], [1.0]],
    ...     [[0, 0, 0, 0.1], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]],
    ...     ["x"], ["d", "w", "n", "u"], ["v", "z", "cost", "y"])
    >>> design = mu_synthesis(plant, ["u"], ["y"], [DynamicBlock("d", "v")], order=2, iterations=2)
    >>> print(f"{design.levels[0]:.2f}, then {design.mu:.2f}", design.controller.is_stable())
    1.74, then 1.49 True
    """
    require_goal(goal)
    iterations = whole(iterations, "iterations", 1)
    if order is not None and whole(order, "order", 0) % 2:
        raise InputError(f"order: expected an even number of states, got {order}")
    if not isinstance(model, LFT):
        model = LFT.constant(as_model(model))
    plant, asked = (
        DesignPlant.of(model, controls, measurements, blocks),
        (model, controls, measurements, blocks),
    )
    if goal == "gain":
        return _for_the_gain(plant, asked, order or 0, iterations, states)
    if states is not None:
        raise InputError('states: the controller of goal="mu" has as many as plant and scalings')
    return _for_mu(plant, asked, ORDERS if order is None else (order,), iterations)


def _for_mu(plant: DesignPlant, asked: Asked, orders: Sequence[int], iterations: int) -> MuDesign:
    best, levels, reasons = _Iterate(math.inf, None, ()), [], ()
    for order in orders:
        D = tuple(Filter.one(order, plant.pace) for _ in plant.parts)
        found, own, reasons = _iterated(plant, D, iterations, best)
        levels += own
        best = found if found.level < best.level else best
    if best.K is None:
        return MuDesign(None, math.inf, math.nan, tuple(levels), (), tuple(reasons))
    named = plant.named(best.K)
    if named is None:
        return MuDesign(None, math.inf, math.nan, tuple(levels), (), (NOT_SAMPLED,))
    proven = plant.proven(best.K, named, best.level)
    omega, filters = plant.loop.frequency(proven.omega), tuple(d.model() for d in best.D)
    return MuDesign(
        named, proven.level, omega, tuple(levels), filters, proof=proven.proof, asked=asked
    )


class _Iterate(NamedTuple):
    """A level with the controller that reaches it, the scalings that it was designed for, and those
    that its loop asks for: frequencies, logarithms and weights.
    """

    level: float
    K: LinearModel | None
    D: tuple[Filter, ...]
    wanted: tuple[Array, Array, Array] | None = None

    @classmethod
    def of(cls, plant: DesignPlant, K: LinearModel, D: tuple[Filter, ...]) -> _Iterate:
        """Return the iterate of a controller."""
        loop = plant.closed(K)
        omega = _frequencies(loop)
        values, x = _scalings(loop, omega)
        return cls(float(values.max()), K, D, (omega, x, values / values.max()))

    def towards(self, D: tuple[Filter, ...], far: float) -> tuple[Filter, ...]:
        """Return filters of the order of D, a step from those of this design towards those that its
        loop asks for.
        """
        assert self.wanted is not None  # noqa: S101 - of an iterate with a controller
        omega, x, count = self.wanted
        return tuple(
            (own if own.order == new.order else new).fitted(
                omega, own.logarithm(omega) + far * (each - own.logarithm(omega)), count
            )
            for new, own, each in zip(D, self.D, x.T, strict=True)
        )


def _iterated(
    plant: DesignPlant, D: tuple[Filter, ...], iterations: int, best: _Iterate
) -> tuple[_Iterate, list[float], tuple[str, ...]]:
    """Return the best iterate, from the best so far on, with the levels on the way, that fall, and
    the reasons why there is none.
    """
    levels, shape, far, stalled, here = [], D, 1.0, 0, best
    if best.K is not None:
        D = best.towards(D, far)
    for _ in range(iterations):
        design = plant.designed(D)
        if design.controller is None and best.K is None:
            return best, levels, design.reasons
        found = best
        if design.controller is not None:
            found = _Iterate.of(plant, design.controller, D)
        stalled = 0 if found.level < best.level * (1 - GAINED) else stalled + 1
        if found.level < best.level:
            best = here = found
            levels.append(best.level)
            far = FAR if len(levels) > 1 else 1.0
        elif best.level < found.level <= best.level * (1 + ROOM):
            here = found
        else:
            here, far = best, far / FAR
        if stalled > STALLS or far < LEAST:
            break
        D = here.towards(shape, far)
    return best, levels, ()


def _for_the_gain(
    plant: DesignPlant, asked: Asked, order: int, iterations: int, states: int | None
) -> GainDesign:
    own = len(plant.loop.A) + order * sum(
        size_of(side) for part in plant.parts for side in (part.rows, part.columns)
    )
    if states is not None and whole(states, "states", 0) < own:
        raise InputError(
            f"states: the start has {own}, expected as many or more, got {states}; a controller of"
            " fewer is a TunableController of synthesis.structured"
        )
    start, reasons = _start(plant, order, iterations)
    if start is None:
        return GainDesign(None, None, (), tuple(reasons))
    best, levels = least_gain(plant, start, states)
    if best is None:
        return GainDesign(None, None, (), (NOT_STABILISED,))
    found = plant.named(best.K)
    if found is None:
        return GainDesign(None, None, levels, (NOT_SAMPLED,))
    return GainDesign.proven(asked, found, levels)


def _start(
    plant: DesignPlant, order: int, iterations: int
) -> tuple[LinearModel | None, tuple[str, ...]]:
    """Return the controller of the least worst gain of an iteration in which the performance is
    asked for in units of a gain, which follows the level.
    """
    known = plant.known()
    if known.controller is None:
        return None, known.reasons
    D = tuple(Filter.one(order, plant.pace) for _ in plant.parts)
    gain, best, chosen = ABOVE * known.hinf_norm, math.inf, None
    for _ in range(iterations):
        asking = plant.asking(gain)
        design = asking.designed(D)
        if design.controller is None:
            break
        worst = worst_member(plant.closed(design.controller)).gain
        if chosen is None or worst < best:
            best, chosen = worst, design.controller
        found = _Iterate.of(asking, design.controller, D)
        D, gain = found.towards(D, 1.0), gain * found.level**DAMPED
    return chosen, design.reasons


def _frequencies(loop: BlockLoop) -> Array:
    paces = loop.paces
    return np.geomspace(paces[0] / 10, 10 * paces[-1], FREQUENCIES)


def _scalings(loop: BlockLoop, omega: Array) -> tuple[Array, Array]:
    """Return (levels, x): the largest singular value (K,) of D M D^-1 at each frequency with the
    best D = exp(x) found, x (K, parts), 0 of the last part.
    """
    rows, columns = (
        np.repeat(np.arange(len(loop.parts)), [size_of(getattr(p, side)) for p in loop.parts])
        for side in ("rows", "columns")
    )
    free, before = len(loop.parts) - 1, np.zeros(len(loop.parts) - 1)
    levels, found = [], []
    for M in loop.responses(omega):

        def size(x: Array, M: Array = M, before: Array = before) -> tuple[float, Array]:
            whole = np.r_[x, 0.0]
            left, values, right = np.linalg.svd(np.exp(whole[rows, None] - whole[columns]) * M)
            slope = np.bincount(rows, np.abs(left[:, 0]) ** 2, free + 1)
            slope -= np.bincount(columns, np.abs(right[0]) ** 2, free + 1)
            near = x - before
            return float(math.log(values[0]) + NEAR * near @ near), slope[:free] + 2 * NEAR * near

        if free:
            before = optimize.minimize(size, before, jac=True, method="BFGS").x
        whole = np.r_[before, 0.0]
        levels.append(np.linalg.norm(np.exp(whole[rows, None] - whole[columns]) * M, 2))
        found.append(whole)
    return np.array(levels), np.array(found)
