"""The base of every result that is called proven: claim, conditions, proof and file."""

from __future__ import annotations

import math
import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

from symheli.errors import InputError


class ProvenStatement(ABC):
    """A claim about a model, with the conditions under which it holds and the numbers that prove
    it.

    Claim and conditions are made from these numbers, never from text in a file.

    Attributes
    ----------
    verified : bool
        The check of the definition passed.
    why : str
        Why nothing is proven; empty where something is.
    """

    reader: ClassVar[str]
    """Name of the entry point by which files of this class are read."""

    verified: bool
    why: Any

    @property
    @abstractmethod
    def claim(self) -> str:
        """The claim in one sentence, with numbers and units."""

    @property
    @abstractmethod
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, each a sentence made from the numbers of the proof."""

    @property
    @abstractmethod
    def facts(self) -> Mapping[str, Any]:
        """Kind, bounds and conditions as data that JSON holds."""

    @property
    def bound(self) -> float:
        """The number that is proven; NaN of a claim without one."""
        return math.nan

    @abstractmethod
    def verify(self, rigorous: bool = True) -> bool:
        """Check the claim anew from its numbers, in rational arithmetic; `rigorous` False: in
        floating point where a statement has such a check.
        """

    @property
    @abstractmethod
    def stored(self) -> dict[str, Any]:
        """Values of a file: all numbers on which the claim rests, as JSON holds them."""

    @classmethod
    @abstractmethod
    def restored(cls, content: Mapping[str, Any]) -> Self:
        """Return the statement of a file, proven anew; `why` says where that failed."""

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write everything that proves the claim into a JSON file, every double exactly: `symheli
        verify FILE` proves it again.

        Raises `SymheliError` where the file cannot be written, `InputError` for a statement that no
        file can hold or without a proof.
        """
        from synthesis.certify.statement.statement_file import write

        return write(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a statement of this class and prove it again; `verified` says whether that
        succeeded.

        Raises `InputError` for a file that is damaged or another.
        """
        from synthesis.certify.statement.statement_file import read

        return read(path, cls)

    def proven_of(self, model: Any) -> bool:
        """Return whether the claim is about exactly this model: the same matrices at every p, the
        same ranges and sample period. Raises `InputError` for a statement that has no such model.
        """
        raise InputError(f"a {type(self).__name__} is not about one model that could be compared")
