"""Outcome of a question: its status, the attempts of the search and their times."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from synthesis.numerics.program.answer import LEFT, Answer


class Status(Enum):
    """Outcome of a certificate; the value is the sentence to print."""

    PROVEN = "proven on the whole interval"
    UNSTABLE = "no certificate exists: a model frozen at some p is not stable"
    GROWING = (
        "no certificate exists: a scheduling trajectory within the limits makes the state grow"
    )
    INFEASIBLE = (
        "no Lyapunov function of this form meets the inequalities imposed, to the solver's"
        " accuracy; the model may still be stable"
    )
    UNPROVEN = (
        "unproven on a grid: the inequalities hold at its points, between them nothing is known"
    )
    GROWTH = "no decay is proven: the best bound found is one of growth, alpha < 0"
    FAILED = "solver failed: what it returned could not be verified"
    UNTRIED = "not tried: the programs of this form are too large for the solver; nothing is known"

    @classmethod
    def without_proof(cls, answer: Answer) -> Status:
        """Return the status where nothing was proven and the solver gave this answer to the last
        program.
        """
        return {Answer.INFEASIBLE: cls.INFEASIBLE, Answer.UNTRIED: cls.UNTRIED}.get(
            answer, cls.FAILED
        )


class Seconds(NamedTuple):
    """Wall time of each stage, s."""

    build: float = 0.0
    solve: float = 0.0
    verify: float = 0.0
    bounds: float = 0.0

    def __str__(self) -> str:
        return (
            f"build {self.build:.2f} s, solve {self.solve:.2f} s, verify {self.verify:.2f} s,"
            f" bounds {self.bounds:.2f} s"
        )


class Attempt(NamedTuple):
    """One cone program: its description, its margin, the solver's answer, and the bound verified
    from it (inf: none; NaN: stability has none).
    """

    program: str
    margin: float
    answer: str
    bound: float

    @property
    def left(self) -> bool:
        """Whether it was left untried for its work."""
        return self.answer.startswith(LEFT)

    def __str__(self) -> str:
        return f"{self.program}, margin {self.margin:.0e}: {self.answer}"
