"""The question of a gain: model and blocks in numbers, with the classes of their multipliers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from symheli import LinearModel
from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.signal import indices
from synthesis.numerics.program.cone_program import Solver
from synthesis.robust.multipliers import search as searching
from synthesis.robust.multipliers.blocks import (
    Block,
    DelayBlock,
    OwnMultiplier,
    ParameterBlock,
    StaticBlock,
    multipliers_of,
)
from synthesis.robust.multipliers.boxes import BoxMultipliers
from synthesis.robust.multipliers.classes import Lags
from synthesis.robust.multipliers.delays import PHASE
from synthesis.robust.multipliers.loop import Plant, Wired
from synthesis.robust.multipliers.members import Member
from synthesis.robust.multipliers.peak_proof import PeakProof
from synthesis.robust.multipliers.peaks import PeakSearch
from synthesis.robust.multipliers.proof import GainProof
from synthesis.robust.multipliers.search import Search, Storage
from synthesis.robust.structure import DynamicBlock

L2 = "L2"
KINDS = StaticBlock, DelayBlock, ParameterBlock, DynamicBlock, OwnMultiplier
APART = 30.0
"""Ratio of the fastest to the slowest pole of a model from which on the lags have two poles."""


@dataclass(frozen=True, eq=False)
class Asked:
    """A question in numbers."""

    plant: Plant
    blocks: tuple[Wired, ...]
    dt: float | None
    kind: str
    places: list[tuple[Sequence[int], Sequence[int]]]
    """Channels of each block that was given."""

    @classmethod
    def of(
        cls,
        model: LinearModel,
        blocks: Sequence[Block],
        inputs: Sequence[str] | None,
        outputs: Sequence[str] | None,
        poles: Sequence[float] | None,
        order: int,
        measure: str,
    ) -> Asked:
        """Return the question; raise for names and numbers that do not fit."""
        for block in blocks:
            if isinstance(block, OwnMultiplier) and block.filter.dt != model.dt:
                raise InputError(
                    f"filter: it is {_time(block.filter.dt)} and the model {_time(model.dt)}; give"
                    " the filter in the time of the model"
                )
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
        places = [
            (tuple(place[i] for i in into), tuple(out)) for into, out in zip(*taken, strict=True)
        ]
        wired = []
        for block, (into, out) in zip(blocks, places, strict=True):
            moving = model.dt is None and not np.any(plant.D[list(out)]) and measure == L2
            lags = _lags(block, model, poles, order) if measure == L2 else Lags((), 0)
            wired.append(Wired(multipliers_of(block, lags, moving), into, out))
        wired = wired if measure == L2 else in_one_box(blocks, wired)
        return cls(plant, tuple(wired), model.dt, measure, list(places))

    def fault(self) -> str:
        """Return why model, blocks and kind do not fit; empty where they do."""
        if self.kind == L2:
            return self.proof(np.zeros((0, 0)), (), 0.0).fault_of_blocks()
        own = (), (), self.kind, 0.0, (0.0, 0.0), 0.0
        proof = PeakProof(self.plant, self.dt, self.blocks, np.zeros((0, 0)), *own)
        return proof.fault_of_blocks()

    def proof(self, P: Array, coefficients: tuple[Array, ...], gain: float) -> GainProof:
        """Return these numbers as a proof."""
        return GainProof(self.plant, self.dt, self.blocks, P, coefficients, gain)

    def proven(self, member: Member, sizes: Array, solver: Solver) -> GainProof | None:
        """Return the proof of the least L2 gain that is found; None where none is."""
        peak = member.omega * (self.dt or 1.0)
        search = Search(self.plant, self.blocks, solver, member.gain or 1.0, sizes, peak)

        def proven(at: Storage, level: float) -> bool:
            return not self.proof(*at, level).fault()

        found = searching.found(search, proven)
        return None if found is None else self.proof(*found[1], found[0])

    def proven_peak(
        self, lower: float, sizes: Array, decay: float | None, solver: Solver
    ) -> PeakProof | None:
        """Return the proof of the least gain to a peak that is found; None where none is."""
        own = self.plant, self.dt, self.blocks, self.kind, solver, lower or 1.0, sizes
        return PeakSearch(*own).found(decay, lambda proof: not proof.fault())


def in_one_box(blocks: Sequence[Block], wired: Sequence[Wired]) -> list[Wired]:
    """Return the blocks with all parameters as one."""
    own = [k for k, block in enumerate(blocks) if isinstance(block, ParameterBlock)]
    if not own:
        return list(wired)
    given = [block for block in blocks if isinstance(block, ParameterBlock)]
    sizes = tuple(len(wired[k].inputs) for k in own)
    lows, highs = tuple(float(b.low) for b in given), tuple(float(b.high) for b in given)
    box = BoxMultipliers(sum(sizes), lows, highs, sizes, Lags((), 0))
    into = tuple(i for k in own for i in wired[k].inputs)
    out = tuple(j for k in own for j in wired[k].outputs)
    rest = [each for k, each in enumerate(wired) if k not in own]
    return [Wired(box, into, out), *rest]


def blocks_of(given: Sequence[Block] | Block) -> list[Block]:
    """Return a list, of one block too: a named tuple is a sequence as well."""
    match given:
        case StaticBlock() | DelayBlock() | ParameterBlock() | OwnMultiplier() | DynamicBlock():
            return [given]
        case _:
            found: list[Any] = list(given) if isinstance(given, Iterable) else [given]
    for each in found:
        if not isinstance(each, KINDS):
            raise InputError(
                f"blocks: expected {', '.join(kind.__name__ for kind in KINDS)}, got {each!r:.40}"
            )
    return found


def _time(dt: float | None) -> str:
    return "continuous" if dt is None else f"sampled every {dt!r} s"


def _list(names: Sequence[str]) -> list[str]:
    return [names] if isinstance(names, str) else list(names)


def _lags(block: Block, model: LinearModel, poles: Sequence[float] | None, order: int) -> Lags:
    """Return the lags of a block, sampled as the model is."""
    if isinstance(order, bool) or not isinstance(order, int) or not 1 <= order <= 20:
        raise InputError(f"order: expected an integer from 1 to 20, got {order!r:.40}")
    if isinstance(block, DelayBlock):
        return Lags((2.0 / block.longest,), max(order, PHASE + (block.form == "window")))
    given = _usual(model) if poles is None else tuple(np.ravel(np.asarray(poles, float)).tolist())
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
