"""What was proven over a box of parameters, under which hypotheses, and how far from the truth it can be."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from symheli.errors import CertificateError
from synthesis.certificate import Attempt, Seconds, Status, Trajectory
from synthesis.polynomial.inequalities import Kind
from synthesis.polynomial.lyapunov import BoxLyapunov
from synthesis.polynomial.proof import Evidence

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class BoxCertificate:
    """A bound for every p(t) in a box within its rates, with its proof and its hypotheses.

    kind        "l2 gain", "energy-to-peak gain", "decay rate" or "stability"
    proven      what was proven: an upper bound of the gain (inf where nothing was), a lower bound of the decay rate in 1/s
                (-inf where nothing was), NaN for stability
    limit       what no proof can beat, from trajectories actually computed, in the same units; NaN for stability
    frozen      the same from p constant alone
    indicative  the bound that holds at the points of a grid, where that was asked for: no proof; else NaN
    status      a `Status`; its value is a sentence
    verified    recomputed from the model and `lyapunov` alone in floating point; never for a grid
    lyapunov    V = x' P(p) x, None where there is none
    worst       scheduling trajectory behind `limit`, None where p is constant there; p (n,) or (n, m)
    """

    kind: Kind
    relaxation: str
    proven: float
    limit: float
    frozen: float
    status: Status
    verified: bool
    lyapunov: BoxLyapunov | None
    hypotheses: tuple[str, ...]
    solver: str
    seconds: Seconds
    attempts: tuple[Attempt, ...]
    indicative: float = math.nan
    worst: Trajectory | None = None
    evidence: Evidence | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        # frozen and limit are computed to 1e-8, what is proven is loosened by at least 5e-7
        slack = 1e-6 * abs(self.proven) if math.isfinite(self.proven) else 0.0
        for name, bound in (("frozen value", self.frozen), ("worst trajectory", self.limit)):
            wrong = bound < self.proven - slack if self.kind == "decay rate" else bound > self.proven + slack
            if self.verified and wrong:
                raise CertificateError(
                    f"the {name} {bound:.9g} contradicts the certified {self.kind} {self.proven:.9g}; one of the two is wrong"
                )
        if self.verified and (self.status is not Status.PROVEN or self.relaxation == "grid"):
            raise CertificateError(f"a verified certificate cannot have the status {self.status.name} (relaxation {self.relaxation})")

    @property
    def gamma(self) -> float:
        """Proven upper bound of a gain; inf where nothing was proven, NaN for decay rate and stability."""
        return self.proven if self.kind.endswith("gain") else math.nan

    @property
    def lower(self) -> float:
        """No upper bound of the gain can be smaller; NaN for decay rate and stability."""
        return self.limit if self.kind.endswith("gain") else math.nan

    @property
    def alpha(self) -> float:
        """Proven decay rate, 1/s: |x(t)| <= c exp(-alpha t) |x(0)|; -inf where nothing was proven, NaN for other kinds."""
        return self.proven if self.kind == "decay rate" else math.nan

    @property
    def upper(self) -> float:
        """No larger decay rate can be proven, 1/s; NaN for other kinds."""
        return self.limit if self.kind == "decay rate" else math.nan

    def verify(self, rigorous: bool = False) -> bool:
        """Verify `lyapunov` and the bound anew; `rigorous`: in exact rational arithmetic (python-flint makes it fast).

        Nothing is verified of a grid, nor without a Lyapunov function.
        """
        if self.lyapunov is None or self.evidence is None or self.relaxation == "grid":
            return False
        return (self.evidence.exact if rigorous else self.evidence.floating)(self.lyapunov, self.proven)

    def __str__(self) -> str:
        lines = [f"{self.kind}, relaxation {self.relaxation}: {self.status.value}"]
        if self.kind.endswith("gain"):
            lines.append(f"  frozen {self.frozen:.6g} <= lower {self.limit:.6g} <= gain <= {self.proven:.6g}")
        elif self.kind == "decay rate":
            lines.append(f"  {self.proven:.6g} <= decay rate <= {self.limit:.6g} <= frozen {self.frozen:.6g}, 1/s")
        if not math.isnan(self.indicative):
            lines.append(f"  at the points of the grid, unproven: {self.indicative:.6g}")
        if self.lyapunov is not None:
            lines.append(f"  V = x'P(p)x, degrees {self.lyapunov.degrees} on {self.lyapunov.segments} segment(s)")
        s = self.seconds
        stages = f"build {s.build:.2f} s, solve {s.solve:.2f} s, verify {s.verify:.2f} s, limits {s.bounds:.2f} s"
        lines.append(f"  {self.solver}; {stages}")
        lines += [f"  - {sentence}" for sentence in self.hypotheses]
        return "\n".join(lines)
