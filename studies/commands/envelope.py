"""symheli envelope: trims over airspeed and climb rate."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.commands import options
from studies.commands.arguments import option
from studies.output import Output, columns, progress

if TYPE_CHECKING:
    from symheli.steady.trim_map import TrimMap

HELP = "trims over airspeed and climb rate: what holds, what can be flown, where the vortex ring is"
KEY = (
    "letters: . trimmed and attainable, s needs a control at or beyond its stop, v vortex ring (no"
    " accuracy promised), x no trim"
)

ARGUMENTS = (
    *options.HELICOPTER,
    options.span("--airspeeds", (0.0, 20.0), 21, "airspeeds of the whole motion"),
    options.span("--climb-rates", (-10.0, 10.0), 21, "climb rates, up"),
    option("--out", "DIR", "folder for trim_map.csv and, with matplotlib, trim_map.svg", Path),
)


def run(arguments: argparse.Namespace) -> Output:
    """Trim the grid, show it as letters, and write the requested files."""
    import numpy as np

    import symheli
    from studies.commands.table_and_figure import write

    speeds, rates = (
        np.linspace(low, high, int(n))
        for low, high, n in (arguments.airspeeds, arguments.climb_rates)
    )
    progress(
        f"trimming {arguments.vehicle} at {len(speeds)} airspeeds and {len(rates)} climb rates"
    )
    found = symheli.trim_map(options.helicopter(arguments), speeds, rates)
    written = write(arguments.out, "trim_map", found.csv(), found.plot) if arguments.out else []
    text = "\n".join([_picture(found), *_numbers(found), *(f"wrote {path}" for path in written)])
    return Output(text, {**_data(found), "written": written})


def _picture(found: TrimMap) -> str:
    rows = [["climb m/s", *(f"{v:.3g}" for v in found.airspeeds), "airspeed m/s"]]
    for j in reversed(range(len(found.climb_rates))):
        rows.append(
            [
                f"{found.climb_rates[j]:.3g}",
                *(_letter(found, i, j) for i in range(len(found.airspeeds))),
            ]
        )
    return f"{columns(rows, left=0)}\n{KEY}; blank: the climb rate exceeds the airspeed"


def _letter(found: TrimMap, i: int, j: int) -> str:
    if not found.possible[i, j]:
        return ""
    if not found.success[i, j]:
        return "x"
    if found.vortex_ring[i, j]:
        return "v"
    return "." if found.attainable[i, j] else "s"


def _numbers(found: TrimMap) -> list[str]:
    """Least power, and how many points hold."""
    import numpy as np

    held = found.attainable & ~found.vortex_ring
    lines = [
        f"{found.success.sum()} of {found.possible.sum()} points trim, {found.attainable.sum()}"
        f" within the travel of the controls, {(found.vortex_ring & found.success).sum()} in a"
        " vortex ring"
    ]
    level = int(np.abs(found.climb_rates).argmin())
    if held[:, level].any():
        power = np.where(held[:, level], found["power"][:, level], np.inf)
        best = int(power.argmin())
        rate = found.climb_rates[level]
        lines.append(
            f"least power at climb rate {rate:g} m/s: {power[best]:.0f} W at"
            f" {found.airspeeds[best]:.3g} m/s"
        )
    return lines


def _data(found: TrimMap) -> dict[str, Any]:
    return {
        "airspeeds": found.airspeeds,
        "climb_rates": found.climb_rates,
        "units": {str(s): s.unit for s in found.signals},
        "values": {str(s): found[s] for s in found.signals},
        "possible": found.possible,
        "success": found.success,
        "attainable": found.attainable,
        "vortex_ring": found.vortex_ring,
    }
