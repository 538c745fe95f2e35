"""The largest gain of a model with several uncertain things at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.optimize import brentq

from symheli import LFT, LPVStateSpace
from symheli.threads import with_one_thread
from symheli.values.numbers import whole
from symheli.values.summary import summarized
from synthesis.numerics.linear.norm import norm
from synthesis.robust import witness
from synthesis.robust.cells import CellsProof, proven_in_cells
from synthesis.robust.intervals import LevelProof
from synthesis.robust.level_statement import Asked, LevelStatement
from synthesis.robust.lower_bound import ACCURACY, ROUGH, best_reals, worst_closing
from synthesis.robust.structure import BlockLoop, DynamicBlock, loop_of
from synthesis.robust.upper_bound import proven_level

LARGEST_RATIO = 1e6
"""A gain this many times that without dynamics, or that through the blocks, counts as none."""
LEAST_SHARE = 1e-6
"""Share of the gain through the blocks from which it is looked for where that without dynamics is
(nearly) zero.
"""

LEAST_GAIN = 2.0**-40
"""Gain that is proven where none is found, in units of the outputs per unit of the inputs."""


@dataclass(frozen=True, eq=False)
class WorstCaseGain(LevelStatement):
    """The gain of every model of the set is below `upper`; that of the model with the parameters at
    `p` (of several a tuple) and a `perturbation` of this response at `omega` (rad/s) is `lower`.

    `perturbation` (inputs, outputs of the blocks in their order); without a block None. Both gains
    are inf where a model of the set is unstable. `proof` has the numbers that `upper` rests on,
    None where it is inf; `asked` the model and its blocks.
    """

    lower: float
    upper: float
    p: float | tuple[float, ...]
    omega: float
    perturbation: np.ndarray | None = None
    proof: LevelProof | CellsProof | None = None
    asked: tuple[LFT | LPVStateSpace, Sequence[DynamicBlock]] | None = None
    reader: ClassVar[str] = "worst-case-gain"
    number: ClassVar[str] = "upper"
    kind: ClassVar[str] = "worst-case gain"

    __repr__ = summarized

    @classmethod
    def proposed(
        cls, bound: float, proof: LevelProof | CellsProof | None, asked: Asked
    ) -> WorstCaseGain:
        """Return the gain with this number; without a proof it is none."""
        return cls(math.nan, bound, math.nan, math.nan, None, proof, asked)

    @property
    def claim(self) -> str:
        """The claim in one sentence, with numbers and units."""
        return (
            f"worst-case gain {self.upper:.9g}: |y|_2 < {self.upper:.6g} |u|_2 from rest, for every"
            " constant parameter of its range and every block of its bound"
        )

    def verify(self, rigorous: bool = True) -> bool:
        """Check the proof of `upper` again in exact arithmetic, from the model and its blocks;
        `rigorous`: and the inequality at single frequencies, by a second writing of it.
        """
        if self.proof is None or self.asked is None:
            return False
        asked, level = loop_of(*self.asked, performance=True), self.proof.bound
        loop = asked.in_rationals
        if level is None or not (self.proof.performance and level <= self.upper):
            return False
        if not self.proof.verified(loop, asked.parts):
            return False
        if not rigorous:
            return True
        if isinstance(self.proof, LevelProof):
            return witness.level_is_kept(self.proof, loop)
        return all(
            witness.level_is_kept(own, loop.within(own.parts, low, high))
            for low, high, own in self.proof.cells
        )


@with_one_thread
def worst_case_gain(
    model: LFT | LPVStateSpace, blocks: Sequence[DynamicBlock] = (), *, cells: int = 1
) -> WorstCaseGain:
    """Compute the largest L2 gain of a model over its constant parameters and blocks of any linear
    dynamics, from the channels that belong to no block.

    The lower bound is attained by what is returned; the upper one is proven by D and G scalings
    over intervals of frequency that leave none out, in exact arithmetic. Scalings of several
    parameters leave a gap: with more `cells` the ranges are divided, and each part has scalings of
    its own. For parameters that move, and one block, `l2_gain` of an `UncertainStateSpace`.

    Parameters
    ----------
    model, blocks
        As of `robust_margin`.
    cells : int
        Largest number of parts into which the ranges of the parameters are divided until the upper
        bound is within .1 % of the lower one.

    Returns
    -------
    WorstCaseGain
        Both bounds, in units of the outputs per unit of the inputs.

    Raises
    ------
    InputError
        As of `robust_margin`; no channel besides those of the blocks; fewer than one cell.
    UnknownNameError
        A channel that the model does not have.

    References
    ----------
    `wcgain` of MATLAB; Fan, Tits and Doyle, IEEE Trans. Automatic Control 36 (1991).

    Examples
    --------
    x' = -(2 - k - delta) x + u with |k| <= 1/2 and |delta| <= 1/2; the worst gain is 1:

    >>> from symheli import LPVStateSpace, Scheduling
    >>> k = Scheduling("k", "1", -0.5, 0.5)
    >>> lag = LPVStateSpace.polynomial(
    ...     [[[-2.0]], [[1.0]]], [[[1.0, 1.0]]], [[[1.0], [1.0]]], [np.zeros((2, 2))], k,
    ...     inputs=["u", "d"], outputs=["y", "v"])
    >>> found = worst_case_gain(lag, [DynamicBlock(["d"], ["v"], 0.5)])
    >>> print(f"{found.lower:.3f}", bool(1.0 <= found.upper < 1.01), round(found.p, 3))
    1.000 True 0.5
    """
    most = whole(cells, "cells", 1)
    loop = loop_of(model, blocks, performance=True)
    worst = worst_member(loop)
    if math.isinf(worst.gain):
        return WorstCaseGain(math.inf, math.inf, loop.physical(worst.reals), math.nan)
    start = worst.gain or LEAST_SHARE * _through(loop) or LEAST_GAIN
    proven = (
        proven_level(loop, start, performance=True)
        if most == 1 or not loop.reals
        else proven_in_cells(loop, start, most)
    )
    inner = None
    if worst.blocks is not None:
        last = loop.parts[-1]
        columns, rows = last.columns.stop - last.columns.start, last.rows.stop - last.rows.start
        inner = loop.unscaled(worst.blocks, worst.omega)[:-columns, :-rows]
    at = loop.physical(worst.reals), loop.frequency(worst.omega), inner
    return WorstCaseGain(worst.gain, proven.level, *at, proven.proof, (model, blocks))


class Member(NamedTuple):
    """A model of the set: its gain, inf where it is unstable, the normalised real parameters, the
    response of all blocks with the performance (nw, nz), None where there is no block, and the
    frequency of the continuous model.
    """

    gain: float
    reals: np.ndarray
    omega: float
    blocks: np.ndarray | None


def worst_member(loop: BlockLoop) -> Member:
    """Return the member of the largest gain that is found."""
    if not loop.stable:
        return Member(math.inf, np.zeros(loop.reals), math.nan, None)
    negative, d = best_reals(lambda d: -_gain(loop.closed(d))[0], loop.reals)
    lower, omega, delta = _gain(loop.closed(d), refine=True)
    if math.isinf(negative):
        lower = math.inf
    return Member(lower, d, omega, delta)


def _gain(closed: BlockLoop, refine: bool = False) -> tuple[float, float, np.ndarray | None]:
    """Return the largest gain found of a loop of full blocks, its last part the performance, the
    frequency, and the blocks; inf where the loop may be unstable.
    """
    if not closed.stable:
        return math.inf, math.nan, None
    part = closed.parts[-1]
    own = norm(
        closed.A, closed.B[:, part.columns], closed.C[part.rows], closed.D[part.rows, part.columns]
    )
    if len(closed.parts) == 1:
        return own[0], own[1], None

    def at(gamma: float) -> BlockLoop:
        rows = np.ones(len(closed.C))
        rows[part.rows] /= gamma
        return closed._replace(C=rows[:, None] * closed.C, D=rows[:, None] * closed.D)

    inner = closed._replace(
        B=closed.B[:, : part.columns.start],
        C=closed.C[: part.rows.start],
        D=closed.D[: part.rows.start, : part.columns.start],
        parts=closed.parts[:-1],
    )
    if worst_closing(inner, refine).level >= 1:
        return math.inf, math.nan, None

    def excess(x: float) -> float:
        return worst_closing(at(start * math.exp(x)), refine).level - 1

    def above(ratio: float) -> float:
        """Return an x of a gain that is not reached; inf where it counts as none."""
        top = 1.0
        while excess(top) > 0:
            top *= 2
            if top > math.log(ratio):
                return math.inf
        return top

    start = own[0]
    top = above(LARGEST_RATIO) if start else math.inf
    if math.isinf(top):  # without dynamics there may be (nearly) no gain
        start = max(own[0], LEAST_SHARE * _through(closed))
        top = above(LARGEST_RATIO / LEAST_SHARE) if start > own[0] else top
    if math.isinf(top) and start:
        return math.inf, math.nan, None
    if not start or excess(0.0) <= 0:
        return own[0], own[1], np.zeros((closed.B.shape[1], len(closed.C)), complex)
    gamma = start * math.exp(float(brentq(excess, 0.0, top, xtol=ACCURACY if refine else ROUGH)))  # type: ignore[arg-type]
    found = worst_closing(at(gamma), refine)
    return gamma, found.omega, found.delta


def _through(loop: BlockLoop) -> float:
    """Return the gain from the inputs of the performance to the blocks times that from the blocks
    to its outputs.
    """
    part, n = loop.parts[-1], loop.parts[-1].columns.start
    m = part.rows.start
    if not n or not m:
        return 0.0
    A, B, C, D = loop[:4]
    into = norm(A, B[:, part.columns], C[:m], D[:m, part.columns])[0]
    out = norm(A, B[:, :n], C[part.rows], D[part.rows, :n])[0]
    return into * out
