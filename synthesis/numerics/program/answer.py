"""Answers of a solver of cone programs."""

from __future__ import annotations

from enum import Enum


class Answer(Enum):
    """Status that the solver reports for the program."""

    SOLVED = "the solver reports a solution"
    INFEASIBLE = "the solver reports that no solution exists"
    FAILED = "the solver stopped without an answer"
    UNTRIED = "the program was not given to the solver"


LEFT = "left untried"
"""First words for a program that was too much work."""
