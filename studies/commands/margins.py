"""Command symheli margins: stability margins of the roll hold, and the attitude bandwidths, over
airspeed.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from studies.commands import given_model, options
from studies.commands.arguments import option, several
from studies.output import Output, columns, progress
from symheli.errors import InputError

if TYPE_CHECKING:
    from studies.loops.margins import AtAirspeed
    from symheli import LinearFamily, LPVStateSpace
    from symheli.values import Signal
    from synthesis.design.loops.loop_measures import LoopMeasures
    from synthesis.design.loops.margin_table import MarginTable
    from synthesis.design.loops.margins import Margins

    Loop = dict[tuple[str, str], float] | LPVStateSpace
    """Feedback gains {(input, output): gain}, or a controller over the parameter."""

HELP = "gain, phase, delay and disk margins and attitude bandwidths over airspeed"
MARGINS = ("gain", "phase", "delay", "disk_gain", "disk_phase")
HEADS = ("gain", "phase", "delay", "disk", "disk")
RESPONSE = ("roll BW", "lag", "pitch BW"), ("rad/s", "ms", "rad/s")
LEGEND = """\
gain, phase, delay: by how much the loop gain may change in either direction, how much lag and how
  much more delay the loop bears, each alone, before it is unstable; 40.0: 40 dB or more
disk: by how much gain and phase may change together, at any frequency"""
VEHICLE_LEGEND = """\
roll BW, pitch BW: ADS-33 bandwidth, up to which the attitude follows the stick with 45 deg of phase
  and 6 dB of gain in reserve; lag: phase delay of the roll above it
gap: nu-gap of the two lateral models, 0 to 1: a controller whose margin b is larger holds both"""

ARGUMENTS = (
    *options.HELICOPTER,
    several(
        "--airspeeds",
        ("LOW", "HIGH"),
        "range, m/s (default: 0 13; of --model its own)",
        type=options.number,
    ),
    option("--points", "N", "airspeeds", options.at_least_one, 14),
    option(
        "--controller",
        "FILE",
        "table of TableController.save or symheli synthesize around --model, in place of"
        " --feedback; of a vehicle see symheli specs --controller",
        Path,
    ),
    *given_model.WITHOUT_CHANNELS,
)


def run(arguments: argparse.Namespace) -> Output:
    """The exact models of a vehicle beside their element-wise interpolation, or the loops around a
    model from a file.
    """
    return _of_model(arguments) if arguments.model else _of_vehicle(arguments)


def _of_model(arguments: argparse.Namespace) -> Output:
    import numpy as np

    from symheli.values import Signal

    options.refuse(arguments, options.OF_A_VEHICLE, "on a model from a file, --model")
    loop, said = _loop(arguments)
    lpv = given_model.lpv_model(arguments)
    s = lpv.scheduling
    low, high = arguments.airspeeds or (s.low, s.high)
    values = np.linspace(low, high, arguments.points).tolist()
    return _of_loop(lpv, loop, values, Signal(s.name, s.unit), f"{arguments.model}, {said}")


def _loop(arguments: argparse.Namespace) -> tuple[Loop, str]:
    """The gains of --feedback or the table of --controller, and what they are in words."""
    gains = dict(arguments.feedback)
    if bool(gains) == (arguments.controller is not None):
        raise InputError(
            "give the loop to analyse, as --feedback d_lat=phi:-0.02 or as --controller FILE"
        )
    if gains:
        return gains, given_model.words(gains)
    from symheli import TableController

    return TableController.load(arguments.controller).model, str(arguments.controller)


def _of_loop(
    model: LPVStateSpace | LinearFamily, loop: Loop, values: list[float], s: Signal, what: str
) -> Output:
    """The margins of a loop at values of the parameter `s`, as a table."""
    import synthesis
    from synthesis.design.loops.loop_measures import MEASURES, LoopMeasures

    broken = [u for u, _ in loop] if isinstance(loop, dict) else loop.outputs
    tables: dict[str, MarginTable] = {
        str(u): synthesis.margin_table(model, loop, str(u), values) for u in dict.fromkeys(broken)
    }
    rows = {u: [found for _, found in table.rows] for u, table in tables.items()}
    head = f"{what}: the loop broken at each input"
    table = [
        ["", *(cell for u in rows for cell in (u, *[""] * (len(MARGINS) - 1)))],
        [f"{s}, {s.unit}", *HEADS * len(rows)],
        ["", *(MEASURES[name].unit for _ in rows for name in MARGINS)],
        *(
            [f"{p:.4g}", *(cell for own in found for cell in _cells(LoopMeasures.of(own)))]
            for p, *found in zip(values, *rows.values(), strict=True)
        ),
    ]
    lines = [head, "", columns(table, left=0), "", LEGEND]
    data = {
        "loop": head,
        "parameter": str(s),
        "values": values,
        "margins": {u: [_margin_entry(found) for found in own] for u, own in rows.items()},
        "units": {"parameter": s.unit, "phase": "rad", "delay": "s"},
    }
    return Output("\n".join(lines), data)


def _of_vehicle(arguments: argparse.Namespace) -> Output:
    import numpy as np

    import symheli
    from identification import compare_frozen
    from studies.loops.lateral import HOLD
    from studies.loops.margins import ACTUATION, over_airspeed
    from studies.setup.axes import LATERAL, LONGITUDINAL
    from synthesis.design.loops.loop_measures import MEASURES

    given_model.only_with_a_model(arguments)
    if arguments.controller:
        raise InputError(
            "--controller goes with --model FILE; of a vehicle, with its servos and delay:"
            f" symheli specs {arguments.vehicle} --controller {arguments.controller}"
        )
    low, high = arguments.airspeeds or (0.0, 13.0)
    gains = dict(arguments.feedback)
    if gains:
        options.refuse(arguments, ["degree"], "on the exact models, whose loop --feedback closes")
    if not (0 <= low < high) or (not gains and arguments.points <= arguments.degree):
        raise InputError(
            "expected 0 <= LOW < HIGH and more points than the degree of the interpolation"
        )
    progress(f"trimming and linearizing {arguments.vehicle} from {low:g} to {high:g} m/s")
    family = symheli.sweep(options.helicopter(arguments), np.linspace(low, high, arguments.points))  # type: ignore[arg-type]
    if gains:
        what = f"{arguments.vehicle} without servos and delay, {given_model.words(gains)}"
        speeds = [float(v) for v in family.airspeeds]
        return _of_loop(family, gains, speeds, family.axes[0], what)
    parts = [family.select(axis.states, axis.inputs) for axis in (LATERAL, LONGITUDINAL)]
    fitted = [part.interpolate("polynomial", arguments.degree) for part in parts]
    speeds = [float(v) for v in family.airspeeds]
    tables = {
        "exact": list(
            over_airspeed(speeds, *([part[k] for k in range(len(part))] for part in parts))
        ),
        "interpolated": list(
            over_airspeed(speeds, *([model.at(v) for v in speeds] for model in fitted))
        ),
    }
    beside = compare_frozen(
        {"interpolated": fitted[0]},
        {v: parts[0][k].discretize(0.02) for k, v in enumerate(speeds)},
        scales=dict.fromkeys(LATERAL.inputs, 0.01) | dict.fromkeys(("p", "r", "phi"), 0.1),
        outputs=("p", "r", "phi"),
    )
    gaps = beside["interpolated"].gap.tolist()
    head = (
        f"{arguments.vehicle}, roll hold d_lat = {HOLD:g} phi with servo and"
        f" {1000 * ACTUATION.delay:g} ms delay; roll (held) and pitch (free) response to the stick;"
        " gap: nu-gap at 50 Hz of exact and interpolated lateral model (input / 0.01 rad, output /"
        " 0.1 SI)"
    )
    width = len(MARGINS) + len(RESPONSE[0]) - 1
    units = (*(MEASURES[name].unit for name in MARGINS), *RESPONSE[1])
    table = [
        ["", *(cell for name in tables for cell in (name, *[""] * width)), ""],
        ["V, m/s", *(*HEADS, *RESPONSE[0]) * 2, "gap"],
        ["", *units * 2, ""],
        *(
            [f"{exact.airspeed:.2f}", *_row(exact), *_row(near), f"{gap:.3f}"]
            for exact, near, gap in zip(*tables.values(), gaps, strict=True)
        ),
    ]
    lines = [head, "", columns(table, left=0), "", LEGEND, VEHICLE_LEGEND]
    data = {
        "loop": head,
        "nu_gap": gaps,
        **{name: [_entry(row) for row in rows] for name, rows in tables.items()},
    }
    return Output("\n".join(lines), data)


def _row(row: AtAirspeed) -> list[str]:
    roll, pitch = row.held, row.free
    response = (roll.cell("bandwidth_ads33"), roll.cell("phase_delay"))
    return [*_cells(roll), *response, pitch.cell("bandwidth_ads33")]


def _cells(measures: LoopMeasures) -> list[str]:
    if not measures.stable:
        return [measures.cell("gain"), *[""] * (len(MARGINS) - 1)]
    return [measures.cell(name) for name in MARGINS]


def _margin_entry(hold: Margins) -> dict[str, object]:
    return {
        "stable": hold.stable,
        "gain": hold.gain,
        "phase": hold.phase,
        "delay": hold.delay,
        "disk": hold.disk,
        "disk_gain": hold.disk_gain,
        "disk_phase": hold.disk_phase,
    }


def _entry(row: AtAirspeed) -> dict[str, object]:
    unit = {"phase": "rad", "delay": "s", "bandwidth": "rad/s", "phase_delay": "s"}
    return {
        "airspeed": row.airspeed,
        **_margin_entry(row.hold),
        "roll_bandwidth": row.roll.rate_response,
        "roll_phase_delay": row.roll.phase_delay,
        "pitch_bandwidth": row.pitch.rate_response,
        "units": unit,
    }
