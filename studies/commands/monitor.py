"""Options of `symheli export monitor`: which hypotheses are watched on board."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from studies.commands import options
from studies.commands.arguments import group, option
from symheli.errors import InputError

if TYPE_CHECKING:
    from symheli import Scheduling

ARGUMENTS = (
    group(
        "monitor",
        "C code that says at each sample whether the hypotheses of a certificate are met by the"
        " controller of --model",
        option(
            "--certificate",
            "FILE",
            "whose range and rate are watched (default: those of the controller); verified first",
            Path,
        ),
        option(
            "--reading-error",
            "E",
            "peak-to-peak error of the measured parameter, in its unit (default: 0)",
            options.number,
            0.0,
        ),
        option(
            "--rate-window",
            "S",
            "length of the window over which the rate is judged, s (default: 0.2)",
            options.number,
            0.2,
        ),
        option(
            "--jitter",
            "F",
            "fraction by which a sample period may be off (default: 0.05)",
            options.number,
            0.05,
        ),
    ),
)


def write(arguments: argparse.Namespace, file: Path) -> tuple[Path, ...]:
    """Write the monitor of the controller in `file` into the folder --out (default: monitor)."""
    from symheli.export import write_monitor
    from symheli.flight import HypothesisMonitor, TableController

    table = TableController.load(file)
    proven = None
    if arguments.certificate is not None:
        proven = _proven(arguments.certificate, table.dt)
    monitor = HypothesisMonitor.of(
        table,
        proven,
        noise=arguments.reading_error,
        window=arguments.rate_window,
        jitter=arguments.jitter,
    )
    return write_monitor(monitor, arguments.out or Path("monitor"))


def _proven(file: Path, dt: float) -> Scheduling:
    """Range and rate of the one parameter of a certificate, which must verify and be about a loop
    of this sample period.
    """
    from dataclasses import replace

    from synthesis import Certificate

    found = Certificate.load(file)
    if not found.verified or found.proof is None:
        raise InputError(f"{file}: not proven: {found.why}")
    evidence = found.proof.evidence
    period = getattr(evidence.matrices, "dt", None)
    if period is not None and period != dt:
        raise InputError(
            f"{file}: proven for a sample period of {period:g} s, and the controller has {dt:g} s"
        )
    if len(evidence.parameters) != 1:
        raise InputError(
            f"{file}: it has {len(evidence.parameters)} parameters, and a table controller has one"
        )
    return replace(evidence.parameters[0], rate=found.rates[0])
