"""symheli derivatives: stability and control derivatives along the transition."""

from __future__ import annotations

import argparse
from pathlib import Path

from studies.commands import options
from studies.commands.arguments import option
from studies.output import Output, progress

HELP = "stability and control derivatives over airspeed, X_u ... N_ped, with units"

ARGUMENTS = (
    *options.HELICOPTER,
    options.span("--airspeeds", (0.0, 15.0), 6, "airspeeds"),
    option(
        "--out", "DIR", "folder for derivatives.csv and, with matplotlib, derivatives.svg", Path
    ),
)


def run(arguments: argparse.Namespace) -> Output:
    """Sweep, tabulate, and write the requested files."""
    import numpy as np

    import symheli
    from studies.commands.table_and_figure import write

    low, high, n = arguments.airspeeds
    progress(f"trimming and linearizing {arguments.vehicle} from {low:g} to {high:g} m/s")
    table = symheli.derivatives(
        symheli.sweep(options.helicopter(arguments), np.linspace(low, high, int(n)).tolist())
    )
    written = write(arguments.out, "derivatives", table.csv(), table.plot) if arguments.out else []
    text = "\n".join([str(table), *(f"wrote {path}" for path in written)])
    data = {
        "airspeeds": table.airspeeds,
        "derivatives": {str(s): table[s] for s in table},
        "units": {str(s): s.unit for s in table},
        "written": written,
    }
    return Output(text, data)
