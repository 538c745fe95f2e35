"""Sets of states with a proof: membership, files and words that they have in common."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Self

import numpy as np

from symheli.lazy import former_attribute
from symheli.values.arrays import Array
from synthesis.certify.questions.certificate_file import same_model
from synthesis.certify.statement.proven_statement import ProvenStatement
from synthesis.sets.statement import SetStatement


class ProvenSet(ProvenStatement):
    """The states at which `level` is at most 1, with the `statement` that no motion leaves them.

    `verified` is false, and `why` says why, where the exact check has not passed.
    """

    statement: SetStatement
    verified: bool
    why: str
    form: ClassVar[str]
    """The set in words."""
    reader: ClassVar[str] = "set"

    proven = former_attribute("proven", "verified")

    @property
    @abstractmethod
    def shape_stored(self) -> Mapping[str, Any]:
        """Values that a file holds of the set beside its statement."""

    @abstractmethod
    def level(self, x: Any, *p: float) -> Array:
        """Size of states (..., n) at p in terms of the set: at most 1 in it."""

    def contains(self, x: Any, *p: float) -> bool:
        """Whether the state (n,) lies in the set at p; of states (..., n), whether all do."""
        return bool(np.all(self.level(x, *p) <= 1))

    def established(self) -> Self:
        """The same set, `verified` where the exact check passes."""
        return replace(self, verified=True, why="") if self.verify() else self  # type: ignore[type-var]

    @property
    def claim(self) -> str:
        """The claim in one sentence, with numbers and units."""
        limited = ", ".join(
            f"|{limit.signal}| <= {limit.bound:g}" for limit in self.statement.limits
        )
        return f"{self.form}: no motion leaves it, and in it {limited}"

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, each a sentence made from the numbers of the proof."""
        return self.statement.hypotheses

    @property
    def facts(self) -> Mapping[str, Any]:
        """Kind, bounds and conditions as data that JSON holds."""
        own = self.statement
        return {
            "kind": "invariant set",
            "disturbance": own.disturbance,
            "state_bounds": own.state_bounds,
            "input_bounds": own.input_bounds,
        }

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file: statement and set, as JSON holds them."""
        from synthesis.sets.set_file import written

        return written(self)

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> Self:
        """Return the set of a file, proven anew."""
        from synthesis.sets.set_file import read

        return read(content).established()  # type: ignore[return-value]

    def proven_of(self, model: Any) -> bool:
        """Return whether the claim is about exactly this model; see `ProvenStatement.proven_of`."""
        return same_model(self.statement.model, model)

    def __str__(self) -> str:
        if not self.verified:
            return f"no invariant set: {self.why}"
        return self.statement.summary(self.form)
