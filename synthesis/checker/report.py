"""Command of the checker: reads a file, prints what its numbers claim, and decides."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Any

from . import dwell, lagged, lft, sets, storage
from .demands import Claim, failure
from .reading import DAMAGED, TUBE, Unreadable, opened

PROVEN, NOT_PROVEN, UNKNOWN = 0, 1, 2


def claim_of(kind: str, content: Mapping[str, Any]) -> Claim:
    """Return what a file of this kind claims; raises `Unreadable` for a kind that is not known."""
    if kind in storage.KINDS:
        proof = content["proof"]
        if proof is None:
            raise Unreadable("the file holds no proof")
        if proof["route"] == "lft":
            return lft.claimed(kind, content)
        of_lag = proof["lyapunov"]["type"] == "MemoryLyapunov"
        return (lagged if of_lag else storage).claimed(kind, content)
    if kind in sets.KINDS:
        return sets.claimed(kind, content)
    if kind == dwell.KIND:
        return dwell.claimed(kind, content)
    if kind == TUBE:
        raise Unreadable(
            "tubes are not decided here: their proof rests on enclosures of the nonlinear equations"
            " and of their derivatives, for which this checker has no arithmetic of intervals"
        )
    raise Unreadable(f"claims of the kind {kind!r:.40} are not known")


def main(arguments: Sequence[str]) -> int:
    """Check a file and return the exit status."""
    if len(arguments) != 1 or arguments[0].startswith("-"):
        print("usage: python synthesis/checker FILE", file=sys.stderr)
        return UNKNOWN
    try:
        kind, content = opened(arguments[0])
        claim = claim_of(kind, content)
        print(f"claim: {claim.claim}")
        for sentence in claim.hypotheses:
            print(f"  for {sentence}")
        sys.stdout.flush()
        why = failure(claim)
    except Unreadable as error:
        print(f"not checked: {error}")
        return UNKNOWN
    except DAMAGED as error:
        print(f"not checked: the file is damaged, a value is of no use ({error})")
        return UNKNOWN
    print(f"not proven: {why}" if why else "proven in exact arithmetic")
    return NOT_PROVEN if why else PROVEN
