"""A proof that somebody else computed, checked: the plant, the claim and its P, K or V."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from symheli.errors import InputError
from symheli.values.summary import summarized
from synthesis.certify.statement.proven_statement import ProvenStatement
from synthesis.claims.lyapunov_claim import LyapunovClaim
from synthesis.claims.plants import VertexPlant

MIXED = "the closed loop of a combination of models is the same combination of their closed loops"
"""Condition of a claim in which each model has its own feedback."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ProvenClaim(ProvenStatement):
    """A claim about a plant, with the P, K or V that somebody else computed and that proves it.

    Attributes
    ----------
    plant, given : object
        The plant and the claim, as `synthesis.claims.check` takes them.
    verified : bool
        Checked in rational arithmetic.
    why : str
        Why nothing is proven; empty where something is.

    Examples
    --------
    >>> from synthesis.claims import LyapunovClaim, ProvenClaim, VertexPlant, check
    >>> verdict = check(VertexPlant([[-1.0]]), LyapunovClaim("decay rate", [[1.0]], 0.5))
    >>> verdict.save("claim.json").name
    'claim.json'
    >>> ProvenClaim.load("claim.json").verify()
    True
    """

    plant: Any
    given: Any
    verified: bool = False
    why: str = "the inequalities do not hold in exact arithmetic"

    reader: ClassVar[str] = "claim"

    __repr__ = summarized

    def verify(self, rigorous: bool = True) -> bool:
        """Check it again from the numbers it has, in rational arithmetic always."""
        from synthesis.claims.check import proven

        return proven(self.plant, self.given)

    def established(self) -> ProvenClaim:
        """Return the same, `verified` where the exact check passes."""
        return replace(self, verified=True, why="") if self.verify() else self

    @property
    def claim(self) -> str:
        """The claim in one sentence, with numbers and units."""
        return self.given.sentence

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, each a sentence made from the numbers of the proof."""
        own = isinstance(self.given, LyapunovClaim) and self.given.each_has_its_own
        mixed = own and isinstance(self.plant, VertexPlant) and len(self.plant.A) > 1
        return (*self.plant.hypotheses, *((MIXED,) if mixed else ()))

    @property
    def facts(self) -> Mapping[str, Any]:
        """Kind, bounds and conditions as data that JSON holds."""
        return {"kind": f"claim of {self.given.kind}"}

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file: plant and claim, as JSON holds them."""
        from synthesis.claims.stored import written

        if not self.verified:
            raise InputError(f"only a proven claim is saved; here {self.why}")
        return written(self.plant, self.given)

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> ProvenClaim:
        """Return the claim of a file, proven anew."""
        from synthesis.claims.stored import restored

        plant, given = restored(content)
        return cls(plant=plant, given=given).established()

    def __str__(self) -> str:
        return f"proven: {self.claim}" if self.verified else f"not proven: {self.why}"
