"""symheli trim: attitude, flapping and controls of a steady flight."""

from __future__ import annotations

import argparse
import math
from typing import Any

from studies.commands import options
from studies.output import Output, columns

HELP = "trim at an airspeed: attitude, flapping and controls"


def configure(parser: argparse.ArgumentParser) -> None:
    """Vehicle and flight condition."""
    options.vehicle(parser)
    options.condition(parser)


def run(arguments: argparse.Namespace) -> Output:
    """Trim and show every state and input with its unit."""
    _, point = options.trimmed(arguments)
    rows = [["", "value", "unit", ""]]
    for title, vector in (("states", point.x), ("inputs", point.u)):
        rows += [
            [title],
            *(["  " + str(s), f"{v:.6g}", s.unit, _degrees(v, s.unit)] for s, v in _items(vector)),
        ]
    data = {
        "status": str(point),
        "airspeed": {"value": point.airspeed, "unit": "m/s"},
        "states": options.named(point.x),
        "inputs": options.named(point.u),
        "residual": options.named(point.residual),
        "on_stops": point.on_stops,
        "vortex_ring": point.vortex_ring,
    }
    return Output(f"{point}\n{columns(rows)}", data)


def _items(vector: Any) -> list[tuple[Any, float]]:
    return list(zip(vector.signals, vector.array.tolist(), strict=True))


def _degrees(value: float, unit: str) -> str:
    return (
        f"{math.degrees(value):.3f} {unit.replace('rad', 'deg')}"
        if unit in ("rad", "rad/s")
        else ""
    )
