"""What a classical LFT test proved."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from synthesis.lft.proof import Evidence, Quadratic
from synthesis.verdict import Verdict

Array = np.ndarray


class Trial(NamedTuple):
    """One cone program: what was asked ("gain" or "margin"), its margin, the solver's word, and the
    gain verified (inf: none).
    """

    program: str
    margin: float
    answer: str
    gamma: float

    def __str__(self) -> str:
        return f"{self.program}, margin {self.margin:.0e}: {self.answer}"


@dataclass(frozen=True, eq=False, kw_only=True)
class LFTCertificate(Verdict):
    """A bound on an LFT, "l2 gain" or "stability", for every p(t) in its box, as fast as it likes,
    with its proof.

    scaling     the class of multipliers, one of `SCALINGS`
    proof       P (nx, nx) of V = x'P x and the multiplier, None where there is none
    evidence    the LFT and coordinates that `verify` uses
    """

    scaling: str
    proof: Quadratic | None
    evidence: Evidence | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.scaling, str):
            raise InputError(f"expected the name of a scaling, got {self.scaling!r:.60}")

    @property
    def fault(self) -> str | None:
        """As for every certificate; the multiplier is of the class the certificate names."""
        found = super().fault
        if found or self.proof is None or self.proof.multiplier.scaling == self.scaling:
            return found
        return (
            f"the multiplier is of the class {self.proof.multiplier.scaling!r}, the claim of"
            f" {self.scaling!r:.60}"
        )

    @property
    def lyapunov(self) -> Array | None:
        """P of V = x'P x, in units of the squared output times seconds (samples) per squared
        state.
        """
        return None if self.proof is None else self.proof.P

    @property
    def trials(self) -> tuple[Trial, ...]:
        """The same as `attempts`."""
        return self.attempts

    @property
    def _proof(self) -> tuple[Quadratic | None, Evidence | None]:
        return self.proof, self.evidence

    @property
    def _setting(self) -> str:
        return f"LFT test with {self.scaling}, p arbitrarily fast"

    @property
    def _form(self) -> str | None:
        return None if self.proof is None else "V = x'Px"
