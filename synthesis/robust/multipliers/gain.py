"""Gains of a loop with blocks, by multipliers, as proven statements."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from symheli import LinearModel, progress
from symheli.errors import InputError
from symheli.lpv.linear_model import as_model
from symheli.threads import with_one_thread
from symheli.values.arrays import Array
from symheli.values.signal import indices
from symheli.values.summary import summarized
from synthesis.certify.statement.proven_statement import ProvenStatement
from synthesis.numerics.program.cone_program import Solver, general_solver
from synthesis.robust.multipliers import search as searching
from synthesis.robust.multipliers.blocks import (
    Block,
    DelayBlock,
    OwnMultiplier,
    ParameterBlock,
    StaticBlock,
    multipliers_of,
)
from synthesis.robust.multipliers.classes import Lags
from synthesis.robust.multipliers.delays import WEIGHT
from synthesis.robust.multipliers.loop import Plant, Wired
from synthesis.robust.multipliers.members import Family, Member
from synthesis.robust.multipliers.proof import GainProof
from synthesis.robust.multipliers.search import Search, Storage
from synthesis.robust.multipliers.sentences import sentence
from synthesis.robust.structure import DynamicBlock

KIND = "multiplier gain"
APART = 30.0
"""Ratio of the fastest to the slowest pole of a model from which on the lags have two poles."""


@dataclass(frozen=True, eq=False)
class MultiplierGain(ProvenStatement):
    """The L2 gain from the outside inputs to the outside outputs is proven to be at most `upper`,
    for every member of the blocks; a linear member attains `lower`.

    `member` has a number for each block: the slope, the delay (s), the parameter, or a phase (rad)
    of dynamics; `omega` (rad/s) is the frequency where it attains the gain. `proof` has all numbers
    that the statement rests on; None: nothing is proven, `upper` is inf, and `why` says why.
    """

    upper: float
    lower: float
    member: tuple[float, ...]
    omega: float
    proof: GainProof | None = None
    why: str = ""
    reader: ClassVar[str] = "multiplier-gain"

    __repr__ = summarized

    @property
    def verified(self) -> bool:  # type: ignore[override]
        """Whether there is a proof, which was checked in exact arithmetic as it was found."""
        return self.proof is not None

    @property
    def bound(self) -> float:
        """The gain that is proven."""
        return self.upper

    @property
    def claim(self) -> str:
        """The claim in one sentence, with numbers and units."""
        return (
            f"L2 gain {self.upper:.9g}: |y|_2 < {self.upper:.6g} |u|_2 from rest, for every member"
            " of the blocks"
        )

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, each a sentence made from the numbers of the proof."""
        own = self.proof
        if own is None:
            return ()
        time = "in continuous time" if own.dt is None else f"sampled every {own.dt!r} s"
        model = f"the model in the file, {len(own.plant.A)} states, {time}"
        return (model, *(sentence(block) for block in own.blocks))

    @property
    def facts(self) -> Mapping[str, Any]:
        """Kind, bounds and conditions as data that JSON holds."""
        return {"kind": KIND, "bound": self.bound}

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file: the model, its blocks, multipliers and storage."""
        if self.proof is None:
            raise InputError("only a proven gain is saved")
        return {"kind": KIND, **self.proof.stored}

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> MultiplierGain:
        """Return the gain of a file, proven anew."""
        proof = GainProof.restored(content)
        why = proof.fault()
        return cls(proof.gain, math.nan, (), math.nan, None if why else proof, why)

    def verify(self, rigorous: bool = True) -> bool:
        """Check the proof again from its numbers, in exact arithmetic."""
        own = self.proof
        return own is not None and own.gain <= self.upper and not own.fault()

    def __str__(self) -> str:
        attained = f"{self.lower:.6g} is attained at {self.omega:.4g} rad/s"
        if self.proof is None:
            return f"no gain is proven ({self.why}); {attained}"
        return f"L2 gain at most {self.upper:.6g}, proven in exact arithmetic; {attained}"


@with_one_thread
def multiplier_gain(
    model: LinearModel,
    blocks: Sequence[Block] | Block,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    *,
    poles: Sequence[float] | None = None,
    order: int = 1,
    solver: Solver | str = "CLARABEL",
) -> MultiplierGain:
    """Prove an L2 gain of a loop with static functions, delays, constant parameters and dynamics,
    by multipliers that depend on frequency.

    Multipliers are those of the circle criterion, of Popov, of Zames and Falb (odd and repeated
    functions too), D and G scalings, and of a delay its size and that |v(t - T)| has the energy of
    v. An inequality of the loop with the filters of the multipliers proves the gain, with a storage
    x'P x of any sign: P and the multipliers are checked in exact arithmetic. The argument is that
    of Megretski and Rantzer: the nominal loop is stable, and every block is joined to its nominal
    by a path of blocks to which the multipliers belong.

    Parameters
    ----------
    model : LinearModel or system of python-control
        Stable with the nominal blocks: the least slope, the middle of a parameter, no delay, and
        dynamics of zero. Positive feedback: the blocks add d to the model's inputs.
    blocks : sequence of StaticBlock, DelayBlock, ParameterBlock, DynamicBlock or OwnMultiplier
        Each with its inputs d and outputs v of the model.
    inputs, outputs : sequence of str, optional
        Of the gain; those of no block. An output may be one of a block, too.
    poles : sequence of float, optional
        Poles a (rad/s) of the lags a/(s + a) of the multipliers; from the model's poles by default.
        A delay has one of its own.
    order : int
        Largest power of each lag.
    solver : Solver or str
        Of the semidefinite programs over frequency.

    Returns
    -------
    MultiplierGain
        `upper` is proven for every member, in units of the outputs per unit of the inputs; `lower`
        is the gain of a linear member, found over frequency without multipliers.

    Raises
    ------
    InputError
        Blocks and channels that do not fit; a path without delay between channels of static
        functions or delays; a delay of a sampled model; poles that are not above zero.
    UnknownNameError
        A channel that the model does not have.

    References
    ----------
    Megretski and Rantzer, IEEE Trans. Automatic Control 42 (1997); D'Amato, Rotea, Megretski and
    Jonsson, Automatica 37 (2001), of repeated functions; Jonsson, Int. J. Robust Nonlinear Control
    7 (1997), of Popov's term.

    Examples
    --------
    A resonance with a function in the sector [0, 1]: 25.96 by the circle criterion, which lets the
    function depend on time, and 7.08 where it does not:

    >>> from symheli import LinearModel
    >>> A, B = [[-0.2, -1.0], [1.0, 0.0]], [[-1.0, -1.0], [0.0, 0.0]]
    >>> C, D = [[1.0, 1.0], [1.0, 1.0]], [[0.0, 0.0], [0.0, 0.0]]
    >>> loop = LinearModel(A, B, C, D, ["a", "b"], ["w", "f"], ["v", "y"])
    >>> for constant in (False, True):
    ...     block = StaticBlock(["w"], ["v"], sector=(0.0, 1.0), constant=constant)
    ...     found = multiplier_gain(loop, block)
    ...     print(f"{found.upper:.2f}, attained {found.lower:.2f}")
    25.96, attained 7.08
    7.08, attained 7.08
    """
    model, own = as_model(model), _blocks(blocks)
    asked = _Asked.of(model, own, inputs, outputs, poles, order)
    family = Family(asked.plant, own, [(b.inputs, b.outputs) for b in asked.blocks], model.dt)
    fault = asked.proof(np.zeros((0, 0)), (), 0.0).fault_of_blocks()
    if fault:
        raise InputError(fault)
    with progress.task("multipliers", 2) as task:
        member, sizes = family.worst()
        task.step("a linear member")
        return asked.proven(member, sizes, general_solver(solver))


@dataclass(frozen=True, eq=False)
class _Asked:
    """What is asked, in numbers."""

    plant: Plant
    blocks: tuple[Wired, ...]
    dt: float | None

    @classmethod
    def of(
        cls,
        model: LinearModel,
        blocks: Sequence[Block],
        inputs: Sequence[str] | None,
        outputs: Sequence[str] | None,
        poles: Sequence[float] | None,
        order: int,
    ) -> _Asked:
        """Return the question; raise for names and numbers that do not fit."""
        if not blocks:
            raise InputError("blocks: expected at least one; without a block use l2_gain")
        taken = [
            [indices(_list(names), group, kind) for names in own]
            for own, group, kind in (
                ([b.inputs for b in blocks], model.inputs, "input"),
                ([b.outputs for b in blocks], model.outputs, "output"),
            )
        ]
        ends = []
        for given, own, group, kind in (
            (inputs, taken[0], model.inputs, "input"),
            (outputs, taken[1], model.outputs, "output"),
        ):
            used = {i for each in own for i in each}
            if len(used) < sum(map(len, own)):
                raise InputError(f"an {kind} belongs to two blocks, or twice to one")
            rest = [i for i in range(len(group)) if i not in used]
            ends.append(rest if given is None else indices(_list(given), group, kind))
        if not (ends[0] and ends[1]):
            raise InputError("expected an input and an output of the gain besides the blocks'")
        inside = [i for each in taken[0] for i in each]
        if set(inside) & set(ends[0]):
            raise InputError("inputs: expected those of no block")
        kept = sorted([*inside, *ends[0]])
        place = {i: k for k, i in enumerate(kept)}
        plant = Plant(
            model.A,
            model.B[:, kept],
            model.C,
            model.D[:, kept],
            tuple(place[i] for i in ends[0]),
            tuple(ends[1]),
            model.dt is not None,
        )
        wired = []
        for block, into, out in zip(blocks, *taken, strict=True):
            moving = model.dt is None and not np.any(plant.D[out])
            lags = _lags(block, model, poles, order)
            kind = multipliers_of(block, lags, moving)
            wired.append(Wired(kind, tuple(place[i] for i in into), tuple(out)))
        return cls(plant, tuple(wired), model.dt)

    def proof(self, P: Array, coefficients: tuple[Array, ...], gain: float) -> GainProof:
        """Return these numbers as a proof."""
        return GainProof(self.plant, self.dt, self.blocks, P, coefficients, gain)

    def proven(self, member: Member, sizes: Array, solver: Solver) -> MultiplierGain:
        """Search a proof."""
        attained = member.gain, member.numbers, member.omega
        if math.isinf(member.gain):
            return MultiplierGain(math.inf, *attained, None, "a linear member is not stable")
        peak = member.omega * (self.dt or 1.0)
        search = Search(self.plant, self.blocks, solver, member.gain or 1.0, sizes, peak)

        def proven(at: Storage, level: float) -> bool:
            return not self.proof(*at, level).fault()

        found = searching.found(search, proven)
        if found is None:
            why = "no multiplier was found that holds at every frequency"
            return MultiplierGain(math.inf, *attained, None, why)
        level, at = found
        return MultiplierGain(level, *attained, self.proof(*at, level))


def _blocks(given: Sequence[Block] | Block) -> list[Block]:
    """Return a list, of one block too: a named tuple is a sequence as well."""
    match given:
        case StaticBlock() | DelayBlock() | ParameterBlock() | OwnMultiplier() | DynamicBlock():
            return [given]
        case _:
            found: list[Any] = list(given)
            return found


def _list(names: Sequence[str]) -> list[str]:
    return [names] if isinstance(names, str) else list(names)


def _lags(block: Block, model: LinearModel, poles: Sequence[float] | None, order: int) -> Lags:
    """Return the lags of a block, sampled as the model is."""
    if isinstance(order, bool) or not isinstance(order, int) or not 1 <= order <= 20:
        raise InputError(f"order: expected an integer from 1 to 20, got {order!r:.40}")
    if isinstance(block, DelayBlock):
        return Lags((2.0 / block.longest,), max(order, WEIGHT + (block.form == "window")))
    given = _usual(model) if poles is None else tuple(float(v) for v in poles)
    if not all(0 < a < math.inf for a in given) or len(set(given)) < len(given):
        raise InputError(f"poles: expected different numbers > 0 rad/s, got {given!r:.60}")
    if model.dt is not None:
        given = tuple(math.exp(-a * model.dt) for a in given)
    return Lags(given, order if given else 0)


def _usual(model: LinearModel) -> tuple[float, ...]:
    """Return poles (rad/s) between those of the model."""
    modes = np.linalg.eigvals(model.A) if len(model.A) else np.ones(0)
    if model.dt is not None:
        modes = np.log(modes[np.abs(modes) > 0] + 0j) / model.dt
    sizes = np.abs(modes)[np.abs(modes) > 0]
    if not len(sizes):
        return ()
    low, high = float(sizes.min()), float(sizes.max())
    middle = math.sqrt(low * high)
    return (middle,) if high < APART * low else (math.sqrt(low * middle), math.sqrt(middle * high))
