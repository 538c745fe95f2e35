"""How many times the stated uncertainty a model bears: parameters and blocks grown together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from symheli.errors import InputError
from symheli.lpv import LFT, LPVStateSpace, Polynomial, Scheduling, UncertainStateSpace
from symheli.threads import with_one_thread
from symheli.values.summary import summarized
from synthesis.analysis.questions import stability
from synthesis.robust.lower_bound import ACCURACY, ROUGH, best_reals, worst_closing
from synthesis.robust.structure import DynamicBlock, Loop, loop_of
from synthesis.robust.upper_bound import proven_level
from synthesis.worst.frozen import frozen_gain

SHARES = (0.9995, 0.998, 0.995, 0.99, 0.98, 0.95, 0.9, 0.75, 0.5)
"""Parts of the upper bound for which a proof is tried, in turn."""
MIN_SCALE = 1e-6
"""A model that does not bear this part of its uncertainty counts as unstable without any."""
STEPS = 3
"""Doublings of the factor in which the loss of a loop is looked for."""
POINTS = 21
"""Values of the parameter whose highest peaks are climbed."""


class RobustMargin(NamedTuple):
    """`lower` times the stated uncertainty is proven to be borne, `upper` times it is not: there a
    stable perturbation of that norm makes the model with the parameter at `p` (of several a tuple)
    oscillate at `omega` (rad/s; NaN where the model at p is unstable without any).

    `perturbation`: of several blocks, their response at `omega` from all their outputs to all their
    inputs, in the order of the blocks.
    """

    lower: float
    upper: float
    p: float | tuple[float, ...]
    omega: float
    perturbation: np.ndarray | None = None

    __repr__ = summarized


@with_one_thread
def robust_margin(
    model: UncertainStateSpace | LFT | LPVStateSpace,
    blocks: Sequence[DynamicBlock] = (),
    *,
    largest: float = 10.0,
) -> RobustMargin:
    """Compute the factor by which the ranges of constant parameters about their middles, and the
    bounds of blocks of any linear dynamics, may grow together before a model of the set is
    unstable.

    The upper bound is attained by the parameters and the perturbation returned. The lower one, of
    an `UncertainStateSpace`, is proven by `stability` for that set; of several blocks by D and G
    scalings over intervals of frequency that leave none out, in floating point.

    Parameters
    ----------
    model : UncertainStateSpace, LFT or LPVStateSpace
        The loop, continuous or sampled. Of an `UncertainStateSpace`, polynomial in its one
        parameter. An LFT may have any number of parameters, a polynomial model becomes one; its
        other channels play no part.
    blocks : sequence of DynamicBlock
        Channels of an LFT or LPVStateSpace that unknown dynamics close.
    largest : float
        No larger factor is looked for.

    Returns
    -------
    RobustMargin
        With `upper` inf where the factor `largest` is borne.

    Raises
    ------
    InputError
        An uncertain model in several parameters, or other functions; a bound that is not > 0; a
        signal of two blocks; nothing uncertain.
    UnknownNameError
        A channel that the model does not have.

    References
    ----------
    `robstab` of MATLAB; Zhou, Doyle and Glover, Robust and Optimal Control (1996), ch. 9 and 11;
    Fan, Tits and Doyle, IEEE Trans. Automatic Control 36 (1991).

    Examples
    --------
    x' = -(1 - delta) x - k x with |delta| <= 1/2 and k = 1 within 1/2: 2 = r/2 + r/2:

    >>> from symheli.lpv import LPVStateSpace, Scheduling, UncertainStateSpace
    >>> k = Scheduling("k", "1", 0.5, 1.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], k)
    >>> found = robust_margin(UncertainStateSpace(lag, ["u1"], ["y1"], 0.5, 1.0, "an example"))
    >>> bool(1.98 < found.lower <= 2.0), round(found.upper, 4)
    (True, 2.0)
    """
    if not isinstance(model, UncertainStateSpace):
        return _of_blocks(model, blocks, largest)
    if blocks:
        raise InputError("an UncertainStateSpace has its block: give blocks with its .model")
    if not isinstance(model.model.basis, Polynomial):
        raise InputError("expected a model that is polynomial in one parameter, which is grown")
    if not (model.bound > 0 and largest > MIN_SCALE):
        raise InputError("expected a block with a bound > 0 and a largest factor > 0")
    block = model.model.select(inputs=model.perturbation_inputs, outputs=model.perturbation_outputs)

    def excess(r: float) -> float:
        """1 where no model is lost, 0 at the margin, below it beyond."""
        return 1 - min(r * model.bound * frozen_gain(_grown(block, r), points=POINTS).gain, 2.0)

    if excess(MIN_SCALE) <= 0:
        return _at(block, 0.0, MIN_SCALE)
    borne = excess(largest) >= 0
    upper = largest if borne else float(brentq(excess, MIN_SCALE, largest, rtol=ACCURACY))  # type: ignore[arg-type]
    for share in (1.0 if borne else SHARES[0], *SHARES[1:]):
        r = share * upper
        grown = replace(model, model=_grown(model.model, r), bound=r * model.bound)
        if stability(grown, 0.0, search=None).verified:
            break
    else:
        r = 0.0
    found = _at(block, r, upper)
    return found._replace(upper=float("inf")) if borne else found


def _at(block: LPVStateSpace, lower: float, upper: float) -> RobustMargin:
    worst = frozen_gain(_grown(block, upper))
    return RobustMargin(lower, upper, worst.p, worst.omega)


def _grown(lpv: LPVStateSpace, r: float) -> LPVStateSpace:
    """The same polynomials over a range that is r times as wide."""
    s, basis = lpv.scheduling, lpv.basis
    assert isinstance(basis, Polynomial)  # noqa: S101 - checked before
    wide = Scheduling(s.name, s.unit, s.middle - r * s.radius, s.middle + r * s.radius, 0.0)
    # x from -1 to 1 over the old range becomes `factor` times that over the new one
    middle, radius = 0.5 * (basis.low + basis.high), 0.5 * (basis.high - basis.low)
    reach = max(wide.high - middle, middle - wide.low)
    wider = Polynomial(basis.degree, middle - reach, middle + reach)
    powers = (reach / radius) ** np.arange(basis.size)

    def same(M: np.ndarray) -> np.ndarray:
        scaled = np.tensordot(basis.form("scaled").T, M, axes=1)
        return wider.from_scaled(powers[:, None, None] * scaled)

    A, B, C, D = (same(M) for M in (lpv.A, lpv.B, lpv.C, lpv.D))
    names = lpv.states, lpv.inputs, lpv.outputs
    return LPVStateSpace(wider, A, B, C, D, (wide,), *names, lpv.dt)


def _of_blocks(
    model: LFT | LPVStateSpace, blocks: Sequence[DynamicBlock], largest: float
) -> RobustMargin:
    loop = loop_of(model, blocks)
    if not largest > MIN_SCALE:
        raise InputError(f"largest: expected a factor above {MIN_SCALE:g}, got {largest!r:.40}")
    if not loop.stable:
        return RobustMargin(0.0, MIN_SCALE, loop.physical(np.zeros(loop.reals)), float("nan"))
    _, d = best_reals(lambda d: _lost(loop, d, largest), loop.reals)
    upper = _lost(loop, d, largest, refine=True)
    borne = upper >= largest
    level = proven_level(loop, 1 / upper, performance=False).level
    closed = loop.closed(min(upper, largest) * d)
    found = worst_closing(closed, refine=True) if closed.stable and closed.parts else None
    return RobustMargin(
        min(1 / level, largest),
        float("inf") if borne else upper,
        loop.physical(upper * d),
        float("nan") if found is None else loop.frequency(found.omega),
        None if found is None else loop.unscaled(found.delta, found.omega),
    )


def _lost(loop: Loop, d: np.ndarray, largest: float, refine: bool = False) -> float:
    """Return the factor at which the loop is lost with its real parameters along d, roughly or
    refined; no more than the largest.
    """

    def excess(r: float) -> float:
        closed = loop.closed(r * d)
        if not closed.stable:
            return -1.0
        if not closed.parts:
            return 1.0
        return max(1 - r * worst_closing(closed, refine).level, -1.0)

    low = MIN_SCALE
    for high in np.geomspace(largest / 2**STEPS, largest, STEPS + 1):
        if excess(float(high)) <= 0:
            return float(brentq(excess, low, float(high), rtol=ACCURACY if refine else ROUGH))  # type: ignore[arg-type]
        low = float(high)
    return largest
