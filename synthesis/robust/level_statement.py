"""Margins and worst-case gains as proven statements: their conditions and files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, ClassVar, Self

import numpy as np

from symheli import LFT, LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.lpv.lft.reduction import exact_units
from symheli.lpv.lft_matrices import LFTMatrices
from symheli.lpv.linear_model import as_model
from symheli.lpv.lpv_matrices import LPVMatrices
from symheli.values.arrays import frozen
from symheli.values.signal import signals
from synthesis.certify.questions.certificate_file import decoded, encoded, same_model
from synthesis.certify.statement.proven_statement import ProvenStatement
from synthesis.certify.statement.sentences import motion
from synthesis.robust.cells import Cell, CellsProof
from synthesis.robust.exact_loop import Part
from synthesis.robust.intervals import Interval, LevelProof, Scalings
from synthesis.robust.structure import DynamicBlock, names_of

Asked = tuple[LFT | LPVStateSpace, Sequence[DynamicBlock]]


class LevelStatement(ProvenStatement):
    """A statement about a loop with constant parameters and blocks, proven by scalings over
    intervals of frequency.
    """

    proof: Any
    asked: Asked | None
    number: ClassVar[str]
    """Field of the proven number."""
    kind: ClassVar[str]

    @property
    def verified(self) -> bool:  # type: ignore[override]
        """Whether there is a proof, which was checked in exact arithmetic as it was found."""
        return self.proof is not None

    @property
    def why(self) -> str:  # type: ignore[override]
        """Why nothing is proven; empty where something is."""
        return "" if self.verified else "no scalings were found that hold at every frequency"

    @property
    def bound(self) -> float:
        """The number that is proven."""
        return float(getattr(self, self.number))

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, each a sentence made from the numbers of the proof."""
        if self.asked is None:
            return ()
        model, blocks = self.asked
        n = len(model.states)
        time = "in continuous time" if model.dt is None else f"sampled every {model.dt!r} s"
        each = (
            f"stable linear time-invariant dynamics from {', '.join(names_of(b.outputs))} to"
            f" {', '.join(names_of(b.inputs))} of gain <= {b.bound!r}"
            f"{'' if b.weight is None else ' times the weight in the file'}"
            for b in blocks
        )
        moving = (motion(s, 0.0) for s in model.parameters)
        return (f"the model in the file, {n} state{'s' * (n != 1)}, {time}", *moving, *each)

    @property
    def facts(self) -> Mapping[str, Any]:
        """Kind, bounds and conditions as data that JSON holds."""
        return {"kind": self.kind, "bound": self.bound}

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file: the number, the model, its blocks and the scalings."""
        if not isinstance(self.proof, LevelProof | CellsProof) or self.asked is None:
            raise InputError(
                "only a bound that is proven by scalings over frequency is saved so; a margin with"
                " one block is proven by a certificate: save its .proof"
            )
        model, blocks = self.asked
        return {
            "kind": self.kind,
            "bound": self.bound,
            "model": encoded(model),
            "blocks": [_written(block) for block in blocks],
            **_copies(model),
            **_written_proof(self.proof),
        }

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> Self:
        """Return the statement of a file, proven anew."""
        proof = _proof(content)
        asked = _model(decoded(content["model"])), [_block(one) for one in content["blocks"]]
        found = cls.proposed(float(content["bound"]), proof, asked)
        return found if found.verify(rigorous=False) else cls.proposed(found.bound, None, asked)

    @classmethod
    def proposed(cls, bound: float, proof: LevelProof | CellsProof | None, asked: Asked) -> Self:
        """Return the statement with this number; without a proof it is none."""
        raise NotImplementedError

    def proven_of(self, model: Any) -> bool:
        """Return whether the claim is about exactly this model; see `ProvenStatement.proven_of`."""
        return self.asked is not None and same_model(self.asked[0], model)


def _copies(model: LFT | LPVStateSpace) -> dict[str, Any]:
    """Return the units of the copies, for the checker that stands alone; nothing where the proof is
    in other coordinates.
    """
    units = exact_units(model) if isinstance(model, LFT) else None
    return {} if units is None else {"copies": encoded(units)}


def _written_proof(proof: LevelProof | CellsProof) -> dict[str, Any]:
    if isinstance(proof, CellsProof):
        return {
            "cells": [
                {"low": [*low], "high": [*high], **_written_proof(own)}
                for low, high, own in proof.cells
            ]
        }
    return {
        "level": proof.level,
        "rows": encoded(proof.rows),
        "columns": encoded(proof.columns),
        "parts": [
            [p.rows.start, p.rows.stop, p.columns.start, p.columns.stop, p.real]
            for p in proof.parts
        ],
        "performance": proof.performance,
        "intervals": [
            [encoded(low), encoded(high), *(_complex(M) for M in by)]
            for low, high, by in proof.intervals
        ],
    }


def _proof(content: Mapping[str, Any]) -> LevelProof | CellsProof:
    if "cells" in content:
        return CellsProof(tuple(map(_cell, content["cells"])))
    return _level_proof(content)


def _cell(content: Mapping[str, Any]) -> Cell:
    low, high = (tuple(map(float, content[end])) for end in ("low", "high"))
    return Cell(low, high, _level_proof(content))


def _level_proof(content: Mapping[str, Any]) -> LevelProof:
    parts = tuple(
        Part(slice(int(a), int(b)), slice(int(c), int(d)), real is True)
        for a, b, c, d, real in content["parts"]
    )
    intervals = tuple(
        Interval(float(decoded(low)), float(decoded(high)), Scalings(*map(_read_complex, by)))
        for low, high, *by in content["intervals"]
    )
    return LevelProof(
        float(content["level"]),
        frozen(decoded(content["rows"]), "rows", (None,)),
        frozen(decoded(content["columns"]), "columns", (None,)),
        parts,
        content["performance"] is True,
        intervals,
    )


def _complex(M: Any) -> list[Any]:
    return [encoded(np.array(np.real(M), float)), encoded(np.array(np.imag(M), float))]


def _read_complex(parts: Any) -> Any:
    real, imaginary = map(decoded, parts)
    return np.asarray(real) + 1j * np.asarray(imaginary)


def _written(block: DynamicBlock) -> dict[str, Any]:
    weight = None
    if block.weight is not None:
        own = as_model(block.weight)
        weight = {**{name: encoded(getattr(own, name)) for name in "ABCD"}, "dt": own.dt}
    own_names = {
        side: list(map(str, names_of(getattr(block, side)))) for side in ("inputs", "outputs")
    }
    return {**own_names, "bound": float(block.bound), "weight": weight}


def _block(content: Mapping[str, Any]) -> DynamicBlock:
    weight = content["weight"]
    if weight is not None:
        A, B, C, D = (np.asarray(decoded(weight[name]), float) for name in "ABCD")
        states = signals(f"x{i}" for i in range(len(A)))
        weight = LinearModel(A, B, C, D, states, signals(["u"]), signals(["y"]), weight["dt"])
    into, out = ([str(name) for name in content[group]] for group in ("inputs", "outputs"))
    return DynamicBlock(into, out, float(content["bound"]), weight)


def _model(value: Any) -> LFT | LPVStateSpace:
    for matrices, model in ((LPVMatrices, LPVStateSpace), (LFTMatrices, LFT)):
        if isinstance(value, matrices):
            return model(**{f.name: getattr(value, f.name) for f in fields(value)})
    raise InputError(f"expected an LPVStateSpace or an LFT, got {type(value).__name__}")
