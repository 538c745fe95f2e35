"""symheli identify LOG: a model from somebody's flight, and how far it can be trusted."""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from studies.commands import options
from studies.commands.arguments import Listed, add, flag, option, positional
from studies.output import Output
from symheli.errors import InputError, SymheliError
from symheli.logs.format import (
    Contents,
    contents_of,
    format_named,
    format_of,
    known_formats,
    own_clocks,
)
from symheli.values.whole_files import write_text

if TYPE_CHECKING:
    from identification import LPVARX
    from identification.methods import Method
    from studies.log.suggestion import Suggestion
    from symheli.logs.segments import Segment
    from symheli.logs.signal_map import SignalMap
    from symheli.logs.survey import Survey
    from symheli.records import FlightRecord, KinematicCheck

HELP = (
    "fit an LPV-ARX model to a flight log and judge it on data it has not seen; with the log alone,"
    " say what it holds and suggest a command"
)
XPLANE = {"outputs": ("q", "theta"), "inputs": ("stick_lon",), "scheduling": "airspeed"}
"""Default signals of an X-Plane log."""

FIT_OPTIONS = (
    *("outputs", "inputs", "scheduling", "scheduling_from", "instruments", "orders", "test"),
    *("plot", "bands", "save", "loop"),
)
"""Options that request a fit; without any of them a log is only surveyed, unless it can be
identified at once.
"""

OF_A_FIT = (
    *("smooth_scheduling", "scheduling_at", "commanded", "na", "nb", "delay", "degree"),
    *("no_offset", "offset_rate", "method", "start", "stop", "segments", "decimate", "train"),
)
"""Options of a fit that do not request one."""

ONE_MODEL = {
    "plot": "draws the fits of",
    "bands": "draws the coefficients of",
    "save": "writes",
    "loop": "judges",
}


def _methods(*, told: bool = False) -> list[str]:
    """Return the estimators of difference equations that need nothing but names of instruments;
    `told`: that take them.
    """
    from identification.estimators.method import known_methods

    found = []
    for name, method in known_methods().items():
        parameters = signature(method).parameters
        needed = {p.name for p in parameters.values() if p.default is p.empty}
        asked = not told or "instruments" in parameters
        if needed <= {"instruments"} and asked and not method.of_states:
            found.append(name)
    return found


ARGUMENTS = (
    positional("log", "flight log", type=Path, metavar="LOG"),
    option(
        "--format",
        "NAME",
        "how the log is read, %(choices)s; auto: by its content",
        default="auto",
        choices=Listed(lambda: ("auto", *known_formats())),
    ),
    option(
        "--map",
        "FILE",
        "TOML file that says which column is which signal, in which unit (docs/identify.md)",
        Path,
    ),
    option("--time", "COLUMN", "time column of a table (default: t or time)"),
    option(
        "--time-unit",
        ("s", "ms", "us", "ns"),
        "unit of the time column (default: that of its header, or s)",
    ),
    option(
        "--dt", "S", "sample period, s: of a log without time, or to resample to", options.positive
    ),
    option(
        "--units",
        "NAME=UNIT",
        "units of the columns, such as q=deg/s",
        options.unit,
        [],
        nargs="+",
        action="extend",
    ),
    option("--outputs", "A,B", "signals to predict (X-Plane: q,theta)", options.names),
    option("--inputs", "C,D", "signals that drive them (X-Plane: stick_lon)", options.names),
    option("--scheduling", "P", "scheduling signal (X-Plane: airspeed)"),
    option("--scheduling-from", "U,V", "schedule on the length of this vector", options.names),
    option(
        "--smooth-scheduling",
        "S",
        "causal low-pass of the scheduling signal, time constant in s",
        options.positive,
    ),
    option("--scheduling-at", ("lag", "now"), "coefficients at p(k - lag) or p(k)", default="lag"),
    flag("--commanded", "the scheduling signal is known ahead; so are signals called ..._command"),
    option("--na", "N", "lags of the outputs", options.count, 3),
    option("--nb", "N", "lags of the inputs", options.count, 3),
    option(
        "--delay",
        "N",
        "first lag of the inputs (default: 1; 0, and one lag more, where samples are means or"
        " interpolated)",
        options.count,
    ),
    option("--degree", "N", "polynomial degree in p; 0: LTI only", options.count, 2),
    flag("--orders", "compare orders 1 to 4 and degrees 0 to 3 instead"),
    flag("--no-offset", "no trim c(p): outputs are already deviations"),
    option(
        "--offset-rate",
        ("auto", "yes", "no"),
        "d(p) times the change of p, the moving trim; auto: tried, and kept where it predicts 1 s"
        " better in sample",
        default="auto",
    ),
    option("--method", "NAME", "estimator: %(choices)s", default="ls", choices=Listed(_methods)),
    option(
        "--instruments",
        "E,F",
        "external excitation, for a method that takes instruments, such as iv",
        options.names,
        (),
    ),
    option("--start", "S", "drop samples before this time, s on the log's clock", options.number),
    option("--stop", "S", "drop samples after this time, s", options.number),
    option(
        "--segments",
        "WHICH",
        "of the log: serving (in the air; default for an autopilot's log without --start, --stop),"
        " all, or numbers of the survey, such as 2,3",
    ),
    option("--decimate", "N", "average over N samples", options.at_least_one, 1),
    option(
        "--train",
        "SHARE",
        "fraction of the time to fit, from the start; the rest is held out (default: 0.7)",
        options.fraction,
    ),
    option(
        "--test", "LOG", "another log of the same kind to hold out; LOG is fitted as a whole", Path
    ),
    option(
        "--plot",
        "FILE",
        "draw measured, one step, 1 s and free run into this .png, .svg or .pdf (needs matplotlib)",
        options.picture,
    ),
    option(
        "--bands",
        "FILE",
        "draw every coefficient over the scheduling signal with its 95 %% band",
        options.picture,
    ),
    option(
        "--loop",
        "INPUT=OUTPUT:GAIN",
        "judge whether the model is fit for this feedback, such as d_lat=phi:-0.03",
        options.feedback,
        [],
        nargs="+",
        action="extend",
    ),
    option(
        "--save",
        "FILE",
        "write the model: .json (Python, symheli export model) or .mat (MATLAB)",
        options.model_file,
    ),
)


def run(arguments: argparse.Namespace) -> Output:
    """Read, preprocess, fit and validate; or survey the log, where no fit is requested."""
    from studies.log.advice import advised_in_flags

    with advised_in_flags():
        return _identified(arguments)


def _identified(arguments: argparse.Namespace) -> Output:
    """The answer, with the advice of the libraries as it is."""
    from identification.judge import compare_constant, slow_modes
    from studies.log import in_feedback, report, tried

    if arguments.log.suffix.lower() == ".toml":
        raise InputError(
            f"{arguments.log}: expected a flight log, got a TOML file; a signal map goes with"
            " --map FILE.toml beside the log, and a vehicle is shown by `symheli vehicles"
            " FILE.toml`"
        )
    kind = "mapped" if arguments.map else _log_format(arguments, arguments.log)
    if not any(getattr(arguments, name) for name in FIT_OPTIONS):
        seen = _contents(arguments, arguments.log)
        if not _at_once(arguments, kind, seen):
            options.refuse(
                arguments, OF_A_FIT, "on the survey of a log; --outputs and --inputs request a fit"
            )
            return _survey(arguments, seen)
    structure, training, test, prepared = _requested(arguments, kind)
    record = prepared.record
    hold = not (arguments.commanded or prepared.scheduling.endswith("_command"))
    trim: Any = {"yes": "moving", "no": "still"}.get(
        arguments.offset_rate, "still" if arguments.no_offset else "auto"
    )
    method = _method(arguments.method, arguments.instruments)
    if arguments.orders:
        for option in ("plot", "bands", "save", "loop"):
            if getattr(arguments, option):
                raise InputError(
                    f"--{option} {ONE_MODEL[option]} one model; --orders compares many"
                )
        if arguments.method != "ls":
            raise InputError("--orders compares models of least squares; leave --method out")
        options.refuse(arguments, ("na", "nb", "degree"), "on --orders, which compares many")
        return _orders(replace(structure, offset_rate=trim == "moving"), training, test, hold)
    result = compare_constant(
        structure,
        training,
        test,
        trim=trim,
        hold_p=hold,
        method=method,
    )
    facts = report.facts(
        arguments.log,
        kind,
        record,
        prepared.samples,
        prepared.samples - prepared.kept,
        result,
        arguments.test,
        prepared.used,
        prepared.slower,
        _in_place(arguments),
        prepared.units,
    )
    check = prepared.kinematics

    def again(flags: Mapping[str, Any]) -> tuple[LPVARX, FlightRecord, FlightRecord | None]:
        other = argparse.Namespace(**{**vars(arguments), **flags})
        return _requested(other, kind)[:3]

    mended, slow = tried.mended(result, vars(arguments), again), ""
    if result.scheduled.least_squares:
        found = slow_modes(result.scheduled, result.training)
        slow = tried.seen_slowly(found, vars(arguments), again)
    text = report.text(facts, result, check, mended=mended, slow=slow)
    data = {**report.data(facts, result, check), "diverges": tried.diverging(result)}
    if arguments.loop:
        found = in_feedback.judged(result, arguments.loop)
        text = "\n\n".join([text, in_feedback.text(found)])
        data = {**data, "fit_for_control": in_feedback.data(found)}
    written = list(_write(arguments, result))
    if written:
        text, data = (
            "\n".join([text, *(f"wrote {path}" for path in written)]),
            {**data, "written": written},
        )
    return Output(text, data)


def _requested(
    arguments: argparse.Namespace, kind: str
) -> tuple[LPVARX, FlightRecord, FlightRecord | None, _Prepared]:
    """Return the requested structure, the data of the fit, the validation data, and the record."""
    from identification import LPVARX, Polynomial
    from studies.log.reading import scheduling_range

    signals = _signals(arguments, kind)
    prepared = _prepared(arguments, arguments.log, signals, cut=True)
    record = prepared.record
    if arguments.test is None:
        training, test = record.split(arguments.train or 0.7)
    elif arguments.train is None:
        training, test = record, _prepared(arguments, arguments.test, signals, cut=False).record
    else:
        raise InputError(
            "--test holds out another log, --train a part of this one: give one of the two"
        )
    p = np.concatenate([part[prepared.scheduling] for part in (training, test) if part is not None])
    basis = Polynomial(arguments.degree, *scheduling_range(p, arguments.degree))
    delay, nb = arguments.delay, arguments.nb
    if delay is None:  # u(k) comes to the lags that there are
        delay, nb = (0, nb + 1) if record.resampled else (1, nb)
    structure = LPVARX(
        signals.outputs,
        signals.inputs,
        prepared.scheduling,
        na=arguments.na,
        nb=nb,
        delay=delay,
        basis=basis,
        scheduling_at=arguments.scheduling_at,
        offset=not arguments.no_offset,
    )
    return structure, training, test, prepared


def _log_format(arguments: argparse.Namespace, log: Path) -> str:
    """Return the format of a log: the given one, the map's, or that of its content."""
    given = _map(arguments).format if arguments.map and arguments.format == "auto" else None
    return given or (format_of(log) if arguments.format == "auto" else arguments.format)


def _map(arguments: argparse.Namespace) -> SignalMap:
    """The signal map, with the options that are given in place of its entries."""
    from symheli.logs.signal_map import SignalMap

    found = SignalMap.load(arguments.map)
    if arguments.format != "auto":
        found = replace(found, format=arguments.format)
    return found.over(
        time=arguments.time,
        time_unit=arguments.time_unit,
        dt=arguments.dt,
        units=dict(arguments.units),
    )


def _in_place(arguments: argparse.Namespace) -> list[str]:
    """Return a sentence for each option that replaces an entry of the signal map."""
    from symheli.logs.signal_map import SignalMap

    if not arguments.map:
        return []
    own, used = SignalMap.load(arguments.map), _map(arguments)
    pairs = [
        (f"--{name.replace('_', '-')} {new}", f"{name} = {old}")
        for name in ("format", "time", "time_unit", "dt")
        if (new := getattr(used, name)) != (old := getattr(own, name)) and old is not None
    ]
    pairs += [
        (f"--units {name}={used.signals[name].unit}", f"{name} in {source.unit}")
        for name, source in own.signals.items()
        if source.unit not in (None, used.signals[name].unit)
    ]
    return [f"{flag} in place of {entry} of {arguments.map.name}" for flag, entry in pairs]


def _contents(arguments: argparse.Namespace, log: Path) -> Contents:
    """Return all columns of a log, or of a table the signals of the map."""
    from studies.log.reading import read_mapped
    from symheli.logs.column import Column

    kind = _log_format(arguments, log)
    if not arguments.map or own_clocks(kind):
        status = log.stat() if log.is_file() else None
        return _all_of(log, kind, *((status.st_mtime_ns, status.st_size) if status else (0, 0)))
    record = read_mapped(log, _map(arguments), arguments.time_unit)
    columns = {str(s): Column(record.time, record[s], s.unit) for s in record.signals}
    return Contents("mapped", columns)


@lru_cache(maxsize=1)
def _all_of(log: Path, kind: str, _modified: int, _size: int) -> Contents:
    """Return the content of a file, read once while it does not change."""
    return contents_of(log, kind)


def _surveyed(arguments: argparse.Namespace, log: Path, seen: Contents) -> Survey:
    from symheli.logs.survey import survey

    return survey(
        log,
        seen,
        time=arguments.time,
        time_unit=arguments.time_unit or "s",
        dt=arguments.dt,
    )


def _at_once(arguments: argparse.Namespace, kind: str, seen: Contents) -> bool:
    """Whether there are defaults for what this log holds: X-Plane's, with a clock or --dt."""
    timed = arguments.dt or all(column.time is not None for column in seen.columns.values())
    wanted = {*XPLANE["outputs"], *XPLANE["inputs"], XPLANE["scheduling"]}
    return kind == "xplane" and bool(timed) and wanted <= seen.columns.keys()


def _survey(arguments: argparse.Namespace, seen: Contents) -> Output:
    """Return the content of the log, and a command that would identify a model."""
    from studies.log import survey_report
    from studies.log.suggestion import Suggestion, suggestion

    found = _surveyed(arguments, arguments.log, seen)
    hint = suggestion(found, dt=arguments.dt, signal_map=arguments.map)
    if hint.command is not None and (why := _refused(hint)):
        why = f"the obvious command ends in: {why}"
        hint = Suggestion((*hint.missing, why), refused=why)
    return Output(survey_report.text(found, hint), survey_report.data(found, hint))


def _refused(hint: Suggestion) -> str:
    """Return why a suggested command could not fit its model; empty where it could."""
    from identification import fit

    parser = argparse.ArgumentParser()
    add(parser, ARGUMENTS)
    assert hint.command is not None  # noqa: S101  asked by the caller
    arguments = parser.parse_args(hint.command[2:])
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if hint.map is not None:
            arguments.map = Path(folder) / "aircraft.toml"
            write_text(arguments.map, hint.map)
        try:
            structure, training, _, _ = _requested(
                arguments, "mapped" if arguments.map else _log_format(arguments, arguments.log)
            )
            fit(structure, training)
        except SymheliError as error:
            return str(error).replace(f"{folder}/", "")
    return ""


class _Signals(NamedTuple):
    """Outputs and inputs of the model; `scheduling` is None if it is derived from others, or
    absent.
    """

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    scheduling: str | None


class _Prepared(NamedTuple):
    """A record ready to fit, the name of its scheduling signal, how many samples were read and
    `kept` in the segments and between start and stop, whether attitude and rates agree where the
    log has them, sentences on `units` that contradict each other, the segments `used` (empty: all),
    and signals logged more seldom (their steps, s).
    """

    record: FlightRecord
    scheduling: str
    samples: int
    kept: int
    kinematics: KinematicCheck | None
    units: Sequence[str]
    used: tuple[Segment, ...]
    slower: Mapping[str, float]


def _method(name: str, instruments: tuple[str, ...]) -> Method | str:
    """The method of this name, with its instruments."""
    from identification.estimators.method import known_methods

    if not instruments:
        return name
    if name not in (takes := _methods(told=True)):
        raise InputError(f"--instruments are for --method {', '.join(takes)}, not {name}")
    return known_methods()[name](**{"instruments": instruments})


def _prepared(
    arguments: argparse.Namespace, log: Path, signals: _Signals, *, cut: bool
) -> _Prepared:
    """Read `log` and do to it what the options say, in the order of docs/identify.md; start and
    stop only where it is to be `cut`.
    """
    from studies.log import flown, units
    from studies.log.reading import COMBINED, read, read_mapped
    from symheli.records import conditioning
    from symheli.records.kinematics import lacking

    combined, scheduling = arguments.scheduling_from, signals.scheduling
    wanted = [
        *signals.outputs,
        *signals.inputs,
        *(combined or ((scheduling,) if scheduling else ())),
        *arguments.instruments,
    ]
    if arguments.map:
        record = read_mapped(log, _map(arguments), arguments.time_unit)
    else:
        record = read(
            log,
            list(dict.fromkeys(wanted)),
            format=_log_format(arguments, log),
            dt=arguments.dt,
            time=arguments.time,
            units=dict(arguments.units),
            time_unit=arguments.time_unit,
        )
    record, columns = flown.as_measured(record, signals.outputs, log)
    samples, used, seen = len(record), (), None
    if own_clocks(_log_format(arguments, log)) or arguments.segments:
        seen = _contents(arguments, log)
        segments = _surveyed(arguments, log, seen).segments
        cut_by_hand = cut and (arguments.start is not None or arguments.stop is not None)
        which = arguments.segments or (flown.ALL if cut_by_hand else flown.SERVING)
        if not cut and which not in (flown.SERVING, flown.ALL):
            which = flown.SERVING  # numbers are those of LOG
        used = flown.chosen(segments, which, log)
        if used:
            record = flown.within(record, used, log)
    if combined:
        record, scheduling = conditioning.with_norm(record, combined, COMBINED), COMBINED
    if not scheduling:
        scheduling = "constant"
        record = record.with_signals({scheduling: "1"}, **{scheduling: np.zeros(len(record))})
    whole = record.between(arguments.start, arguments.stop) if cut else record
    check = None if lacking(whole.signals) else whole.check_kinematics()
    wrong = units.contradicted(whole, _declared(arguments, log))
    record = record.select(
        list(dict.fromkeys([*signals.outputs, *signals.inputs, scheduling, *arguments.instruments]))
    )
    if cut:
        record = record.between(arguments.start, arguments.stop)
    kept = len(record)
    if arguments.smooth_scheduling:
        record = conditioning.smooth(record, scheduling, arguments.smooth_scheduling)
    shorter = conditioning.decimate(record, arguments.decimate)
    if seen is not None and arguments.map:
        sources = _map(arguments).signals.items()
        columns |= {n: seen.columns[s.column] for n, s in sources if s.column in seen.columns}
    flown.refuse_what_is_invented(columns, (*signals.outputs, *signals.inputs), shorter.dt, log)
    late = flown.slower(columns, shorter.dt)
    return _Prepared(shorter, scheduling, samples, kept, check, wrong, used, late)


def _declared(arguments: argparse.Namespace, log: Path) -> dict[str, str]:
    """Units by signal, as the map, the header or the options declare them."""
    if arguments.map:
        return {n: s.unit for n, s in _map(arguments).signals.items() if s.unit}
    header = format_named(_log_format(arguments, log)).declared(log)
    return {**{n: unit for n, unit in header.items() if unit}, **dict(arguments.units)}


def _write(arguments: argparse.Namespace, result: Any) -> Iterator[Path]:
    """Write the requested plots and the model; return their paths."""
    from identification import uncertainty
    from studies.log import figure

    if arguments.plot:
        yield figure.save(figure.figure(result), arguments.plot)
    if arguments.bands:
        bands = uncertainty(result.scheduled, result.training).plot()
        yield figure.save(bands[0].figure, arguments.bands)
    if arguments.save:
        model = result.scheduled
        if model.least_squares:
            model = replace(model, covariance=uncertainty(model, result.training).covariance)
        yield (
            model.save(arguments.save)
            if arguments.save.suffix == ".json"
            else model.save_mat(arguments.save)
        )


def _orders(structure: Any, training: Any, test: Any, hold_p: bool) -> Output:
    """Return a table of orders and degrees, compared on the validation data."""
    from identification import order_scan

    if test is None:
        raise InputError(
            "--orders judges on held-out samples: reduce --train so that some are left"
        )
    scan = order_scan(
        structure, training, test, horizon=max(round(1.0 / training.dt), 1), hold_p=hold_p
    )
    rows = [
        {
            "na": t.na,
            "degree": t.degree,
            "bic": t.bic,
            "refused": t.refused,
            "fit_percent": {"one step": t.one_step, "1 s": t.ahead, "free run": t.free_run},
        }
        for t in scan.trials
    ]
    return Output(f"held out, {scan}", {"outputs": list(structure.outputs), "trials": rows})


def _signals(arguments: argparse.Namespace, kind: str) -> _Signals:
    default: dict[str, Any] = XPLANE if kind == "xplane" else {}
    outputs, inputs = (
        arguments.outputs or default.get("outputs"),
        arguments.inputs or default.get("inputs"),
    )
    scheduling = arguments.scheduling or default.get("scheduling")
    if not outputs or not inputs:
        raise InputError(
            "give the signals to predict and the inputs that drive them: --outputs q,theta --inputs"
            " d_lon"
        )
    if arguments.scheduling and arguments.scheduling_from:
        raise InputError("give --scheduling or --scheduling-from, not both")
    if not (scheduling or arguments.scheduling_from) and arguments.degree > 0:
        raise InputError(
            "name the scheduling signal with --scheduling or --scheduling-from, or fit an LTI model"
            " with --degree 0"
        )
    return _Signals(outputs, inputs, None if arguments.scheduling_from else scheduling)
