"""The answer about a claim: proven, not by this P, false, or not decided; with what shows it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.summary import summarized
from synthesis.certify.statement.proven_statement import ProvenStatement

PROVEN = "proven"
NOT_BY_THIS = "this P does not prove it"
FALSE = "the claim is false"
UNDECIDED = "not decided"
ANSWERS = (PROVEN, NOT_BY_THIS, FALSE, UNDECIDED)


class Counterexample(NamedTuple):
    """States `x` (k, n) at the times `time` (k,), s or samples, and where the plant was: `p` (k,),
    a parameter or the number of a vertex, counted from one; None where it stays.
    """

    time: Array
    x: Array
    p: Array | None

    __repr__ = summarized


class Place(NamedTuple):
    """The place of a failure: in words, by the parameter or vertex (None: the plant is one), and
    the direction or state `x`; `short` is what is missing, as a part of the size of its terms.
    """

    words: str
    p: float | None
    x: Array | None
    short: float

    __repr__ = summarized


@dataclass(frozen=True, eq=False, kw_only=True)
class Verdict:
    """The answer about a claim, with what shows it.

    Attributes
    ----------
    answer : str
        One of "proven", "this P does not prove it", "the claim is false" and "not decided".
    claim : str
        The claim in one sentence.
    hypotheses : tuple of str
        What the plant is taken to be.
    reason : str
        Why this is the answer, in a sentence; empty of a proof.
    place : Place or None
        Where the inequality fails, in exact arithmetic.
    motion : Counterexample or None
        A motion that contradicts the claim.
    exact : bool
        Whether rational arithmetic decided; False: an integration, repeated by another method.
    proves : float
        The bound or level that this P, K or V does prove; NaN where there is none.
    statement : ProvenStatement or None
        What `save` writes, of a proof.

    Examples
    --------
    >>> plant = synthesis.claims.VertexPlant([[[-1.0]], [[-2.0]]])
    >>> found = synthesis.claims.check(plant, synthesis.claims.LyapunovClaim("stability", [[1.0]]))
    >>> found.answer, found.proven
    ('proven', True)
    """

    answer: str
    claim: str
    hypotheses: tuple[str, ...]
    reason: str = ""
    place: Place | None = None
    motion: Counterexample | None = None
    exact: bool = True
    proves: float = math.nan
    statement: ProvenStatement | None = None

    __repr__ = summarized

    @property
    def proven(self) -> bool:
        """Whether the claim is proven."""
        return self.answer == PROVEN

    def save(self, path: Any) -> Any:
        """Write the proof into a file that `symheli verify` and the checker prove again.

        Raises `InputError` where there is no proof.
        """
        if self.statement is None:
            raise InputError(f"only a proof is saved; the answer is: {self.answer}")
        return self.statement.save(path)

    def __str__(self) -> str:
        how = "in exact arithmetic" if self.exact else "computed"
        lines = [f"{self.answer} ({how})", f"claim: {self.claim}"]
        lines += [f"- {line}" for line in self.hypotheses]
        lines += [self.reason] if self.reason else []
        lines += [_placed(self.place)] if self.place is not None else []
        lines += [_moved(self.motion)] if self.motion is not None else []
        if not math.isnan(self.proves):
            lines.append(f"What is proven instead: {self.proves:.9g}")
        return "\n".join(line for line in lines if line)

    @property
    def facts(self) -> dict[str, Any]:
        """The verdict as data that JSON holds."""
        place, motion = self.place, self.motion
        found: dict[str, Any] = {
            "answer": self.answer,
            "claim": self.claim,
            "hypotheses": list(self.hypotheses),
            "exact": self.exact,
        }
        found |= {"reason": self.reason} if self.reason else {}
        if place is not None:
            found["place"] = {**place._asdict(), "x": _listed(place.x)}
        if motion is not None:
            found["motion"] = {name: _listed(v) for name, v in motion._asdict().items()}
        return found | ({} if math.isnan(self.proves) else {"proves": self.proves})


def _listed(values: Array | None) -> Any:
    return None if values is None else np.asarray(values, dtype=float).tolist()


def _placed(place: Place) -> str:
    along = "" if place.x is None else f", along x = {_numbers(place.x)}"
    if place.short == 0:
        return f"It holds with equality at {place.words}{along}."
    return f"It fails at {place.words}{along}; it is short by {place.short:.3g} of its terms."


def _moved(motion: Counterexample) -> str:
    first, last = motion.x[0], motion.x[-1]
    along = motion.p is not None and len(set(motion.p.tolist())) > 1
    where = f", along p = {_few(motion.p)}" if along and motion.p is not None else ""
    end = f"{_numbers(last)} at t = {motion.time[-1]:.6g}"
    return f"Motion: from x = {_numbers(first)} to {end}{where}."


def _few(p: Array) -> str:
    shown = ", ".join(f"{v:.6g}" for v in p[:8])
    return f"{shown}, ..." if len(p) > 8 else shown


def _numbers(x: Array) -> str:
    return "[" + ", ".join(f"{float(v):.6g}" for v in x) + "]"
