"""symheli tune LOG --vehicle FILE --set NAME=VALUE: what a change of an autopilot's gains does to
the margins and responses of its loops, over airspeed.
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
    from collections.abc import Sequence

    from studies.autopilot.between import Between
    from studies.autopilot.tuned import LoopAt

HELP = (
    "margins and responses of an ArduPilot helicopter's loops before and after a change of gains,"
    " over airspeed, with bands from a flight"
)

LEGEND = """\
gain (dB), phase (deg): by how much the loop broken at this control may change, the others closed,
  before it is unstable, and half the width of the band that the flight's uncertainty leaves;
  40.0: 40 dB or more; crossover: largest frequency of unit gain, rad/s"""

RESPONSES = ("bandwidth_3db", "peak", "rejection", "rejection_peak")
RESPONSE_LEGEND = """\
bandwidth (3 dB), peak: of the attitude (d_ped: the yaw rate) after its command: up to where it
  follows within -3 dB, and its largest gain; rejection, rejection peak: up to where a disturbance
  of it is attenuated by 3 dB, and by how much one is amplified at most; from 0.1 rad/s on"""

STEP = ("overshoot", "rise", "settling")
STEP_LEGEND = """\
after a step of the command: by how much it is exceeded, from 10 to 90 %, until 5 % is not left any
  more; 10.00 s: 10 s or more"""

ARGUMENTS = (
    *options.vehicle(None, "vehicle file that is calibrated from the log"),
    positional("log", "flight log of deflections and motion", type=Path, metavar="LOG"),
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
    option(
        "--prove",
        "N",
        "prove that the changed loops are stable while the airspeed moves between the first and the"
        " last of --airspeeds: the calibrated helicopter and N - 1 drawn ones, about half a minute"
        " each",
        options.at_least_one,
    ),
    option("--rate", "M/S^2", "largest |dV/dt| of --prove", options.rate, 1.0),
    option("--out", "DIR", "folder for tune.csv and, with matplotlib, tune.svg", Path),
    flag("--as-it-is", "take the vehicle file as calibrated: bands are the least"),
    option("--write", "FILE", "write the changed parameters (.param)", Path),
)


def run(arguments: argparse.Namespace) -> Output:
    """Calibrate, compute the margins before and after, and say what the change does."""
    import symheli
    from identification import calibrate
    from studies.autopilot.tuned import CONTROLS, LEAST, loop_margins
    from symheli.flight import HelicopterLoops
    from symheli.logs.parameters import read_parameters
    from symheli.lpv.tools import Actuation
    from synthesis.design.loops.loop_measures import MEASURES

    if not arguments.set:
        raise InputError("nothing is changed: give --set NAME=VALUE, such as ATC_RAT_RLL_P=0.15")
    if arguments.as_it_is:
        from_the_flight = ("draws", "start", "stop", "gust", "window", "map")
        options.refuse(arguments, from_the_flight, "on --as-it-is, which takes no calibration")
    if arguments.prove is None:
        options.refuse(arguments, ["rate"], "without --prove")
    parameters = read_parameters(arguments.parameters or arguments.log)
    change = dict(arguments.set)
    before = HelicopterLoops.from_parameters(parameters, throw=dict(arguments.throw))
    after = before.with_parameters(change)
    if arguments.vehicle is None:
        raise InputError(
            f"name the vehicle that flew {arguments.log}: symheli tune VEHICLE LOG, or --vehicle"
        )
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
    actuation = Actuation(servos, arguments.delay)
    airspeeds = [options.number(v) for v in arguments.airspeeds or ("0", "4", "8", "12")]
    both = [loop_margins(drawn, loops, airspeeds, servos=actuation) for loops in (before, after)]
    table = [
        ["V", "loop", "gain before", "after", "phase before", "after", "crossover", ""],
        ["m/s", "", "dB", "dB", "deg", "deg", "rad/s", ""],
        *(_row(old, new) for old, new in zip(*both, strict=True)),
    ]
    verdict = _verdict(both[1])
    between = None
    if arguments.prove is not None:
        from studies.autopilot.between import stable_between

        between = stable_between(
            drawn[: arguments.prove],
            after,
            min(airspeeds),
            max(airspeeds),
            arguments.rate,
            servos=actuation,
        )
    lines = [
        *_assumed(arguments),
        f"{', '.join(f'{n} {parameters.get(n, 0.0):g} -> {v:g}' for n, v in change.items())}",
        "",
        columns(table, left=2),
        "",
        LEGEND,
        "",
        _quantities(both[0], both[1], RESPONSES),
        "",
        RESPONSE_LEGEND,
        "",
        _quantities(both[0], both[1], STEP),
        "",
        STEP_LEGEND,
        "",
        verdict,
    ]
    hypotheses = _hypotheses(arguments, calibration, between)
    lines += ["", *hypotheses]
    data: dict[str, Any] = {
        "change": change,
        "controls": list(CONTROLS),
        "before": [row.as_dict() for row in both[0]],
        "after": [row.as_dict() for row in both[1]],
        "verdict": verdict,
        "hypotheses": hypotheses,
        "units": {
            "airspeed": "m/s",
            "crossover": "rad/s",
            **{name: MEASURES[name].unit for name in LEAST},
        },
    }
    if between is not None:
        data["between"] = {
            "proven": between.exact,
            "status": between.certificate.status.value,
            "rate": {"value": between.rate, "unit": "m/s^2"},
            "airspeeds": between.airspeeds.tolist(),
            "unstable_half_way": between.unstable,
            "drawn": between.drawn,
            "drawn_proven": between.proven,
        }
    if arguments.out is not None:
        from studies.autopilot.tuned_plot import csv, plot
        from studies.commands.table_and_figure import write

        data["figures"] = write(arguments.out, "tune", csv(*both), lambda: plot(*both))
        lines += ["", *(f"wrote {path}" for path in data["figures"])]
    if arguments.write is not None:
        head = ["Changed by symheli tune. Load these by hand, and only if all this is so:"]
        text = [f"# {line}" for line in (*head, *hypotheses, verdict)]
        text += [f"{name},{value:.9g}" for name, value in change.items()]
        write_text(arguments.write, "\n".join(text) + "\n")
        lines.append(f"wrote {arguments.write}")
        data["written"] = arguments.write
    return Output("\n".join(lines), data)


def _row(old: LoopAt, new: LoopAt) -> list[str]:
    cells = [one.measures.cell(name) for name in ("gain", "phase") for one in (old, new)]
    word = {True: "", False: "unstable", None: "not known"}[new.stable]
    crossover = new.measures["crossover"]
    return [f"{new.airspeed:g}", new.control, *cells, f"{crossover:.2g}", word]


def _quantities(before: list[LoopAt], after: list[LoopAt], names: Sequence[str]) -> str:
    """A table of quantities before and after the change."""
    from synthesis.design.loops.loop_measures import MEASURES

    table = [
        ["V", "loop", *(word for name in names for word in (MEASURES[name].words, "after"))],
        ["m/s", "", *(MEASURES[name].unit for name in names for _ in range(2))],
    ]
    for old, new in zip(before, after, strict=True):
        cells = [one.measures.cell(name) for name in names for one in (old, new)]
        table.append([f"{new.airspeed:g}", new.control, *cells])
    return columns(table, left=2)


def _verdict(rows: list[LoopAt]) -> str:
    unstable = sorted({row.airspeed for row in rows if row.stable is False})
    unknown = sorted({row.airspeed for row in rows if row.stable is None})
    if unstable:
        return f"After the change the loops are UNSTABLE at {_listed(unstable)} m/s: do not fly it."
    if unknown:
        return (
            f"Whether the changed loops are stable at {_listed(unknown)} m/s is not known: the"
            " flight leaves both possible."
        )

    def least(name: str) -> tuple[float, str]:
        def low(row: LoopAt) -> float:
            value, band = row.measures.banded(name)
            return value - band

        row = min(rows, key=low)
        return low(row), f"{row.control}, {row.airspeed:g} m/s"

    (gain, at), (phase, there) = least("gain"), least("phase")
    return (
        f"After the change all loops are stable; the least margins are"
        f" {gain:.1f} dB ({at}) and {phase:.0f} deg ({there})."
    )


def _assumed(arguments: argparse.Namespace) -> list[str]:
    """The deflections that are assumed, said before the numbers that rest on them."""
    from studies.autopilot.tuned import CONTROLS

    given = dict(arguments.throw)
    assumed = [u for u in CONTROLS if u not in given]
    if not assumed:
        return []
    return [
        f"ASSUMED, not measured: 45 deg at full output of {', '.join(assumed)}. Every margin below"
        f" scales with it; measure it and add --throw {' '.join(f'{u}=RAD' for u in assumed)}.",
        "",
    ]


def _listed(values: list[float]) -> str:
    return ", ".join(f"{v:g}" for v in values)


def _hypotheses(
    arguments: argparse.Namespace, calibration: Any, between: Between | None
) -> list[str]:
    """What the numbers suppose, and what is proven between the airspeeds."""
    throws = dict(arguments.throw)
    lines = [
        "Margins and responses suppose: the equations of motion of the vehicle file; ArduPilot's"
        " rate controllers, attitude gains, gyro low-pass and static notch as documented, without"
        f" input shaping and within limits; delay {arguments.delay:g} s; servos"
        f" {f'{arguments.servo:g} rad/s' if arguments.servo else 'without dynamics'}; deflection at"
        " full output"
        f" {', '.join(f'{u} {v:g} rad' for u, v in throws.items()) or '45 deg, not measured'}.",
        "They hold at the airspeeds listed; nothing is proven between them (--prove)."
        if between is None
        else f"They hold at the airspeeds listed. {between}",
    ]
    if calibration is not None and calibration.coloured:
        lines.append(
            f"The residuals of {', '.join(calibration.coloured)} are no white noise: the bands may"
            " be too narrow."
        )
    return lines
