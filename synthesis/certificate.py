"""What was proven of a model in one parameter by a spline P(p)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from synthesis.lyapunov.spline import Lyapunov
from synthesis.proof.one_parameter import Evidence
from synthesis.verdict import Verdict


class Attempt(NamedTuple):
    """One try: segments and degree of P, its margin, the solver's word, and the bound verified from
    it (inf: none).
    """

    segments: int
    degree: int
    margin: float
    answer: str
    gamma: float

    def __str__(self) -> str:
        return (
            f"{self.segments} segments of degree {self.degree}, margin {self.margin:.0e}:"
            f" {self.answer}"
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Certificate(Verdict):
    """A bound on an LPV model in one parameter, "l2 gain" or "stability", with its proof and its
    hypotheses.

    lyapunov    V = x' P(p) x, None where there is none
    unit        of p
    evidence    the model and units that `verify` uses
    """

    lyapunov: Lyapunov | None
    unit: str = "1"
    evidence: Evidence | None = field(default=None, repr=False)

    @property
    def _proof(self) -> tuple[Lyapunov | None, Evidence | None]:
        return self.lyapunov, self.evidence

    @property
    def _setting(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        limit = (
            "arbitrarily fast"
            if math.isinf(self.rate)
            else "frozen"
            if self.rate == 0
            else f"at most {self.rate:g}{unit} per second"
        )
        return f"p {limit}"

    @property
    def _form(self) -> str | None:
        return self.lyapunov.form if self.lyapunov else None
