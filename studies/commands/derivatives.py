"""symheli derivatives: stability and control derivatives along the transition."""

from __future__ import annotations

import argparse
from pathlib import Path

from studies.commands import options
from studies.output import Output, progress

HELP = "stability and control derivatives over airspeed, X_u ... N_ped, with units"


def configure(parser: argparse.ArgumentParser) -> None:
    """Vehicle, airspeeds, folder."""
    options.vehicle(parser)
    options.span(parser, "--airspeeds", (0.0, 15.0), 6, "airspeeds")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder for derivatives.csv and, with matplotlib, derivatives.svg",
    )


def run(arguments: argparse.Namespace) -> Output:
    """Sweep, tabulate, write where asked."""
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
