"""Sets of states with a proof: membership, files and words that they have in common."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from symheli.lazy import former_attribute
from symheli.values.arrays import Array
from synthesis.sets.statement import SetStatement


class ProvenSet(ABC):
    """The states at which `level` is at most 1, with the `statement` that no motion leaves them.

    `verified` is false, and `why` says why, where the exact check has not passed.
    """

    statement: SetStatement
    verified: bool
    why: str
    form: ClassVar[str]
    """The set in words."""

    proven = former_attribute("proven", "verified")

    @property
    @abstractmethod
    def stored(self) -> Mapping[str, Any]:
        """Values that a file holds of the set beside its statement."""

    @abstractmethod
    def level(self, x: Any, *p: float) -> Array:
        """Size of states (..., n) at p in terms of the set: at most 1 in it."""

    @abstractmethod
    def verify(self) -> bool:
        """Check every inequality again, in rational arithmetic."""

    def contains(self, x: Any, *p: float) -> bool:
        """Whether the state (n,) lies in the set at p; of states (..., n), whether all do."""
        return bool(np.all(self.level(x, *p) <= 1))

    def established(self) -> Self:
        """The same set, `verified` where the exact check passes."""
        return replace(self, verified=True, why="") if self.verify() else self  # type: ignore[type-var]

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the set as JSON, sufficient to prove it again: `symheli verify FILE`."""
        from synthesis.sets.set_file import written

        return written(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a set and prove it again; `verified` says whether that succeeded."""
        from synthesis.sets.set_file import read

        return read(path, cls)

    def __str__(self) -> str:
        if not self.verified:
            return f"no invariant set: {self.why}"
        return self.statement.summary(self.form)
