"""symheli live SOURCE: identify while the vehicle flies, and record what comes."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from studies.commands import options
from studies.commands.arguments import option, positional, several
from studies.live.sample import STICKS
from studies.output import Output, columns, progress
from symheli.errors import InputError

if TYPE_CHECKING:
    from studies.live.mavlink import MavlinkSource
    from studies.live.replay import RecordSource
    from studies.live.watch import Watch
    from studies.live.xplane import XPlaneSource

HELP = "identify while a vehicle flies: X-Plane, MAVLink, or a record that comes again"
LEGEND = """\
motion: standard deviation of the input about its mean of 2 s, as a fraction of its largest value;
  still to move: inputs that have moved too little there; all where fewer than 250 samples came"""
SCATTER = "standard error: of the scatter alone; noise of the sensors shifts the values besides"
FIT = "fit: 100 % less the error as a share of the standard deviation over the flight"
FASTEST = 1000.0
"""Samples a second, at most."""

ARGUMENTS = (
    positional(
        "source",
        "xplane[:HOST[:PORT]], mavlink[:ADDRESS] as pymavlink writes it (udpin:127.0.0.1:14550),"
        " or a CSV file with units in its header",
        metavar="SOURCE",
    ),
    option("--inputs", "A,B", "controls as the source names them", options.names, STICKS),
    several(
        "--airspeeds",
        ("LOW", "HIGH"),
        "range of the coefficients, m/s (default: 0 13); samples outside teach nothing",
        type=options.number,
        default=(0.0, 13.0),
    ),
    option("--rate", "HZ", "rows a second (default: 50, or a file's own)", options.at_least_one),
    option("--degree", "N", "of the coefficients in airspeed", options.count, 2),
    option(
        "--forgetting",
        "L",
        "factor a sample in the direction of each new regressor",
        options.fraction,
        1.0,
    ),
    option("--duration", "S", "stop after so long (default: at Ctrl-C)", options.positive),
    option("--record", "FILE", "write every sample as it comes, as CSV", Path),
    option("--speed", "X", "times its own pace, of a file", options.positive, 1.0),
    option("--save", "FILE", "write the model at the end", options.model_file),
    *options.page("the flight"),
    option(
        "--baseline",
        "VEHICLE",
        "helicopter with whose linearization --page compares control powers",
    ),
)


def run(arguments: argparse.Namespace) -> Output:
    """Watch until the source ends, --duration is over, or Ctrl-C; say what is known."""
    from studies.live.identifier import LiveIdentifier
    from studies.live.recorder import Recorder
    from studies.live.stream import Stream
    from studies.live.watch import SIGNALS, Watch

    low, high = arguments.airspeeds
    if not 0 <= low < high:
        raise InputError(f"--airspeeds: expected 0 <= LOW < HIGH, got {low:g} and {high:g}")
    if arguments.baseline is not None and arguments.page is None:
        raise InputError("--baseline is compared on the page: give --page too")
    if arguments.rate is not None and arguments.rate > FASTEST:
        raise InputError(f"--rate: expected 1 to {FASTEST:g} Hz, got {arguments.rate}")
    found = source(arguments)
    dt = 1.0 / (arguments.rate or found.rate)
    identifier = LiveIdentifier(
        arguments.inputs, low, high, dt, arguments.degree, arguments.forgetting
    )
    missing = [name for name in identifier.signals if name not in found.signals]
    if missing:
        found.close()
        raise InputError(
            f"{found.name} has no {', '.join(missing)}: --inputs names the controls,"
            f" the other signals must be there; it has {', '.join(found.signals)}"
        )
    with options.on_page(arguments.page, identifier, found, arguments.baseline) as looks:
        recorder = None
        if arguments.record is not None:
            recorder = Recorder(arguments.record, (*SIGNALS, *arguments.inputs))
        stream = Stream(identifier.signals, dt)
        watch = Watch(found, identifier, stream, recorder, looks=looks)
        progress(f"listening to {watch.source.name}; Ctrl-C ends")
        watch.run(arguments.duration or math.inf, progress)
    if not watch.received:
        raise InputError(
            f"nothing came from {watch.source.name}: check that it sends, its address and port"
        )
    data = dict(watch.data())
    lines, status = _report(watch), 0
    model = identifier.model() if arguments.save is not None else None
    if model is not None and arguments.save is not None:
        data["written"] = model.save(arguments.save)
        lines.append(f"wrote {arguments.save}")
    elif arguments.save is not None:
        status = 1
        lines.append("no model is saved: the data do not determine every coefficient")
    return Output("\n".join(lines), data, status)


def source(arguments: argparse.Namespace) -> XPlaneSource | MavlinkSource | RecordSource:
    """Return the source that is named. Raises `InputError` for one that is not known."""
    kind, _, address = arguments.source.partition(":")
    if kind == "xplane":
        from studies.live.xplane import PORT, XPlaneSource

        host, _, port = address.partition(":")
        if port and not port.isdecimal():
            raise InputError(f"expected xplane:HOST:PORT, got {arguments.source!r}")
        return XPlaneSource(host or "127.0.0.1", int(port or PORT), arguments.rate or 50)
    if kind == "mavlink":
        from studies.live.mavlink import PORT, MavlinkSource

        return MavlinkSource(address or f"udpin:127.0.0.1:{PORT}")
    path = Path(arguments.source)
    if not path.is_file():
        raise InputError(
            f"{arguments.source!r} is no file; sources are xplane, mavlink and a CSV file"
        )
    from studies.live.replay import RecordSource
    from symheli import FlightRecord

    found = RecordSource(FlightRecord.from_csv(path), path.name, arguments.speed)
    if arguments.rate is not None and arguments.rate > 1.001 * found.rate:
        raise InputError(f"{path} has {found.rate:.4g} samples a second: leave --rate out")
    return found


def _report(watch: Watch) -> list[str]:
    """Return what came, what is covered, and what is known, for a reader."""
    from studies.live.identifier import BIN

    found = watch.identifier
    counts = ", ".join(f"{state.name} {n}" for state, n in watch.stream.counts.items())
    table = [
        ["airspeed, m/s", "samples", *(f"motion of {u}" for u in found.inputs), "still to move"]
    ]
    for cell in found.coverage():
        motion = [f"{cell.motion[u] / max(found.largest[u], 1e-9):.2f}" for u in found.inputs]
        left = cell.missing(found.largest)
        missing = "all" if len(left) == len(found.inputs) else ", ".join(left)
        table.append([f"{cell.low:g} to {cell.low + BIN:g}", f"{cell.samples}", *motion, missing])
    powers = [["control power", "airspeed, m/s", "value", "standard error", "unit"]]
    for p in found.control_powers([cell.low for cell in found.coverage()][1::3]):
        numbers = [f"{p.airspeed:g}", f"{p.value:.4g}", f"{p.error:.2g}"]
        powers.append([f"{p.output} by {p.control}", *numbers, p.unit])
    lines = [
        f"{watch.received} samples from {watch.source.name}: {counts}",
        f"{found.learnt} rows of {1 / found.dt:.4g} a second were learnt;"
        f" {found.outside} were outside the range of airspeeds",
        *watch.problems(),
        "",
        columns(table),
        LEGEND,
        "",
        columns(powers) if len(powers) > 1 else "no model yet: not every coefficient is determined",
        *([SCATTER] if len(powers) > 1 else []),
    ]
    if watch.prediction is not None:
        fits = ", ".join(f"{y} {fit:.0f}" for y, fit in watch.prediction.fit.items())
        lines += ["", f"1 s prediction over the last seconds, fit in %: {fits}", FIT]
    lines += ["", found.next_to_fly()]
    if watch.recorder is not None:
        lines.append(f"wrote {watch.recorder.path}")
    return lines
