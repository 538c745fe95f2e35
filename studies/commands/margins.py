"""symheli margins: how far the roll hold is from instability, and the attitude bandwidths, over
airspeed.
"""

from __future__ import annotations

import argparse
import math

from studies.commands import options
from studies.output import Output, progress

HELP = "gain, phase, delay and disk margins and attitude bandwidths over airspeed"


def configure(parser: argparse.ArgumentParser) -> None:
    """Vehicle, range and number of airspeeds."""
    options.vehicle(parser)
    parser.add_argument(
        "--airspeeds",
        type=options.number,
        nargs=2,
        default=(0.0, 13.0),
        metavar=("LOW", "HIGH"),
        help="range, m/s (default: 0 13)",
    )
    parser.add_argument(
        "--points",
        type=options.at_least_one,
        default=14,
        metavar="N",
        help="airspeeds (default: %(default)s)",
    )
    parser.add_argument(
        "--degree",
        type=options.at_least_one,
        default=3,
        metavar="D",
        help="of the interpolation (default: %(default)s)",
    )


def run(arguments: argparse.Namespace) -> Output:
    """The exact models beside their element-wise interpolation."""
    import numpy as np

    import symheli
    from studies.loops.lateral import HOLD
    from studies.loops.margins import DELAY, LATERAL, LONGITUDINAL, over_airspeed
    from symheli.errors import InputError

    low, high = arguments.airspeeds
    if not (0 <= low < high) or arguments.points <= arguments.degree:
        raise InputError(
            "expected 0 <= LOW < HIGH and more points than the degree of the interpolation"
        )
    progress(f"trimming and linearizing {arguments.vehicle} from {low:g} to {high:g} m/s")
    family = symheli.sweep(options.helicopter(arguments), np.linspace(low, high, arguments.points))  # type: ignore[arg-type]
    parts = [family.select(*axis) for axis in (LATERAL, LONGITUDINAL)]
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
    gaps = [_gap(parts[0][k], fitted[0].at(v)) for k, v in enumerate(speeds)]
    head = (
        f"{arguments.vehicle}, roll hold d_lat = {HOLD:g} phi with servo and {1000 * DELAY:g} ms"
        " delay; roll (held) and pitch (free) response to the stick; gap: nu-gap at 50 Hz of exact"
        " and interpolated lateral model (input / 0.01 rad, output / 0.1 SI)"
    )
    lines = [head, "", f"{'':34s}exact{'':47s}interpolated"]
    columns = (
        f"{'gain':>7s}{'phase':>7s}{'delay':>8s}{'disk':>6s}{'roll BW':>9s}{'lag':>7s}"
        f"{'pitch BW':>10s}"
    )
    units = f"{'x':>7s}{'deg':>7s}{'ms':>8s}{'':>6s}{'rad/s':>9s}{'ms':>7s}{'rad/s':>10s}"
    lines += [f"{'V, m/s':>7s}{columns}  {columns}{'gap':>7s}", f"{'':7s}{units}  {units}"]
    for exact, near, gap in zip(tables["exact"], tables["interpolated"], gaps, strict=True):
        lines.append(f"{exact.airspeed:7.2f}{_row(exact)}  {_row(near)}{gap:7.3f}")
    data = {
        "loop": head,
        "nu_gap": gaps,
        **{name: [_entry(row) for row in rows] for name, rows in tables.items()},
    }
    return Output("\n".join(lines), data)


def _gap(exact, near) -> float:
    from symheli.lpv import nu_gap

    outputs = ("p", "r", "phi")
    first, second = (model.select(outputs=outputs).discretize(0.02) for model in (exact, near))
    return nu_gap(first, second, input_scale=0.01, output_scale=0.1)


def _row(row) -> str:
    hold, roll, pitch = row.hold, row.roll, row.pitch
    return (
        f"{hold.gain[1]:7.2f}{math.degrees(hold.phase):7.1f}{1000 * hold.delay:8.0f}"
        f"{hold.disk:6.2f}{roll.rate_response:9.2f}{1000 * roll.phase_delay:7.0f}"
        f"{pitch.rate_response:10.2f}"
    )


def _entry(row) -> dict[str, object]:
    hold, unit = row.hold, {"phase": "rad", "delay": "s", "bandwidth": "rad/s", "phase_delay": "s"}
    return {
        "airspeed": row.airspeed,
        "stable": hold.stable,
        "gain": hold.gain,
        "phase": hold.phase,
        "delay": hold.delay,
        "disk": hold.disk,
        "disk_gain": hold.disk_gain,
        "disk_phase": hold.disk_phase,
        "roll_bandwidth": row.roll.rate_response,
        "roll_phase_delay": row.roll.phase_delay,
        "pitch_bandwidth": row.pitch.rate_response,
        "units": unit,
    }
