"""symheli serve: a helicopter in real time that speaks X-Plane's UDP and MAVLink as a vehicle."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from studies.commands import options
from studies.commands.arguments import flag, option, several
from studies.output import Output, progress
from symheli.errors import InputError

if TYPE_CHECKING:
    from studies.live.peer import Line

HELP = "fly a helicopter in real time as a vehicle for X-Plane's UDP and MAVLink"
AMPLITUDES = {"d_lon": 0.010, "d_lat": 0.008, "d_col": 0.010, "d_ped": 0.015}
"""Amplitudes of the excitation, rad: those with which a model is identified in minutes."""

PERIOD = 0.02
"""Period of the samples, s."""

ARGUMENTS = (
    *options.HELICOPTER,
    several(
        "--airspeeds",
        ("LOW", "HIGH"),
        "between which it flies to and fro, m/s (default: 0.5 12)",
        type=options.number,
        default=(0.5, 12.0),
    ),
    option("--acceleration", "A", "of the commanded airspeed, m/s^2", options.positive, 1.0),
    option("--duration", "S", "of the flight, and to the end of a leg", options.positive, 600.0),
    option("--speed", "X", "times real time", options.positive, 1.0),
    option("--xplane", "PORT", "port of X-Plane's UDP", options.count, 49000),
    option(
        "--mavlink",
        "ADDRESS",
        "send MAVLink there, as pymavlink writes it, such as udpout:127.0.0.1:14550",
    ),
    option("--excitation", "X", "times the usual amplitudes; 0: none", options.number, 1.0),
    flag("--noise", "noise of small sensors on what is sent"),
    option("--seed", "N", "of excitation and noise", options.count, 0),
)


def run(arguments: argparse.Namespace) -> Output:
    """Fly the schedule; requests and commands are served meanwhile, until its end or Ctrl-C."""
    import numpy as np

    import symheli
    from studies.circle.vehicle import NOISE
    from studies.live.peer import MavlinkLine, OnTheWire, XPlaneLine
    from symheli import AirspeedSchedule, Excitation, Sensor

    low, high = arguments.airspeeds
    if not 0 <= low < high:
        raise InputError(f"--airspeeds: expected 0 <= LOW < HIGH, got {low:g} and {high:g}")
    heli = options.helicopter(arguments)

    def flight(legs: int) -> AirspeedSchedule:
        targets = tuple(high if k % 2 == 0 else low for k in range(legs))
        return AirspeedSchedule(targets, (arguments.acceleration,) * legs, (2.0,) * legs, start=low)

    first, leg = flight(1).duration, flight(2).duration - flight(1).duration
    schedule = flight(max(math.ceil((arguments.duration - first) / leg), 0) + 1)
    inner = symheli.flight.gain_scheduled_lqr(heli, 0.0, high + 1.0, PERIOD).scheduled_controller
    samples = math.ceil(schedule.duration / inner.dt) + 1
    added = np.zeros((samples, 4))
    if arguments.excitation:
        sizes = {name: arguments.excitation * size for name, size in AMPLITUDES.items()}
        made = Excitation(sizes, "multisine", (0.05, 4.0), arguments.seed)
        signals = made(np.arange(samples) * inner.dt)
        added = np.column_stack([signals[str(u)] for u in heli.inputs])
    lines: list[Line] = [XPlaneLine(port=arguments.xplane)]
    if arguments.mavlink:
        numbers = {str(name): heli.parameters[name] for name in heli.parameters}
        lines.append(MavlinkLine(arguments.mavlink, numbers))
    wire = OnTheWire(inner, lines, heli.travel, arguments.speed, added)
    progress(
        f"{arguments.vehicle} flies for {schedule.duration:.0f} s; X-Plane's UDP on 127.0.0.1:"
        f"{lines[0].port}"  # type: ignore[attr-defined]
        + (f", MAVLink to {arguments.mavlink}" if arguments.mavlink else "")
        + "; Ctrl-C ends"
    )
    sensors = {n: Sensor(noise=sd) for n, sd in NOISE.items()} if arguments.noise else None
    ended = "the schedule is flown"
    try:
        symheli.fly(heli, schedule, controller=wire, seed=arguments.seed, sensors=sensors)
    except KeyboardInterrupt:
        ended = "interrupted"
    finally:
        for line in lines:
            line.close()
    flown = wire.samples * wire.dt
    text = f"{ended}: {flown:.1f} s flown, {wire.late} of {wire.samples} samples were late"
    return Output(text, {"flown": flown, "samples": wire.samples, "late": wire.late})
