"""Sentences of a statement, made from its numbers: the claim, and the conditions it holds under."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from symheli import Scheduling
from symheli.errors import InputError
from synthesis.certify.statement.kind import Kind

MEANING: dict[Kind, str] = {
    "l2 gain": "|y|_2 < gamma |u|_2 from rest, all inputs to all outputs together",
    "energy-to-peak gain": "max_t |y(t)| < gamma |u|_2 from rest, |y| of all outputs together",
    "h2 gain": "from rest E|y(t)|^2 < gamma^2 at every t, in white noise of unit intensity",
    "decay rate": "|x(t)| <= c exp(-alpha t) |x(0)| for some c",
    "stability": "the free state decays exponentially",
}


def claim(kind: Kind, bound: float) -> str:
    """The claim of a kind with this bound; raises `InputError` for a kind without words."""
    if kind not in MEANING:
        raise InputError(f"no claim is known of the kind {kind!r}")
    number = "" if math.isnan(bound) else f" {bound:.9g}"
    unit = " 1/s" if kind == "decay rate" else ""
    return f"{kind}{number}{unit}: {MEANING[kind]}, for every p(t) within its range and rate"


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
