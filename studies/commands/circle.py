"""symheli circle: identify, design, certify and take the controls while a helicopter flies."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from studies.commands import options
from studies.commands.arguments import flag, option
from studies.output import Output, progress
from symheli.errors import InputError, SymheliError

if TYPE_CHECKING:
    from studies.circle.circle import Circle
    from studies.live.watch import Watch

HELP = "close the loop live: a simulated helicopter is identified, controlled and identified anew"

ARGUMENTS = (
    option("--vehicle", "NAME", "packaged airframe or TOML file", str, "xcell60"),
    option("--duration", "S", "of the flight", options.positive, 600.0),
    option("--speed", "X", "times real time", options.positive, 1.0),
    option("--seed", "N", "of excitation and noise", options.count, 0),
    option("--heavier", "X", "times the mass after --change", options.positive, 1.15),
    option("--change", "S", "when the mass changes (default: never)", options.positive),
    flag("--quiet-sensors", "no noise of its sensors"),
    *options.page("the flight"),
    option("--out", "DIR", "folder of record, models, controllers and certificates", Path),
)


def run(arguments: argparse.Namespace) -> Output:
    """Fly until --duration or Ctrl-C; status 1 where no controller took the controls."""
    from studies.circle.circle import Circle
    from studies.circle.vehicle import PERIOD, Vehicle, VehicleProcess
    from studies.live.identifier import LiveIdentifier
    from studies.live.recorder import Recorder
    from studies.live.sample import STICKS
    from studies.live.stream import Stream
    from studies.live.watch import SIGNALS, Watch
    from studies.live.xplane import XPlaneSource
    from studies.processes import Processes
    from studies.setup.flights import TOP

    vehicle = Vehicle(
        arguments.vehicle,
        arguments.duration,
        arguments.seed,
        not arguments.quiet_sensors,
        arguments.heavier,
        arguments.change,
    )
    plan = vehicle.plan(vehicle.helicopter)  # what cannot fly is refused here
    if arguments.change is not None and arguments.change >= plan.schedule.duration:
        raise InputError(f"--change: the flight ends at {plan.schedule.duration:.0f} s, before it")
    out = _folder(arguments.out)
    identifier = LiveIdentifier(STICKS, 0.0, TOP, PERIOD)
    recorder = None if out is None else Recorder(out / "flight.csv", (*SIGNALS, *STICKS))
    with VehicleProcess(vehicle, arguments.speed) as process, Processes(1) as workers:
        source = XPlaneSource(port=process.port)
        pilot = Circle(vehicle, source, workers, progress)
        stream = Stream(identifier.signals, PERIOD)
        seconds = plan.schedule.duration
        longest = seconds / arguments.speed + 30.0  # until a process flies
        progress(f"{vehicle.name} flies {seconds:.0f} s at {source.name}; Ctrl-C ends")
        with options.on_page(arguments.page, identifier, source, vehicle.name) as looks:
            watch = Watch(source, identifier, stream, recorder, pilot, looks=looks)
            watch.run(longest, progress, over=lambda: process.over)
        workers.end()
    if process.error is not None:
        raise SymheliError(str(process.error)) from process.error
    data = {**watch.data(), "written": [] if out is None else _written(pilot, out)}
    return Output("\n".join(_report(watch, pilot)), data, status=int(not pilot.designs))


def _folder(out: Path | None) -> Path | None:
    """Make the folder. Raises `InputError` where it has a flight already."""
    if out is None:
        return None
    if (out / "flight.csv").exists():
        raise InputError(f"{out} has a flight already: name another folder")
    out.mkdir(parents=True, exist_ok=True)
    return out


def _written(pilot: Circle, out: Path) -> list[Path]:
    """Write models, controllers and certificates, numbered as they flew."""
    written = []
    for k, one in enumerate(pilot.designs, 1):
        written.append(one.model.save(out / f"model-{k}.json"))
        written.append(one.table.save(out / f"controller-{k}.json"))
        written.append(one.certificate.save(out / f"certificate-{k}.json"))
    return written


def _report(watch: Watch, pilot: Circle) -> list[str]:
    """Return what happened, for a reader."""
    lines = [f"{event.time:8.1f} s  {event.what}" for event in pilot.events]
    for k, (one, switch) in enumerate(zip(pilot.designs, pilot.switches, strict=True), 1):
        seconds = ", ".join(f"{name} {s:.1f} s" for name, s in one.seconds.items())
        lines += [
            "",
            f"controller {k}: {one.table.order} states, gain {one.certificate.bound:.3g} proven of"
            f" the identified model to {one.proven.rate:g} m/s^2; model {one.verdict.verdict},"
            f" nu-gap bound {one.share:.2f} of the margin b(P, C)",
            f"largest step of a command from a sample to the next, of its travel: at the switch"
            f" {100 * switch.at:.2g} %, in the half second before {100 * switch.before:.2g} %,"
            f" after {100 * switch.after:.2g} %",
            f"made in: {seconds}",
        ]
    lines += ["", f"lamp at the end: {watch.lamp}"]
    return lines
