"""Gains of a loop with blocks, by multipliers, as proven statements."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from symheli import LinearModel, progress
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.linear_model import as_model
from symheli.threads import with_one_thread
from symheli.values.summary import summarized
from synthesis.certify.statement.proven_statement import ProvenStatement
from synthesis.numerics.program.cone_program import Solver, general_solver
from synthesis.robust.multipliers import trajectories
from synthesis.robust.multipliers.asked import L2, Asked, blocks_of
from synthesis.robust.multipliers.blocks import Block
from synthesis.robust.multipliers.members import Family
from synthesis.robust.multipliers.peak_proof import ENERGY, PEAK, PeakProof
from synthesis.robust.multipliers.peak_proof import KIND as PEAK_KIND
from synthesis.robust.multipliers.proof import NOMINAL, GainProof
from synthesis.robust.multipliers.sentences import sentence

KINDS = L2, ENERGY, PEAK
KIND = "multiplier gain"
UNSTABLE = "a linear member is not stable"
UNFOUND = "no multiplier was found that holds"


@dataclass(frozen=True, eq=False)
class MultiplierGain(ProvenStatement):
    """The gain of this `kind` from the outside inputs to the outside outputs is proven to be at
    most `upper`, for every member of the blocks; a member with linear blocks attains `lower`.

    `member` has a number for each block: the slope, the delay (s), the parameter, or a phase (rad)
    of dynamics; `omega` (rad/s) is the frequency where it attains an L2 gain, NaN of others, where
    parameters that move may jump. `proof` has all numbers that the statement rests on; None:
    nothing is proven, `upper` is inf, and `why` says why.
    """

    upper: float
    lower: float
    member: tuple[float, ...]
    omega: float
    proof: GainProof | PeakProof | None = None
    why: str = ""
    kind: str = L2
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
        size = f"{self.upper:.6g}"
        words = {
            L2: f"|y|_2 < {size} |u|_2 from rest",
            ENERGY: f"|y(t)| < {size} |u|_2 from rest, at every t",
            PEAK: f"|y(t)| < {size} max |u| from rest, at every t",
        }[self.kind]
        return f"{self.kind} gain {self.upper:.9g}: {words}, for every member of the blocks"

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, each a sentence made from the numbers of the proof."""
        own = self.proof
        if own is None:
            return ()
        time = "in continuous time" if own.dt is None else f"sampled every {own.dt!r} s"
        model = f"the model in the file, {len(own.plant.A)} states, {time}"
        return (model, *(sentence(block, self.kind != L2) for block in own.blocks))

    @property
    def facts(self) -> Mapping[str, Any]:
        """Kind, bounds and conditions as data that JSON holds."""
        return {"kind": KIND if self.kind == L2 else PEAK_KIND, "bound": self.bound}

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file: the model, its blocks, multipliers and storage."""
        if self.proof is None:
            raise InputError("only a proven gain is saved")
        return {"kind": self.facts["kind"], **self.proof.stored}

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> MultiplierGain:
        """Return the gain of a file, proven anew."""
        reader = GainProof if content["kind"] == KIND else PeakProof
        proof = reader.restored(content)
        why, kind = proof.fault(), proof.kind if isinstance(proof, PeakProof) else L2
        return cls(proof.gain, math.nan, (), math.nan, None if why else proof, why, kind)

    def verify(self, rigorous: bool = True) -> bool:
        """Check the proof again from its numbers, in exact arithmetic."""
        own = self.proof
        return own is not None and own.gain <= self.upper and not own.fault()

    def __str__(self) -> str:
        where = "" if math.isnan(self.omega) else f" at {self.omega:.4g} rad/s"
        attained = f"{self.lower:.6g} is attained{where}"
        if self.proof is None:
            return f"no {self.kind} gain is proven ({self.why}); {attained}"
        return f"{self.kind} gain at most {self.upper:.6g}, proven in exact arithmetic; {attained}"


@with_one_thread
def multiplier_gain(
    model: LinearModel,
    blocks: Sequence[Block] | Block,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    *,
    kind: str = L2,
    poles: Sequence[float] | None = None,
    order: int = 1,
    decay: float | None = None,
    solver: Solver | str = "CLARABEL",
) -> MultiplierGain:
    """Prove a gain of a loop with static functions, delays, real parameters and dynamics by
    multipliers; an L2 gain by those that depend on frequency.

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
    kind : str
        "L2"; "energy to peak", of parameters, functions in a sector and, of a sampled model,
        dynamics and multipliers of one's own, whose inequalities hold over every finite time then;
        "peak to peak", of parameters and functions in a sector. Parameters are taken as moving.
    poles : sequence of float, optional
        Poles a (rad/s) of the lags a/(s + a) of the multipliers; from the model's poles by default.
        A delay has one of its own.
    order : int
        Largest power of each lag.
    decay : float, optional
        Of peak to peak: V falls by exp(-decay t), decay in 1/s; of a sampled model by the factor
        1 - decay in a period. The best by default.
    solver : Solver or str
        Of the semidefinite programs over frequency.

    Returns
    -------
    MultiplierGain
        `upper` is proven for every member, in units of the outputs per unit of the inputs; `lower`
        is the gain of a linear member, found over frequency without multipliers, inf where one is
        not stable.

    Raises
    ------
    InputError
        Blocks, channels and kind that do not fit; a path without delay between channels of static
        functions or delays; a delay of a sampled model; poles that are not above zero.
    UnknownNameError
        A channel that the model does not have, or another kind.

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
    >>> from synthesis.robust import StaticBlock
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
    model, own = as_model(model), blocks_of(blocks)
    if kind not in KINDS:
        raise UnknownNameError("kind", kind, KINDS)
    if decay is not None and kind != PEAK:
        raise InputError(f"decay: it belongs to kind={PEAK!r}; leave it out of {kind!r}")
    asked = Asked.of(model, own, inputs, outputs, poles, order, kind)
    fault = asked.fault()
    if fault == NOMINAL:
        return MultiplierGain(math.inf, math.inf, (), math.nan, None, fault, kind)
    if fault:
        raise InputError(fault)
    if decay is not None and not (0 < decay < (1 if model.dt else math.inf)):
        raise InputError(f"decay: expected a number > 0, sampled below 1, got {decay!r:.40}")
    with progress.task("multipliers", 2) as task:
        family = Family(asked.plant, own, asked.places, model.dt)
        member, sizes = family.worst()
        lower, numbers, omega = member.gain, member.numbers, member.omega
        if kind != L2 and math.isfinite(lower):
            attained = trajectories.energy_to_peak if kind == ENERGY else trajectories.peak_to_peak
            (lower, numbers), omega = attained(family), math.nan
        task.step("a linear member")
        if math.isinf(lower):
            return MultiplierGain(math.inf, lower, numbers, omega, None, UNSTABLE, kind)
        proof: GainProof | PeakProof | None
        if kind == L2:
            proof = asked.proven(member, sizes, general_solver(solver))
        else:
            proof = asked.proven_peak(lower, sizes, decay, general_solver(solver))
    if proof is None:
        return MultiplierGain(math.inf, lower, numbers, omega, None, UNFOUND, kind)
    return MultiplierGain(proof.gain, lower, numbers, omega, proof, "", kind)
