"""symheli identify LOG: a model from somebody's flight, and how far it can be trusted."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from studies.commands import options
from studies.output import Output
from symheli.errors import InputError

HELP = "fit an LPV-ARX model to a flight log and judge it on data it has not seen"
XPLANE = {"outputs": ("q", "theta"), "inputs": ("stick_lon",), "scheduling": "airspeed"}
"""What is identified from an X-Plane log unless asked otherwise."""

ONE_MODEL = {"plot": "draws the fits of", "bands": "draws the coefficients of", "save": "writes"}


def configure(parser: argparse.ArgumentParser) -> None:
    """Log, signals, structure, what is done to the record."""
    add = parser.add_argument
    add("log", type=Path, metavar="LOG", help="flight log")
    add("--format", choices=("auto", "xplane", "csv", "mat"), default="auto", help="default: by extension and content")
    add("--map", type=Path, metavar="FILE", help="TOML file that says which column is which signal, in which unit (docs/identify.md)")
    add("--time", metavar="COLUMN", help="time column of a table (default: t or time)")
    add("--time-unit", choices=("s", "ms", "us", "ns"), default="s", help="unit of the time column (default: %(default)s)")
    add("--dt", type=options.positive, metavar="S", help="sample period, s: of a log without time, or to resample to")
    add(
        "--units",
        type=options.unit,
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME=UNIT",
        help="units of the columns, such as q=deg/s",
    )
    add("--outputs", type=options.names, metavar="A,B", help="signals to predict (X-Plane: q,theta)")
    add("--inputs", type=options.names, metavar="C,D", help="signals that drive them (X-Plane: stick_lon)")
    add("--scheduling", metavar="P", help="scheduling signal (X-Plane: airspeed)")
    add("--scheduling-from", type=options.names, metavar="U,V", help="schedule on the length of this vector")
    add("--smooth-scheduling", type=options.positive, metavar="S", help="causal low-pass of the scheduling signal, time constant in s")
    add("--scheduling-at", choices=("lag", "now"), default="lag", help="coefficients at p(k - lag) or p(k) (default: %(default)s)")
    add("--na", type=options.count, default=3, metavar="N", help="lags of the outputs (default: %(default)s)")
    add("--nb", type=options.count, default=3, metavar="N", help="lags of the inputs (default: %(default)s)")
    add("--delay", type=options.count, default=1, metavar="N", help="first lag of the inputs (default: %(default)s)")
    add("--degree", type=options.count, default=2, metavar="N", help="polynomial degree in p; 0: LTI only (default: %(default)s)")
    add("--orders", action="store_true", help="compare orders 1 to 4 and degrees 0 to 3 instead")
    add("--no-offset", action="store_true", help="no c(p): outputs are deviations already")
    add("--start", type=options.number, metavar="S", help="leave out what is before, s on the log's clock")
    add("--stop", type=options.number, metavar="S", help="leave out what is after")
    add("--decimate", type=options.at_least_one, default=1, metavar="N", help="means of N samples")
    add(
        "--train",
        type=options.fraction,
        default=0.7,
        metavar="SHARE",
        help="first part of the time to fit, the rest is held out (default: 0.7)",
    )
    add(
        "--plot",
        type=options.picture,
        metavar="FILE",
        help="draw measured, one step, 1 s and free run into this .png, .svg or .pdf (needs matplotlib)",
    )

    add("--bands", type=options.picture, metavar="FILE", help="draw every coefficient over the scheduling signal with its 95 %% band")
    add("--save", type=options.model_file, metavar="FILE", help="write the model: .json (Python, symheli export model) or .mat (MATLAB)")


def run(arguments: argparse.Namespace) -> Output:
    """Read, prepare, fit, judge."""
    from identification import LPVARX, Polynomial
    from studies.log import report
    from studies.log.comparison import compare, scheduling_range
    from studies.log.reading import COMBINED, format_of, read
    from symheli.lpv import FlightRecord, conditioning

    found: Any = format_of(arguments.log) if arguments.format == "auto" and not arguments.map else arguments.format
    kind = "mapped" if arguments.map else found
    outputs, inputs, scheduling = _signals(arguments, kind)
    wanted = [*outputs, *inputs, *(arguments.scheduling_from or ((scheduling,) if scheduling else ()))]
    if arguments.map:
        record = FlightRecord.from_map(arguments.log, arguments.map)
    else:
        record = read(
            arguments.log, list(dict.fromkeys(wanted)), format=found, dt=arguments.dt, time=arguments.time, units=dict(arguments.units),
            time_unit=arguments.time_unit,
        )  # fmt: skip
    samples = len(record)
    if arguments.scheduling_from:
        record, scheduling = conditioning.with_norm(record, arguments.scheduling_from, COMBINED), COMBINED
    if not scheduling:
        scheduling = "constant"
        record = record.with_signals({scheduling: "1"}, **{scheduling: np.zeros(len(record))})
    record = conditioning.cut(record.select(list(dict.fromkeys([*outputs, *inputs, scheduling]))), arguments.start, arguments.stop)
    outside = samples - len(record)
    if arguments.smooth_scheduling:
        record = conditioning.smooth(record, scheduling, arguments.smooth_scheduling)
    record = conditioning.decimate(record, arguments.decimate)
    basis = Polynomial(arguments.degree, *scheduling_range(record[scheduling], arguments.degree))
    structure = LPVARX(
        outputs, inputs, scheduling, arguments.na, arguments.nb, arguments.delay, basis,
        scheduling_at=arguments.scheduling_at, offset=not arguments.no_offset,
    )  # fmt: skip
    training, test = conditioning.split(record, arguments.train)
    if arguments.orders:
        for option in ("plot", "bands", "save"):
            if getattr(arguments, option):
                raise InputError(f"--{option} {ONE_MODEL[option]} one model; --orders compares many")
        return _orders(structure, training, test)
    result = compare(structure, training, test)
    facts = report.facts(arguments.log, kind, record, samples, outside, result)
    text, data = report.text(facts, result), report.data(facts, result)
    written = list(_write(arguments, result))
    if written:
        text, data = "\n".join([text, *(f"wrote {path}" for path in written)]), {**data, "written": written}
    return Output(text, data)


def _write(arguments: argparse.Namespace, result: Any) -> Iterator[Path]:
    """Pictures and the model, where asked for; the paths written."""
    from identification import uncertainty
    from studies.log import figure

    if arguments.plot:
        yield figure.save(figure.figure(result), arguments.plot)
    if arguments.bands:
        yield figure.save(uncertainty(result.scheduled, result.training).plot(), arguments.bands)
    if arguments.save:
        model = result.scheduled
        model = replace(model, covariance=uncertainty(model, result.training).covariance)
        yield model.save(arguments.save) if arguments.save.suffix == ".json" else model.save_mat(arguments.save)


def _orders(structure: Any, training: Any, test: Any) -> Output:
    """A table of orders and degrees, judged on the held-out part."""
    from identification import order_scan

    if test is None:
        raise InputError("--orders judges on held-out samples: let --train leave some")
    scan = order_scan(structure, training, test, horizon=max(round(1.0 / training.dt), 1))
    rows = [
        {
            "na": t.na, "degree": t.degree, "bic": t.bic, "refused": t.refused,
            "fit_percent": {"one step": t.one_step, "1 s": t.ahead, "free run": t.free_run},
        }
        for t in scan.trials
    ]  # fmt: skip
    return Output(f"held out, {scan}", {"outputs": list(structure.outputs), "trials": rows})


def _signals(arguments: argparse.Namespace, kind: str) -> tuple[tuple[str, ...], tuple[str, ...], str | None]:
    default: dict[str, Any] = XPLANE if kind == "xplane" else {}
    outputs, inputs = arguments.outputs or default.get("outputs"), arguments.inputs or default.get("inputs")
    scheduling = arguments.scheduling or default.get("scheduling")
    if not outputs or not inputs:
        raise InputError("name what is to be predicted and what drives it: --outputs q,theta --inputs d_lon")
    if arguments.scheduling and arguments.scheduling_from:
        raise InputError("give --scheduling or --scheduling-from, not both")
    if not (scheduling or arguments.scheduling_from) and arguments.degree > 0:
        raise InputError("name the scheduling signal with --scheduling or --scheduling-from, or fit an LTI model with --degree 0")
    return outputs, inputs, scheduling
