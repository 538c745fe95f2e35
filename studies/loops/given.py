"""Margins of the loops around any model over a parameter, each broken at its input."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import synthesis
from symheli import LinearFamily, LPVStateSpace
from synthesis.design.loops.margins import Margins

Loop = Mapping[tuple[str, str], float] | LPVStateSpace
"""Feedback gains {(input, output): gain}, or a controller over the parameter."""


@dataclass(frozen=True)
class BrokenAt:
    """The margins at one value of the parameter, by the input where the loop is broken."""

    p: float
    margins: Mapping[str, Margins]


def over_parameter(
    model: LPVStateSpace | LinearFamily, loop: Loop, values: Sequence[float]
) -> Iterator[BrokenAt]:
    """One entry a value, the model and the controller held there; the other loops stay closed. Of a
    family each of its models.
    """
    named = loop.outputs if isinstance(loop, LPVStateSpace) else [u for u, _ in loop]
    tables = {
        str(u): synthesis.margin_table(model, loop, str(u), values) for u in dict.fromkeys(named)
    }
    for k, p in enumerate(values):
        yield BrokenAt(p, {u: table.rows[k][1] for u, table in tables.items()})
