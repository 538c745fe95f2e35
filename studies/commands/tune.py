"""symheli tune LOG --vehicle FILE --set NAME=VALUE: what a change of an autopilot's gains does to
the margins of its loops, over airspeed.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.commands import options
from studies.commands.arguments import flag, option, positional
from studies.commands.calibrate import record_of
from studies.output import Output, columns
from symheli.errors import InputError
from symheli.values.whole_files import write_text

if TYPE_CHECKING:
    from studies.loops.tuned import LoopMargins

HELP = (
    "margins of an ArduPilot helicopter's loops before and after a change of gains, over airspeed,"
    " with bands from a flight"
)

LEGEND = """\
gain (dB), phase (deg): by how much the loop broken at this control may change, the others closed,
  before it is unstable, and half the width of the band that the flight's uncertainty leaves;
  40.0: 40 dB or more; crossover: largest frequency of unit gain, rad/s"""

ARGUMENTS = (
    positional("log", "flight log of deflections and motion", type=Path, metavar="LOG"),
    option("--vehicle", "FILE", "vehicle file that is calibrated from the log", required=True),
    option(
        "--parameters",
        "FILE",
        "autopilot's parameters: a .param file, or the DataFlash log (default: LOG)",
        Path,
    ),
    option(
        "--set",
        "NAME=VALUE",
        "parameter to change, such as ATC_RAT_RLL_P=0.15",
        options.assignment,
        [],
        nargs="+",
        action="extend",
    ),
    option(
        "--throw",
        "CONTROL=RAD",
        "deflection at full output of d_lat, d_lon or d_ped, measured (default: 45 deg)",
        options.assignment,
        [],
        nargs="+",
        action="extend",
    ),
    option("--map", "FILE", "TOML file that says which column is which signal", Path),
    option("--governor", ("ideal", "pi"), "rotor speed held exactly, or governed", default="ideal"),
    option(
        "--airspeeds", "A,B", "where margins are computed, m/s (default: 0,4,8,12)", options.names
    ),
    option("--delay", "S", "from command to servo, s", options.number, 0.0),
    option(
        "--servo",
        "RAD/S",
        "natural frequency of the servos, damping 0.7 (default: at once)",
        options.positive,
    ),
    option("--draws", "N", "helicopters drawn from the uncertainty", options.at_least_one, 20),
    option("--start", "S", "drop samples before this time, s on the log's clock", options.number),
    option("--stop", "S", "drop samples after this time, s", options.number),
    option(
        "--gust",
        "M/S",
        "standard deviation of a wind that the calibration estimates in each window (default:"
        " still air)",
        options.number,
        0.0,
    ),
    option("--window", "S", "length over which the equations run free, s", options.positive, 3.0),
    flag("--as-it-is", "take the vehicle file as calibrated: bands are the least"),
    option("--write", "FILE", "write the changed parameters (.param)", Path),
)


def run(arguments: argparse.Namespace) -> Output:
    """Calibrate, compute the margins before and after, and say what the change does."""
    import symheli
    from identification import calibrate
    from studies.loops.tuned import CONTROLS, loop_margins
    from symheli.flight import HelicopterLoops
    from symheli.logs.parameters import read_parameters

    if not arguments.set:
        raise InputError("nothing is changed: give --set NAME=VALUE, such as ATC_RAT_RLL_P=0.15")
    parameters = read_parameters(arguments.parameters or arguments.log)
    change = dict(arguments.set)
    before = HelicopterLoops.from_parameters(parameters, throw=dict(arguments.throw))
    after = before.with_parameters(change)
    heli = symheli.Helicopter.load(arguments.vehicle, governor=arguments.governor)
    drawn = [heli]
    calibration = None
    if not arguments.as_it_is:
        record = record_of(arguments, arguments.log)
        calibration = calibrate(heli, record, window=arguments.window, gust=arguments.gust)
        drawn = [calibration.heli, *calibration.draws(arguments.draws)]
    servos = None
    if arguments.servo:
        servo = symheli.Servo(natural_frequency=arguments.servo, damping=0.7)
        servos = dict.fromkeys(map(str, heli.inputs), servo)
    airspeeds = [options.number(v) for v in arguments.airspeeds or ("0", "4", "8", "12")]
    both = [
        loop_margins(drawn, loops, airspeeds, servos=servos, delay=arguments.delay)
        for loops in (before, after)
    ]
    table = [
        ["V", "loop", "gain before", "after", "phase before", "after", "crossover", ""],
        ["m/s", "", "dB", "dB", "deg", "deg", "rad/s", ""],
        *(_row(old, new) for old, new in zip(*both, strict=True)),
    ]
    verdict = _verdict(both[1])
    lines = [
        f"{', '.join(f'{n} {parameters.get(n, 0.0):g} -> {v:g}' for n, v in change.items())}",
        "",
        columns(table, left=2),
        "",
        LEGEND,
        "",
        verdict,
    ]
    hypotheses = _hypotheses(arguments, calibration)
    lines += ["", *hypotheses]
    data: dict[str, Any] = {
        "change": change,
        "controls": list(CONTROLS),
        "before": [vars(row) for row in both[0]],
        "after": [vars(row) for row in both[1]],
        "verdict": verdict,
        "hypotheses": hypotheses,
        "units": {"airspeed": "m/s", "gain": "dB", "phase": "deg", "crossover": "rad/s"},
    }
    if arguments.write is not None:
        head = ["Changed by symheli tune. Load these by hand, and only if all this is so:"]
        text = [f"# {line}" for line in (*head, *hypotheses, verdict)]
        text += [f"{name},{value:.9g}" for name, value in change.items()]
        write_text(arguments.write, "\n".join(text) + "\n")
        lines.append(f"wrote {arguments.write}")
        data["written"] = arguments.write
    return Output("\n".join(lines), data)


def _row(old: LoopMargins, new: LoopMargins) -> list[str]:
    def cells(row: LoopMargins) -> tuple[str, str]:
        if row.stable is False:
            return "unstable", "unstable"
        return f"{row.gain:.1f} +-{row.gain_band:.1f}", f"{row.phase:.0f} +-{row.phase_band:.1f}"

    (gain, phase), (gain_after, phase_after) = cells(old), cells(new)
    word = {True: "", False: "unstable", None: "not known"}[new.stable]
    return [
        f"{new.airspeed:g}",
        new.control,
        gain,
        gain_after,
        phase,
        phase_after,
        f"{new.crossover:.2g}",
        word,
    ]


def _verdict(rows: list[LoopMargins]) -> str:
    unstable = sorted({row.airspeed for row in rows if row.stable is False})
    unknown = sorted({row.airspeed for row in rows if row.stable is None})
    if unstable:
        return f"After the change the loops are UNSTABLE at {_listed(unstable)} m/s: do not fly it."
    if unknown:
        return (
            f"Whether the changed loops are stable at {_listed(unknown)} m/s is not known: the"
            " flight leaves both possible."
        )
    gain = min(rows, key=lambda row: row.gain - row.gain_band)
    phase = min(rows, key=lambda row: row.phase - row.phase_band)
    return (
        f"After the change all loops are stable; the least margins are"
        f" {gain.gain - gain.gain_band:.1f} dB ({gain.control}, {gain.airspeed:g} m/s) and"
        f" {phase.phase - phase.phase_band:.0f} deg ({phase.control}, {phase.airspeed:g} m/s)."
    )


def _listed(values: list[float]) -> str:
    return ", ".join(f"{v:g}" for v in values)


def _hypotheses(arguments: argparse.Namespace, calibration: Any) -> list[str]:
    """What the margins suppose."""
    throws = dict(arguments.throw)
    lines = [
        "Margins suppose: the equations of motion of the vehicle file; ArduPilot's rate"
        " controllers, attitude gains, gyro low-pass and static notch as documented, without input"
        " shaping and"
        f" within limits; delay {arguments.delay:g} s; servos"
        f" {f'{arguments.servo:g} rad/s' if arguments.servo else 'without dynamics'}; deflection at"
        " full output"
        f" {', '.join(f'{u} {v:g} rad' for u, v in throws.items()) or '45 deg, not measured'}.",
        "They hold at the airspeeds listed; nothing is proven between them.",
    ]
    if calibration is not None and calibration.coloured:
        lines.append(
            f"The residuals of {', '.join(calibration.coloured)} are no white noise: the bands may"
            " be too narrow."
        )
    return lines
