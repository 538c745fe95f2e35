"""Sentences of a statement, made from its numbers: the claim, and the conditions it holds under."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from symheli import Scheduling
from synthesis.certify.statement.kind import Kind


def claim(kind: Kind, bound: float) -> str:
    """The claim of a kind with this bound."""
    number = "" if math.isnan(bound) else f" {bound:.9g}"
    unit = f" {kind.facets.unit}" if kind.facets.unit == "1/s" else ""
    return f"{kind}{number}{unit}: {kind.facets.meaning}, for every p(t) within its range and rate"


def conditions(evidence: Any, rates: Sequence[float]) -> tuple[str, ...]:
    """The conditions of a claim about the model of some evidence: its size and time, how its
    parameters move, and the perturbations that it covers.
    """
    model = evidence.matrices
    u, y = (", ".join(map(str, names)) or "none" for names in (model.inputs, model.outputs))
    dt = getattr(model, "dt", None)
    time = "in continuous time" if dt is None else f"sampled every {dt!r} s"
    n = len(model.states)
    what = f"the model in the file, {n} state{'s' * (n != 1)}, {time}: inputs {u}; outputs {y}"
    moving = (motion(s, r) for s, r in zip(evidence.parameters, rates, strict=True))
    block = getattr(evidence, "block", None)
    return (what, *moving, *(() if block is None else (block.sentence,)))


def motion(s: Scheduling, rate: float) -> str:
    """The range and the rate of one parameter."""
    unit = "" if s.unit == "1" else f" {s.unit}"
    if isinstance(s.rate, str):
        return (
            f"{s.name} is in [{s.low:g}, {s.high:g}]{unit}, d{s.name}/dt is {s.rate}, which keeps"
            f" to what lets {s.name} stay in that range"
        )
    speed = (
        "arbitrarily fast"
        if math.isinf(rate)
        else "constant"
        if rate == 0
        else f"|d{s.name}/dt| <= {rate:g}{unit} per second"
    )
    return f"{s.name} is exogenous, in [{s.low:g}, {s.high:g}]{unit}, {speed}"
