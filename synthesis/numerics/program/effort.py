"""Work of semidefinite programs, in seconds of one core of a common computer."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from symheli.values.numbers import positive
from synthesis.numerics.polynomial.symmetric import length
from synthesis.numerics.program.answer import LEFT
from synthesis.numerics.program.cone_program import ConeProgram
from synthesis.numerics.program.lyapunov_program import LyapunovProgram

PER_ENTRY, PER_OPERATION = 3e-8, 1.3e-11
"""Seconds for each nonzero coefficient and unknown, and for each operation of the factors, of all
iterations together: fitted to Clarabel on a core of 2.5 GHz, within a factor of two.
"""
PER_ITERATION, ITERATIONS = 1e-10, 15
"""Seconds for each operation of a program of Lyapunov inequalities, and its usual iterations."""


@dataclass
class Effort:
    """Work that may be done: once a bound is `proven` that is at most `enough`, no program begins
    that would take the seconds `spent` above the `limit`.
    """

    limit: float = math.inf
    enough: float = math.inf
    spent: float = 0.0
    proven: bool = False

    @classmethod
    def of(cls, given: Any) -> Effort:
        """Return an effort of so many seconds, or one as is given of which nothing is spent; raises
        `InputError` for what is no time.
        """
        if isinstance(given, cls):
            return replace(given, spent=0.0, proven=False)
        return cls(math.inf if given == math.inf else positive(given, "effort"))

    def refused(self, seconds: float) -> str:
        """Return why a program of this work is left out, nothing where it is taken on."""
        total = self.spent + seconds
        if self.proven and total > self.limit:
            about, enough = _digit(seconds, round), _digit(total, math.ceil)
            return f"{LEFT}, about {about:g} s of work; effort={enough:g} tries it"
        self.spent = total
        return ""


def work(program: ConeProgram | LyapunovProgram) -> float:
    """Return the expected work of a program, s; it depends on the sizes of the program alone."""
    if isinstance(program, LyapunovProgram):
        n = program.sizes.unknowns * length(program.sizes.states)
        blocks = sum(len(each.constant) for each in program.blocks) * program.sizes.rows**3
        return ITERATIONS * PER_ITERATION * (n**3 / 3 + blocks * n)
    unknowns = len(program.c)
    operations = (sum(length(n) ** 3 for n in program.sizes) + unknowns**3) / 3
    return PER_ENTRY * unknowns * program.A.nnz + PER_OPERATION * operations


def _digit(seconds: float, whole: Callable[[float], float]) -> float:
    """Return the seconds as one digit that counts, made `whole` in this way."""
    unit = 10.0 ** math.floor(math.log10(seconds))
    return whole(seconds / unit) * unit
