"""How many times the stated uncertainty a model bears: parameters and blocks grown together."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import ClassVar

import numpy as np
from scipy.optimize import brentq

from symheli import LFT, LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError
from symheli.lpv import Polynomial
from symheli.threads import with_one_thread
from symheli.values.summary import summarized
from synthesis.certify.lower_bounds.frozen import frozen_gain, worst_over
from synthesis.certify.questions.certificate import Certificate
from synthesis.certify.questions.questions import stability
from synthesis.certify.statement.rates import Rate
from synthesis.robust import witness
from synthesis.robust.intervals import LevelProof
from synthesis.robust.level_statement import Asked, LevelStatement
from synthesis.robust.lower_bound import ACCURACY, ROUGH, best_reals, worst_closing
from synthesis.robust.structure import BlockLoop, DynamicBlock, loop_at, loop_of
from synthesis.robust.uncertain import uncertain
from synthesis.robust.upper_bound import proven_level

SHARE, APART = 0.9995, 1.002
"""Part of the upper bound for which a proof is tried first; ratio of a factor that is not proven to
one that is at which the search between them ends.
"""
NEARLY = 1 - 1e-6
"""Level, by that of the largest factor looked for, at which the proof of it begins."""
MIN_SCALE = 1e-6
"""A model that does not bear this part of its uncertainty counts as unstable without any."""
STEPS = 3
"""Doublings of the factor in which the loss of a loop is looked for."""
POINTS = 21
"""Values of the parameter whose highest peaks are climbed."""


@dataclass(frozen=True, eq=False)
class RobustMargin(LevelStatement):
    """`lower` times the stated uncertainty is proven to be borne, `upper` times it is not: there a
    stable perturbation of that norm makes the model with the parameter at `p` (of several a tuple)
    oscillate at `omega` (rad/s; NaN where the model at p is unstable without any).

    `perturbation`: of several blocks, their response at `omega` from all their outputs to all their
    inputs, in the order of the blocks. `proof` has the numbers that `lower` rests on, None where it
    is 0; `asked` the model and its blocks.
    """

    lower: float
    upper: float
    p: float | tuple[float, ...]
    omega: float
    perturbation: np.ndarray | None = None
    proof: LevelProof | Certificate | None = None
    asked: tuple[LFT | LPVStateSpace, Sequence[DynamicBlock]] | None = None
    reader: ClassVar[str] = "robust-margin"
    number: ClassVar[str] = "lower"
    kind: ClassVar[str] = "robust margin"

    __repr__ = summarized

    @classmethod
    def proposed(cls, bound: float, proof: LevelProof | None, asked: Asked) -> RobustMargin:
        """Return the margin with this number; without a proof it is none."""
        return cls(bound, math.nan, math.nan, math.nan, None, proof, asked)

    @property
    def claim(self) -> str:
        """The claim in one sentence, with numbers and units."""
        return (
            f"robust margin {self.lower:.9g}: stable while the ranges of constant parameters about"
            f" their middles, and the bounds of the blocks, are {self.lower:.6g} times the stated"
        )

    def verify(self, rigorous: bool = True) -> bool:
        """Check the proof of `lower` again in exact arithmetic, from the model and its blocks;
        `rigorous`: and the inequality at single frequencies, by a second writing of it.
        """
        if isinstance(self.proof, Certificate):
            return self.proof.verify(rigorous=True)
        if self.proof is None or self.asked is None:
            return False
        asked, level = loop_of(*self.asked), self.proof.bound
        loop = asked.in_rationals
        if level is None or self.proof.performance or Fraction(self.lower) * level > 1:
            return False
        return self.proof.verified(loop, asked.parts) and (
            not rigorous or witness.level_is_kept(self.proof, loop)
        )


@with_one_thread
def robust_margin(
    model: UncertainStateSpace | LFT | LPVStateSpace,
    blocks: Sequence[DynamicBlock] = (),
    *,
    rate: Rate = None,
    largest: float = 10.0,
) -> RobustMargin:
    """Compute the factor by which the ranges of constant parameters about their middles, and the
    bounds of blocks of any linear dynamics, may grow together before a model of the set is
    unstable; with a `rate` that of the blocks alone, while the parameter moves within its range.

    The upper bound is attained by the parameters and the perturbation returned, p constant. The
    lower one, of an `UncertainStateSpace` and where p moves, is proven by `stability` for that set,
    with P(p) and a scaling for each block, and dynamics of any kind; of several blocks beside
    constant parameters by D and G scalings over intervals of frequency that leave none out. All of
    it is checked in exact arithmetic.

    Parameters
    ----------
    model : UncertainStateSpace, LFT or LPVStateSpace
        The loop, continuous or sampled. Of an `UncertainStateSpace`, polynomial in its one
        parameter. An LFT may have any number of parameters, a polynomial model becomes one; its
        other channels play no part.
    blocks : sequence of DynamicBlock
        Channels of an LFT or LPVStateSpace that unknown dynamics close.
    rate : float, optional
        Largest |dp/dt| of the one parameter of an LPV model, which keeps to its range; None: all
        parameters are constant, not known, and their ranges grow.
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

    >>> from symheli import LPVStateSpace, Scheduling, UncertainStateSpace
    >>> k = Scheduling("k", "1", 0.5, 1.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], k)
    >>> found = robust_margin(UncertainStateSpace(lag, ["u1"], ["y1"], 0.5, 1.0, "an example"))
    >>> bool(1.98 < found.lower <= 2.0), round(found.upper, 4)
    (True, 2.0)
    """
    if isinstance(model, UncertainStateSpace) and blocks:
        raise InputError("an UncertainStateSpace has its block: give blocks with its .model")
    if not largest > MIN_SCALE:
        raise InputError(f"largest: expected a factor above {MIN_SCALE:g}, got {largest!r:.40}")
    if rate is not None:
        return _while_moving(_set_of(model, blocks), rate, largest)
    if not isinstance(model, UncertainStateSpace):
        return _of_blocks(model, blocks, largest)
    if not isinstance(model.model.basis, Polynomial):
        raise InputError(
            "the range of the parameter is grown with the block, and functions in pieces end with"
            " it: rate=0.0 grows the block alone, a model polynomial in one parameter both"
        )
    if not model.bound > 0:
        raise InputError("expected a block with a bound > 0")

    def grown(r: float) -> UncertainStateSpace:
        return replace(model, model=_grown(model.model, r), bound=r * model.bound)

    def excess(r: float) -> float:
        """1 where no model is lost, 0 at the margin, below it beyond."""
        return 1 - min(_worst_closing(grown(r))[0], 2.0)

    if excess(MIN_SCALE) <= 0:
        _, omega, p, delta = _worst_closing(grown(MIN_SCALE))
        return RobustMargin(0.0, MIN_SCALE, p, omega, delta)
    borne = excess(largest) >= 0
    upper = largest if borne else float(brentq(excess, MIN_SCALE, largest, rtol=ACCURACY))  # type: ignore[arg-type]
    lower, proof = _proven(lambda r: stability(grown(r), 0.0, search=None), upper, borne)
    _, omega, p, delta = _worst_closing(grown(upper))
    return RobustMargin(lower, math.inf if borne else upper, p, omega, delta, proof)


def _set_of(
    model: UncertainStateSpace | LFT | LPVStateSpace, blocks: Sequence[DynamicBlock]
) -> UncertainStateSpace:
    """Return the set of all loops around these blocks."""
    if isinstance(model, UncertainStateSpace):
        return model
    return uncertain(model.to_lpv() if isinstance(model, LFT) else model, blocks)


def _while_moving(unc: UncertainStateSpace, rate: Rate, largest: float) -> RobustMargin:
    """Return the factor of the blocks alone, p within its range."""
    level, omega, p, delta = _worst_closing(unc)
    if math.isinf(level):
        return RobustMargin(0.0, MIN_SCALE, p, math.nan)
    borne = level * largest <= 1
    upper = largest if borne else 1 / level

    def proven(r: float) -> Certificate:
        return stability(unc.with_bound(r * unc.bound), rate, search=None)

    lower, proof = _proven(proven, upper, borne)
    return RobustMargin(lower, math.inf if borne else upper, p, omega, delta, proof)


def _proven(
    asked: Callable[[float], Certificate], upper: float, borne: bool
) -> tuple[float, Certificate | None]:
    """Return a factor up to `upper` for which stability is proven, to `APART` of the largest one
    that was tried, and its proof; 0 and None where there is none.
    """

    def stable(r: float) -> Certificate | None:
        found = asked(r)
        return found if found.verified and found.verify(rigorous=True) else None

    high = upper if borne else SHARE * upper
    if found := stable(high):
        return high, found
    low = 0.5 * high
    while not (found := stable(low)):
        low, high = 0.5 * low, low
        if low < MIN_SCALE * upper:
            return 0.0, None
    while high / low > APART:
        middle = math.sqrt(low * high)
        better = stable(middle)
        low, high = (middle, high) if better else (low, middle)
        found = better or found
    return low, found


def _worst_closing(unc: UncertainStateSpace) -> tuple[float, float, float, np.ndarray | None]:
    """Return the level of the frozen model that is lost the soonest, inf where one is unstable, its
    frequency, p and the perturbation of that level.
    """
    s = unc.scheduling
    if len(unc.every_part) == 1:
        block = unc.model.select(inputs=unc.perturbation_inputs, outputs=unc.perturbation_outputs)
        worst = frozen_gain(block, points=POINTS)
        return unc.bound * worst.gain, worst.omega, worst.p, None

    def level(p: np.ndarray, refine: bool = False) -> float:
        loop = loop_at(unc, float(p[0]))
        return worst_closing(loop, refine).level if loop.stable else math.inf

    value, (p,) = worst_over(level, [np.linspace(s.low, s.high, POINTS)])
    if math.isinf(value):
        return math.inf, math.nan, float(p), None
    loop = loop_at(unc, float(p))
    found = worst_closing(loop, refine=True)
    delta = loop.unscaled(found.delta, found.omega)
    return found.level, loop.frequency(found.omega), float(p), delta


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
    if not loop.stable:
        return RobustMargin(0.0, MIN_SCALE, loop.physical(np.zeros(loop.reals)), float("nan"))
    _, d = best_reals(lambda d: _lost(loop, d, largest), loop.reals)
    upper = _lost(loop, d, largest, refine=True)
    borne = upper >= largest
    start = (NEARLY if borne else 1.0) / upper
    proof = proven_level(loop, start, performance=False).proof
    closed = loop.closed(min(upper, largest) * d)
    found = worst_closing(closed, refine=True) if closed.stable and closed.parts else None
    return RobustMargin(
        0.0 if proof is None else min(_inverse(proof.bound), largest),
        float("inf") if borne else upper,
        loop.physical(upper * d),
        float("nan") if found is None else loop.frequency(found.omega),
        None if found is None else loop.unscaled(found.delta, found.omega),
        proof,
        (model, blocks),
    )


def _inverse(level: Fraction | None) -> float:
    """Return 1/level, rounded down; 0 without a level."""
    if level is None:
        return 0.0
    found = float(1 / level)
    return math.nextafter(found, 0.0) if Fraction(found) * level > 1 else found


def _lost(loop: BlockLoop, d: np.ndarray, largest: float, refine: bool = False) -> float:
    """Return the factor at which the loop is lost with its real parameters along d, roughly or
    refined; no more than the largest.
    """

    def excess(r: float) -> float:
        try:
            closed = loop.closed(r * d)
        except np.linalg.LinAlgError:  # not well posed there
            return -1.0
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
