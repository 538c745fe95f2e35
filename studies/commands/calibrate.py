"""symheli calibrate VEHICLE LOG...: physical parameters of a vehicle file from flights."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from studies.commands import options
from studies.commands.arguments import option, positional
from studies.output import Output

if TYPE_CHECKING:
    from symheli import FlightRecord

HELP = (
    "calibrate the physical parameters of a vehicle file from flights; what the flights do not tell"
    " stays as it was"
)

OUTPUTS = ("u", "v", "w", "p", "q", "r", "phi", "theta", "Om")

ARGUMENTS = (
    *options.vehicle(None, "packaged vehicle, or a vehicle file", in_place=False),
    positional(
        "logs",
        "the vehicle, where --vehicle does not name it, and flight logs with d_lon, d_lat, d_col,"
        " d_ped (deflections) and any of"
        f" {', '.join(OUTPUTS)}",
        type=Path,
        nargs="+",
        metavar="VEHICLE LOG",
    ),
    option(
        "--map",
        "FILE",
        "TOML file that says which column is which signal, in which unit (docs/identify.md)",
        Path,
    ),
    option(
        "--governor", ("ideal", "pi"), "rotor speed held exactly, or by a governor", default="ideal"
    ),
    option("--altitude", "M", "of the flights above sea level, m", options.number, 0.0),
    option("--parameters", "A,B", "parameters that are free (default: all)", options.names),
    option("--window", "S", "length over which the equations run free, s", options.positive, 3.0),
    option(
        "--gust",
        "M/S",
        "standard deviation of a wind that is estimated in each window (default: still air)",
        options.number,
        0.0,
    ),
    option(
        "--servo",
        "RAD/S",
        "bandwidth of the servos, to 30 %%: the log holds commands, not deflections",
        options.positive,
    ),
    option(
        "--delay",
        "S",
        "from command to servo, to 20 ms, with --servo (default: 0.02)",
        options.number,
        0.02,
    ),
    option("--start", "S", "drop samples before this time, s on the log's clock", options.number),
    option("--stop", "S", "drop samples after this time, s", options.number),
    option("--write", "FILE", "write the calibrated vehicle file (.toml)", Path),
)


def run(arguments: argparse.Namespace) -> Output:
    """Calibrate, and show every free parameter before and after."""
    import symheli
    from identification import Actuators, calibrate
    from symheli.errors import InputError

    if arguments.write is not None and arguments.write.suffix != ".toml":
        raise InputError(f"--write: expected a file that ends in .toml, got {arguments.write}")
    if arguments.servo is None:
        options.refuse(arguments, ["delay"], "without --servo")
    if arguments.vehicle is None:
        arguments.vehicle = str(arguments.logs.pop(0))
    if not arguments.logs:
        raise InputError(
            f"{arguments.vehicle} is taken as the vehicle, and there is no log: symheli calibrate"
            " VEHICLE LOG..."
        )
    heli = symheli.Helicopter.load(arguments.vehicle, governor=arguments.governor)
    heli = heli.at_altitude(arguments.altitude) if arguments.altitude else heli
    records = [record_of(arguments, log) for log in arguments.logs]
    actuators = None
    if arguments.servo:
        servo = symheli.Servo(natural_frequency=arguments.servo, damping=0.7)
        actuators = Actuators(
            dict.fromkeys(map(str, heli.inputs), servo),
            delay=arguments.delay,
            bandwidth_deviation=0.3,
            delay_deviation=0.02,
        )
    found = calibrate(
        heli,
        records,
        arguments.parameters,
        window=arguments.window,
        gust=arguments.gust,
        actuators=actuators,
    )
    text = str(found)
    data = {
        "vehicle": heli.vehicle.title,
        "converged": found.converged,
        "windows": found.windows,
        "window": {"value": found.window, "unit": "s"},
        "parameters": {
            str(p): {
                "before": heli.parameters[p],
                "value": float(found.values[i]),
                "deviation": float(found.deviations[i]),
                "unit": p.unit,
                "determined": bool(found.determined[i]),
                "only_together_with": found.tied.get(str(p)),
            }
            for i, p in enumerate(found.parameters)
        },
        "actuators": {
            name: {"value": value, "deviation": deviation}
            for name, (value, deviation) in found.actuators.items()
        },
        "residuals": {
            name: {"deviation": sd, "correlation": found.whiteness[name]}
            for name, sd in found.noise.items()
        },
    }
    if arguments.write is not None:
        text = f"{text}\nwrote {found.save(arguments.write)}"
        data["written"] = arguments.write
    return Output(text, data)


def record_of(arguments: argparse.Namespace, log: Path) -> FlightRecord:
    """The inputs and outputs of a log between --start and --stop."""
    from studies.log.reading import read
    from symheli import FlightRecord
    from symheli.logs.format import contents_of, format_of
    from symheli.values.kinematics import INPUTS

    if arguments.map is not None:
        record = FlightRecord.from_map(log, arguments.map)
    else:
        kind = format_of(log)
        there = contents_of(log, kind).columns
        wanted = [*map(str, INPUTS), *(name for name in OUTPUTS if name in there)]
        record = read(log, wanted, format=kind, dt=None, time=None, units={})
    return record.between(arguments.start, arguments.stop)
