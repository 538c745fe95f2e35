"""symheli trim: attitude, flapping and controls of a steady flight."""

from __future__ import annotations

import argparse

from studies.commands import options
from studies.output import Output

HELP = "trim at an airspeed: attitude, flapping and controls"

ARGUMENTS = (
    *options.HELICOPTER,
    *options.CONDITION,
)


def run(arguments: argparse.Namespace) -> Output:
    """Trim and show every state and input with its unit."""
    _, point = options.trimmed(arguments)
    data = {
        "status": point.outcome,
        "airspeed": {"value": point.airspeed, "unit": "m/s"},
        "states": options.named(point.x),
        "inputs": options.named(point.u),
        "residual": options.named(point.residual),
        "on_stops": point.on_stops,
        "vortex_ring": point.vortex_ring,
    }
    return Output(str(point), data)
