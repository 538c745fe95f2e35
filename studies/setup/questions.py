"""Questions that processes answer side by side, and what their answers become."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

Question = Callable[[], list[Any]]
"""A question that a process can answer: a `functools.partial`; a proof's answers are bounds."""


@dataclass(frozen=True)
class Questions:
    """Proofs or designs that need nothing of each other, and what their answers become together;
    those of `long` take longest and go first.
    """

    proofs: Sequence[Question]
    together: Callable[[tuple[Any, ...]], Any]
    long: Sequence[Question] = ()

    @property
    def order(self) -> list[int]:
        """Positions of the proofs, those of `long` first."""
        first = [self.proofs.index(proof) for proof in self.long]
        return [*first, *(i for i in range(len(self.proofs)) if i not in first)]
