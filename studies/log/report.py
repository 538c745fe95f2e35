"""What was read, how well it excites, how well it fits: as text and as data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from identification import residual_analysis, uncertainty
from studies.log.comparison import HORIZONS, Comparison, coefficients, percent
from studies.output import columns
from symheli.lpv import FlightRecord


def facts(log: Path, kind: str, record: FlightRecord, rows: int, outside: int, result: Comparison) -> dict[str, Any]:
    """What was read and used: `rows` in the file, `outside` --start and --stop, and what became of the rest."""
    model, test = result.scheduled, result.test
    scheduling = model.parameters[0]
    seen = result.training[scheduling]
    low, high = float(np.nanmin(seen)), float(np.nanmax(seen))
    ahead = np.zeros(0) if test is None else test[scheduling]
    return {
        "log": log.name,
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


def text(found: dict[str, Any], result: Comparison) -> str:
    """The whole answer for a reader."""
    fit = "fit in percent of the output's own variation (100: perfect, 0: no better than its mean)"
    parts = [
        *_read(found), *_structure(found, result), "", str(result.scheduled.excitation), "", fit, _table(result), "", *result.verdict(), "",
        *_certainty(result),
    ]  # fmt: skip
    return "\n".join(parts).rstrip()


def data(found: dict[str, Any], result: Comparison) -> dict[str, Any]:
    """The whole answer for a program."""
    models = {
        scored.label: {
            "fit_percent": {"in_sample": scored.in_sample, "held_out": scored.held_out},
            "coefficients": coefficients(scored.model),
        }
        for scored in result.models
    }
    judged = len(result.models) > 1 and result.test is not None
    pays = {str(y): result.pays(str(y)) for y in result.scheduled.outputs} if judged else None
    return {
        "read": found, "excitation": _excitation(result), "models": models, "scheduling_pays": pays, "verdict": result.verdict(),
        "standard_errors": uncertainty(result.scheduled, result.training).standard_errors,
    }  # fmt: skip


def _read(found: dict[str, Any]) -> list[str]:
    parts = found["segments"]
    lengths = ", ".join(map(str, parts[:8])) + (", ..." if len(parts) > 8 else "")
    units = ", ".join(f"{name} [{unit}]" for name, unit in found["signals"].items())
    return [
        f"{found['log']} ({found['format']}): {found['rows_read']} rows, {found['rows_outside_start_stop']} of them outside --start/--stop",
        f"  used: {found['samples']} samples, dt {found['dt']:.5g} s, from {found['start']:.5g} to {found['stop']:.5g} s",
        f"  segments: {len(parts)}, of {lengths} samples; {found['samples_with_missing_values']} samples with missing values",
        f"  signals: {units}",
    ]


def _structure(found: dict[str, Any], result: Comparison) -> list[str]:
    arx = result.scheduled.structure
    (low, high), (trained_low, trained_high) = found["scheduling_range"], found["scheduling_range_of_training"]
    incomplete = found["training_samples_without_full_regressor"]
    return [
        f"  fitted: the first {found['training_samples']} samples, {incomplete} without a complete regressor",
        f"  held out: the last {found['held_out_samples']} samples",
        f"  range of {arx.scheduling} in the whole record, which the model covers: {low:.4g} to {high:.4g} {found['scheduling_unit']}",
        f"  fitted on {trained_low:.4g} to {trained_high:.4g}; {found['held_out_samples_beyond_training']} held-out samples lie beyond",
        f"  model: {', '.join(arx.outputs)} from {', '.join(arx.inputs)}, na {arx.na}, nb {arx.nb}, delay {arx.delay},"
        f" coefficients at {arx.scheduling_at}, {'with' if arx.offset else 'without'} offset",
    ]


def _certainty(result: Comparison) -> list[str]:
    """What the residuals of the fit say, and how certain its coefficients are."""
    model = result.scheduled
    lags = min(25, len(result.training) // 20)
    known = uncertainty(model, result.training)
    colour = ", ".join(f"{y} {factor:.1f}" for y, factor in zip(model.outputs, known.colour, strict=True))
    free = model.structure.free
    sure = np.abs(model.theta) > 2 * known.standard_errors
    count = f"{int(np.sum(sure & free))} of {int(free.sum())}"
    return [
        f"in sample, {residual_analysis(model, result.training, lags)}",
        f"coefficients more than two standard errors from zero: {count} (coloured residuals make the errors larger by: {colour})",
    ]


def _table(result: Comparison) -> str:
    parts = ["in sample"] + (["held out"] if result.test is not None else [])
    rows = [["output", "model", *(f"{part}: {h}" if i == 0 else h for part in parts for i, h in enumerate(HORIZONS))]]
    for output in map(str, result.scheduled.outputs):
        for scored in result.models:
            halves = [scored.in_sample, *([scored.held_out] if scored.held_out else [])]
            rows.append([output, scored.label, *(percent(half[h][output]) for half in halves for h in HORIZONS)])
    return columns(rows, left=2)


def _excitation(result: Comparison) -> dict[str, Any]:
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
