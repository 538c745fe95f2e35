"""Margins of the loops around any LPV model, each broken at its input, over the parameter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import synthesis
from symheli import LPVStateSpace
from synthesis.design.loops.margins import Margins


@dataclass(frozen=True)
class BrokenAt:
    """The margins at one value of the parameter, by the input where the loop is broken."""

    p: float
    margins: Mapping[str, Margins]


def over_parameter(
    lpv: LPVStateSpace, gains: Mapping[tuple[str, str], float], values: Sequence[float]
) -> Iterator[BrokenAt]:
    """One entry a value, the model held there; the other loops stay closed."""
    inputs = list(dict.fromkeys(u for u, _ in gains))
    for p in values:
        model = lpv.at(p)
        yield BrokenAt(
            p, {u: synthesis.margins(synthesis.analysis.open_loop(model, gains, u)) for u in inputs}
        )
