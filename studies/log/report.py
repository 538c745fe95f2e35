"""Report of an identification: data, excitation and fit, as text and as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from identification import residual_analysis, uncertainty
from identification.judge import slow_modes
from identification.judge.against_constant import HORIZONS, PAYS, AgainstConstant
from identification.judge.scores import Scores, percent
from identification.model import LPVARXModel
from studies.log.accuracy import OPEN, OpenGap, open_gap
from studies.output import columns
from symheli.logs.segments import Segment
from symheli.records import FlightRecord, KinematicCheck, SensorCheck

FIT = (
    "fit in percent: 100 perfect, 0 no better than the output's mean, below 0 worse than that; the",
    "rms error is (100 - fit) % of what the output varies (its standard deviation)",
)
VERDICTS = (
    f"  pays: more than {PAYS:g} point better in free run, as simulation and feedback need it, and"
    " no worse",
    "  1 s ahead; pays for prediction only: better 1 s ahead, from measurements, not in free run",
)


def facts(
    log: Path,
    kind: str,
    record: FlightRecord,
    rows: int,
    outside: int,
    result: AgainstConstant,
    test_log: Path | None = None,
    used: Sequence[Segment] = (),
    slower: Mapping[str, float] = MappingProxyType({}),
    in_place: Sequence[str] = (),
    units: Sequence[str] = (),
) -> dict[str, Any]:
    """What was read and used: `rows` in the file, `outside` the segments, --start and --stop, and
    what became of the rest; a log held out, if any; the segments that were `used`, and the steps
    (s) of signals logged more seldom than the model's; options `in_place` of the map's entries;
    sentences on `units` that contradict each other.
    """
    model, test = result.scheduled, result.test
    scheduling = model.parameters[0]
    seen = result.training[scheduling]
    low, high = float(np.nanmin(seen)), float(np.nanmax(seen))
    ahead = np.zeros(0) if test is None else test[scheduling]
    return {
        "log": log.name,
        "test_log": None if test_log is None else test_log.name,
        "used": [[one.start, one.stop, one.what] for one in used],
        "logged_every": dict(slower),
        "in_place_of_the_map": list(in_place),
        "units_contradict": list(units),
        "resampled": record.resampled,
        "format": kind,
        "rows_read": rows,
        "rows_outside_start_stop": outside,
        "samples": len(record),
        "segments": [part.stop - part.start for part in record.segments()],
        "dt": record.dt,
        "start": record.time[0],
        "stop": record.time[-1],
        "signals": {str(s): s.unit for s in record.signals},
        "samples_with_missing_values": int(np.isnan(record.values).any(axis=1).sum()),
        "training_samples": len(result.training),
        "training_samples_without_full_regressor": model.rows_dropped,
        "held_out_samples": len(ahead),
        "scheduling": str(scheduling),
        "scheduling_unit": scheduling.unit,
        "scheduling_range": list(result.low_high),
        "scheduling_range_of_training": [low, high],
        "held_out_samples_beyond_training": int(np.sum((ahead < low) | (ahead > high))),
    }


def text(
    found: dict[str, Any],
    result: AgainstConstant,
    check: KinematicCheck | None = None,
    *,
    mended: str = "",
    slow: str = "",
) -> str:
    """The whole answer for a reader: first what would mend a fit that diverges, last the `slow`
    modes and how far noise leaves the model open.
    """
    left_open = _open(result)
    parts = [
        *([mended, ""] if mended else []),
        *_read(found),
        *_structure(found, result),
        *([] if check is None else ["", *_compatibility(check)]),
        *(["", *found["units_contradict"]] if found["units_contradict"] else []),
        "",
        str(result.scheduled.excitation),
        "",
        *FIT,
        _table(result),
        *_horizons(result),
        "",
        *result.verdict(),
        *(VERDICTS if result.verdict() and result.test is not None else ()),
        "",
        *_certainty(result),
        slow,
        *([str(left_open)] if left_open and left_open.gap > OPEN else []),
    ]
    return "\n".join(parts).rstrip()


def data(
    found: dict[str, Any], result: AgainstConstant, check: KinematicCheck | None = None
) -> dict[str, Any]:
    """The whole answer for a program."""
    models = {
        scored.label: {
            "fit_percent": {
                "in_sample": _fits(scored.in_sample),
                "held_out": _fits(scored.held_out),
            },
            "coefficients": _coefficients(scored.model),
        }
        for scored in result.models
    }
    judged = len(result.judged) > 1 and result.test is not None
    pays = {str(y): result.pays(str(y)) for y in result.scheduled.outputs} if judged else None
    worth = {str(y): result.verdict_on(str(y)) for y in pays} if pays is not None else None
    certain = result.scheduled.least_squares
    return {
        "read": found,
        "kinematics": None if check is None else [_sensor(row) for row in check.rows],
        "excitation": _excitation(result),
        "models": models,
        "judged": [scored.label for scored in result.judged],
        "scheduling_pays": pays,
        "scheduling_verdict": worth,
        "verdict": result.verdict(),
        "scheduling_held": result.hold_p,
        "scheduling_leak": result.leak,
        "moving_trim": result.trim_note,
        "method": result.scheduled.method,
        "details": dict(result.scheduled.details),
        "standard_errors": (
            uncertainty(result.scheduled, result.training).standard_errors if certain else None
        ),
        "slow_modes": _slow(result) if certain else None,
        "open_to": None if (left_open := _open(result)) is None else left_open._asdict(),
    }


def _compatibility(check: KinematicCheck) -> list[str]:
    """The table where a sensor contradicts the others, else who agrees."""
    if check.inconsistent:
        return [str(check)]
    agree = [row.signal for row in check.rows if row.verdict == "consistent"]
    unknown = [row.signal for row in check.rows if row.verdict != "consistent"]
    parts = [f"consistent: {', '.join(agree)}"] if agree else []
    return [
        "kinematics: "
        + "; ".join(parts + ([f"not known: {', '.join(unknown)}"] if unknown else []))
    ]


def _sensor(row: SensorCheck) -> dict[str, Any]:
    """A row of the check; None for what is not known."""
    numbers = {"bias": row.bias, "scale": row.scale, "delay": row.delay}
    return {
        "signal": str(row.signal),
        "unit": row.signal.unit,
        "verdict": row.verdict,
        **{
            name: None if e is None or e.standard_error == inf else e._asdict()
            for name, e in numbers.items()
        },
    }


def _fits(scores: Scores | None) -> dict[str, Any] | None:
    return None if scores is None else scores.by_horizon


def _coefficients(model: LPVARXModel) -> dict[str, Any]:
    """Return the coefficients of 1, p, p^2, ... by lag, in the order of
    `identification.model.Coefficients.monomial`.
    """
    values = model.coefficients.monomial()
    return {
        **values._asdict(),
        "output_lags": list(model.structure.output_lags),
        "input_lags": list(model.structure.input_lags),
    }


def _read(found: dict[str, Any]) -> list[str]:
    parts, late = found["segments"], found["logged_every"].items()
    lengths = ", ".join(map(str, parts[:8])) + (", ..." if len(parts) > 8 else "")
    units = ", ".join(f"{name} [{unit}]" for name, unit in found["signals"].items())
    return [
        (
            f"{found['log']} ({found['format']}): {found['rows_read']} rows,"
            f" {found['rows_outside_start_stop']} of them outside the segments,"
            " --start and --stop"
        ),
        *(f"  segment: {a:.2f} to {b:.2f} s, {what}" for a, b, what in found["used"][:8]),
        *(f"  {sentence}" for sentence in found["in_place_of_the_map"]),
        *(f"  {name}: logged every {step:.2g} s, interpolated" for name, step in late),
        (
            f"  used: {found['samples']} samples, dt {found['dt']:.5g} s, from {found['start']:.5g}"
            f" to {found['stop']:.5g} s"
        ),
        (
            f"  parts without a gap: {len(parts)}, of {lengths} samples;"
            f" {found['samples_with_missing_values']} samples with missing values"
        ),
        f"  signals: {units}",
    ]


def _structure(found: dict[str, Any], result: AgainstConstant) -> list[str]:
    arx = result.scheduled.structure
    (low, high), (trained_low, trained_high) = (
        found["scheduling_range"],
        found["scheduling_range_of_training"],
    )
    incomplete = found["training_samples_without_full_regressor"]
    fitted, held = (
        ("the first", "the last")
        if found["test_log"] is None
        else ("all", f"{found['test_log']}, all")
    )
    return [
        (
            f"  fitted: {fitted} {found['training_samples']} samples, {incomplete} without a"
            f" complete regressor, by {_method(result)}"
        ),
        *_too_short(result),
        f"  held out: {held} {found['held_out_samples']} samples",
        (
            f"  range of {arx.scheduling} in all that was read, which the model covers: {low:.4g}"
            f" to {high:.4g} {found['scheduling_unit']}"
        ),
        (
            f"  fitted on {trained_low:.4g} to {trained_high:.4g};"
            f" {found['held_out_samples_beyond_training']} held-out samples lie beyond"
        ),
        (
            f"  model: {', '.join(arx.outputs)} from {', '.join(arx.inputs)}, na {arx.na}, nb"
            f" {arx.nb}, delay {arx.delay}, coefficients at {arx.scheduling_at},"
            f" {'with' if arx.offset else 'without'} offset"
        ),
        *(
            [f"  samples are {found['resampled']}: y(k) may depend on u(k), which delay 0 allows"]
            if found["resampled"]
            else []
        ),
        *([f"  {result.trim_note}"] if result.trim_note else []),
    ]


def _too_short(result: AgainstConstant) -> list[str]:
    """Parts without a gap that hold no whole regressor."""
    memory = result.scheduled.structure.memory
    lengths = [part.stop - part.start for part in result.training.segments()]
    short = [n for n in lengths if n <= memory]
    if not short:
        return []
    parts = "1 part is" if len(short) == 1 else f"{len(short)} parts are"
    return [f"  {parts} shorter than a regressor of {memory + 1} samples and left out"]


def _method(result: AgainstConstant) -> str:
    model = result.scheduled
    strength = (
        f" (first-stage F {model.details['first_stage_F']:.3g},"
        f" {model.details['without_instruments']} samples of parts too short for the instruments"
        " left out)"
        if "first_stage_F" in model.details
        else ""
    )
    return f"{model.method}{strength}"


def _horizons(result: AgainstConstant) -> list[str]:
    """Return which p the predictions use."""
    p = result.scheduled.structure.scheduling
    if result.scheduled.structure.basis.size == 1 and not result.scheduled.structure.offset_rate:
        return []
    if not result.hold_p:
        return [f"{p} is taken as known ahead, as a command is"]
    known = (
        f"; {100 * result.leak:.0f} % of what is new in it is in the outputs of the same instant:"
        " free runs are told what they predict, and are not counted"
        if result.known_from_p
        else ""
    )
    return [
        f"{p} is taken as measured: one step and 1 s hold it from the start of each prediction,"
        f" free runs follow it{known}"
    ]


def _open(result: AgainstConstant) -> OpenGap | None:
    model = result.scheduled
    return open_gap(model, result.training) if model.least_squares else None


def _slow(result: AgainstConstant) -> dict[str, Any]:
    found = slow_modes(result.scheduled, result.training)
    return {
        "lost": len(found.lost),
        "modes": [
            {"p": m.p, "pole": m.s, "error": m.error, "lost": m.lost, "period": m.period}
            for m in found.modes
        ],
        "text": str(found),
    }


def _certainty(result: AgainstConstant) -> list[str]:
    """Return the residual tests of the fit, and the certainty of its coefficients."""
    model = result.scheduled
    lags = min(25, len(result.training) // 20)
    analysis = f"in sample, {residual_analysis(model, result.training, lags)}"
    if not model.least_squares:
        return [analysis]
    known = uncertainty(model, result.training)
    colour = ", ".join(
        f"{y} {factor:.1f}" for y, factor in zip(model.outputs, known.colour, strict=True)
    )
    free = model.structure.free
    sure = np.abs(model.theta) > 2 * known.standard_errors
    count = f"{int(np.sum(sure & free))} of {int(free.sum())}"
    return [
        analysis,
        (
            f"coefficients more than two standard errors from zero: {count} (coloured residuals"
            f" make the errors larger by: {colour})"
        ),
    ]


def _table(result: AgainstConstant) -> str:
    parts = ["in sample"] + (["held out"] if result.test is not None else [])
    rows = [
        [
            "output",
            "varies by",
            "model",
            *(f"{part}: {h}" if i == 0 else h for part in parts for i, h in enumerate(HORIZONS)),
        ]
    ]
    judged = result.training if result.test is None else result.test
    for output in result.scheduled.outputs:
        name, varies = str(output), f"{np.nanstd(judged[output]):.3g} {output.unit}"
        for i, scored in enumerate(result.models):
            halves = [
                half.by_horizon for half in (scored.in_sample, scored.held_out) if half is not None
            ]
            rows.append(
                [
                    *((name, varies) if i == 0 else ("", "")),
                    scored.label,
                    *(percent(half[h][name]) for half in halves for h in HORIZONS),
                ]
            )
    return columns(rows, left=3)


def _excitation(result: AgainstConstant) -> dict[str, Any]:
    report = result.scheduled.excitation
    if report is None:
        return {}
    return {
        "sufficient": report.sufficient,
        "rank": report.rank,
        "regressors": len(report.names),
        "condition": report.condition,
        "worst_direction": report.worst_direction,
        "occupancy": report.occupancy,
        "edges": report.edges,
    }
