"""Sentences of a statement: range and rate of a parameter."""

from __future__ import annotations

import math

from symheli import Scheduling


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
