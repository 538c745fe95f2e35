"""What was proven over a box of parameters, or by another relaxation than plain Bernstein
coefficients.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from symheli.errors import CertificateError
from synthesis.lyapunov.box import BoxLyapunov
from synthesis.proof.box import Evidence
from synthesis.verdict import Verdict


@dataclass(frozen=True, eq=False, kw_only=True)
class BoxCertificate(Verdict):
    """A bound for every p(t) in a box within its rates, of any kind, with its proof and its
    hypotheses.

    relaxation  how the inequalities were imposed; a "grid" proves nothing lyapunov    V = x' P(p)
    x, None where there is none indicative  the bound that holds at the points of a grid, where that
    was asked for: no proof; else NaN evidence    the model and units that `verify` uses
    """

    relaxation: str
    lyapunov: BoxLyapunov | None
    indicative: float = math.nan
    evidence: Evidence | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.verified and self.relaxation == "grid":
            raise CertificateError(
                "a certificate on a grid cannot be verified: between its points nothing is known"
            )

    @property
    def _proof(self) -> tuple[BoxLyapunov | None, Evidence | None]:
        return None if self.relaxation == "grid" else self.lyapunov, self.evidence

    @property
    def _setting(self) -> str:
        grid = "" if math.isnan(self.indicative) else f" (at its points {self.indicative:.6g})"
        return f"relaxation {self.relaxation}{grid}"

    @property
    def _form(self) -> str | None:
        return self.lyapunov.form if self.lyapunov else None
