"""Command of the checker: reads a file, prints what its numbers claim, and decides."""

import sys
from collections.abc import Mapping, Sequence
from typing import Any

from . import dwell, lagged, levels, lft, listed, periodic, rational, sets, storage
from .demands import Claim, failure
from .reading import DAMAGED, TUBE, Unreadable, opened

SETS = {"InvariantSet": sets.ellipsoid, "LowComplexitySet": sets.parallelepiped}


def claim_of(kind: str, content: Mapping[str, Any]) -> Claim:
    """Return what a file of this kind claims; raises `Unreadable` for a kind that is not known."""
    if kind in storage.KINDS:
        proof = content["proof"]
        if proof is None:
            raise Unreadable("the file holds no proof")
        rest = lagged if proof["lyapunov"]["type"] == "MemoryLyapunov" else storage
        return (lft if proof["route"] == "lft" else rest).claimed(kind, content)
    if kind in SETS:
        return SETS[kind](content)
    if kind in ("dwell time", "average dwell time"):
        return dwell.claimed(content)
    if kind == "worst-case gain":
        return levels.claimed(content)
    if kind in (listed.GROWTH, listed.GAIN):
        return listed.claimed(kind, content)
    if kind in (rational.GAIN, rational.STABILITY):
        return rational.claimed(kind, content)
    if kind in (periodic.GAIN, periodic.STABILITY):
        return periodic.claimed(kind, content)
    if kind in (TUBE, "tube"):
        raise Unreadable(
            "tubes are not decided here: their proof rests on enclosures of nonlinear equations"
            " and of their derivatives, for which this checker has no arithmetic of intervals"
        )
    raise Unreadable(f"claims of the kind {kind!r:.40} are not known")


def main(arguments: Sequence[str]) -> int:
    """Check a file and return the exit status: 0 proven, 1 not proven, 2 not known or damaged."""
    if len(arguments) != 1 or arguments[0].startswith("-"):
        print("usage: python synthesis/checker FILE", file=sys.stderr)
        return 2
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
        return 2
    except DAMAGED as error:
        print(f"not checked: the file is damaged, a value is of no use ({error})")
        return 2
    print(f"not proven: {why}" if why else "proven in exact arithmetic")
    return 1 if why else 0
