"""What was proven, under which hypotheses, by which route, and how far from the truth it can be."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import Literal, NamedTuple

import numpy as np

from symheli.errors import CertificateError
from synthesis.lyapunov import Lyapunov
from synthesis.verify import Evidence

Array = np.ndarray


class Status(Enum):
    """How a certificate came out; the value is the sentence to print."""

    PROVEN = "proven on the whole interval"
    UNSTABLE = "no certificate exists: a model frozen at some p is not stable"
    GROWING = "no certificate exists: a scheduling trajectory within the limits makes the state grow"
    INFEASIBLE = "no Lyapunov function of this form exists, to the solver's accuracy; the model may still be stable"
    UNPROVEN = "unproven on a grid: the inequalities hold at its points, between them nothing is known"
    FAILED = "solver failed: what it returned could not be verified"


class Seconds(NamedTuple):
    """Wall time of each stage, s."""

    build: float = 0.0
    solve: float = 0.0
    verify: float = 0.0
    bounds: float = 0.0


class Attempt(NamedTuple):
    """One try: segments and degree of P, its margin, the solver's word, and the gain verified from it (inf: none)."""

    segments: int
    degree: int
    margin: float
    answer: str
    gamma: float


class Trajectory(NamedTuple):
    """The worst scheduling trajectory found: `time` (n,) in s, `p` (n,), straight lines (discrete time: samples) between them."""

    time: Array
    p: Array


@dataclass(frozen=True, eq=False)
class Certificate:
    """A bound on the LPV model, with its proof and its hypotheses.

    kind        "l2 gain" or "stability"
    gamma       proven upper bound of the L2 gain from inputs to outputs; inf where nothing was proven; NaN for stability
    lower       no upper bound can be smaller: from trajectories actually computed (inf: the state grows); NaN for stability
    frozen      largest H-infinity norm over the frozen models; NaN for stability
    status      a `Status`; its value is a sentence
    verified    the floating-point verification passed, recomputed from the model and `lyapunov` alone
    lyapunov    V = x' P(p) x, None where there is none
    rate        bound on |dp/dt| in units of p per second (inf: arbitrary; 0: frozen)
    worst       scheduling trajectory behind `lower`, None where p is constant there
    evidence    the model and units that `verify` uses
    """

    kind: Literal["l2 gain", "stability"]
    gamma: float
    lower: float
    frozen: float
    status: Status
    verified: bool
    lyapunov: Lyapunov | None
    rate: float
    hypotheses: tuple[str, ...]
    solver: str
    seconds: Seconds
    conditioning: float
    attempts: tuple[Attempt, ...]
    worst: Trajectory | None = None
    unit: str = "1"
    evidence: Evidence | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        slack = 1 + 1e-6  # frozen and lower are computed to 1e-8, gamma is inflated by 5e-7
        for name, bound in (("frozen gain", self.frozen), ("lower bound", self.lower)):
            if self.verified and self.kind == "l2 gain" and bound > self.gamma * slack:
                raise CertificateError(f"the {name} {bound:.9g} exceeds the certified gain {self.gamma:.9g}; one of the two is wrong")
        if self.verified and self.status is not Status.PROVEN:
            raise CertificateError(f"a verified certificate cannot have the status {self.status.name}")

    @property
    def gap(self) -> float:
        """gamma / lower: 1 means exact."""
        return self.gamma / self.lower if self.lower > 0 else math.inf

    def verify(self, rigorous: bool = False) -> bool:
        """Verify `lyapunov` and `gamma` anew; `rigorous`: in exact rational arithmetic (python-flint makes it fast).

        Exact: the doubles of the model's Bernstein coefficients, of P, rate and gamma are taken as the rationals they
        are, and an LDL' factorisation of every coefficient decides. Without a Lyapunov function nothing is verified.
        """
        if self.lyapunov is None or self.evidence is None:
            return False
        return (self.evidence.exact if rigorous else self.evidence.floating)(self.lyapunov, self.gamma)

    def __str__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        limit = "arbitrarily fast" if math.isinf(self.rate) else "frozen" if self.rate == 0 else f"at most {self.rate:g}{unit} per second"
        lines = [f"{self.kind}, p {limit}: {self.status.value}"]
        if self.kind == "l2 gain":
            lines.append(f"  frozen {self.frozen:.6g} <= lower {self.lower:.6g} <= gain <= {self.gamma:.6g}")
        if self.lyapunov is not None:
            P = self.lyapunov
            lines.append(f"  {P.form}, condition number {self.conditioning:.2g}")
        s = self.seconds
        stages = f"build {s.build:.2f} s, solve {s.solve:.2f} s, verify {s.verify:.2f} s, lower bounds {s.bounds:.2f} s"
        lines.append(f"  {self.solver}; {stages}")
        lines += [f"  tried: {a.segments} segments of degree {a.degree}, margin {a.margin:.0e}: {a.answer}" for a in self.attempts[:-1]]
        lines += [f"  - {sentence}" for sentence in self.hypotheses]
        return "\n".join(lines)
