"""What a classical LFT test proved, under which hypotheses, and how far from the truth it can be."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from symheli.errors import CertificateError
from synthesis.certificate import Seconds, Status, Trajectory
from synthesis.lft.proof import Evidence, Quadratic

Array = np.ndarray


class Trial(NamedTuple):
    """One cone program: what was asked ("gain" or "margin"), its margin, the solver's word, and the gain verified (inf: none)."""

    program: str
    margin: float
    answer: str
    gamma: float


@dataclass(frozen=True, eq=False)
class LFTCertificate:
    """A bound on an LFT for every p(t) in its box, as fast as it likes, with its proof and its hypotheses.

    kind        "l2 gain" or "stability"
    scaling     the class of multipliers, one of `SCALINGS`
    gamma       proven upper bound of the L2 gain from inputs to outputs; inf where nothing was proven; NaN for stability
    lower       no upper bound can be smaller: from trajectories actually computed (inf: the state grows); NaN for stability
    frozen      largest H-infinity norm over the frozen models; NaN for stability
    status      a `Status`; its value is a sentence
    verified    the floating-point verification passed, recomputed from the LFT and `proof` alone
    proof       P (nx, nx) of V = x'P x and the multiplier, None where there is none
    worst       scheduling trajectory behind `lower`, None where p is constant there; p (n,) or (n, m) with m parameters
    """

    kind: Literal["l2 gain", "stability"]
    scaling: str
    gamma: float
    lower: float
    frozen: float
    status: Status
    verified: bool
    proof: Quadratic | None
    hypotheses: tuple[str, ...]
    solver: str
    seconds: Seconds
    conditioning: float
    trials: tuple[Trial, ...]
    worst: Trajectory | None = None
    evidence: Evidence | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        slack = 1 + 1e-6  # frozen and lower are computed to 1e-8, gamma is inflated by 5e-7
        for name, bound in (("frozen gain", self.frozen), ("lower bound", self.lower)):
            if self.verified and self.kind == "l2 gain" and bound > self.gamma * slack:
                raise CertificateError(f"the {name} {bound:.9g} exceeds the certified gain {self.gamma:.9g}; one of the two is wrong")
        if self.verified and self.status is not Status.PROVEN:
            raise CertificateError(f"a verified certificate cannot have the status {self.status.name}")

    @property
    def lyapunov(self) -> Array | None:
        """P of V = x'P x, in units of the squared output times seconds (samples) per squared state."""
        return None if self.proof is None else self.proof.P

    @property
    def gap(self) -> float:
        """gamma / lower: 1 means exact."""
        return self.gamma / self.lower if self.lower > 0 else math.inf

    def verify(self, rigorous: bool = False) -> bool:
        """Verify `proof` and `gamma` anew; `rigorous`: in exact rational arithmetic (python-flint makes it fast).

        Exact: the doubles of the LFT, of the proof and of gamma are taken as the rationals they are. Finitely many matrices
        decide, none between grid points is left out. Without a proof nothing is verified.
        """
        if self.proof is None or self.evidence is None:
            return False
        return (self.evidence.exact if rigorous else self.evidence.floating)(self.proof, self.gamma)

    def __str__(self) -> str:
        lines = [f"{self.kind}, LFT test with {self.scaling}, p arbitrarily fast: {self.status.value}"]
        if self.kind == "l2 gain":
            lines.append(f"  frozen {self.frozen:.6g} <= lower {self.lower:.6g} <= gain <= {self.gamma:.6g}")
        if self.proof is not None:
            lines.append(f"  V = x'Px, condition number {self.conditioning:.2g}")
        s = self.seconds
        stages = f"build {s.build:.2f} s, solve {s.solve:.2f} s, verify {s.verify:.2f} s, lower bounds {s.bounds:.2f} s"
        lines.append(f"  {self.solver}; {stages}")
        lines += [f"  tried: {t.program}, margin {t.margin:.0e}: {t.answer}" for t in self.trials]
        lines += [f"  - {sentence}" for sentence in self.hypotheses]
        return "\n".join(lines)
