"""Figure of predictions and measurements: one step ahead, 1 s ahead and in free run."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from identification.judge.against_constant import AgainstConstant, Scored
from identification.judge.scores import percent, predicted, steps
from symheli.records import FlightRecord
from symheli.records.record_plot import draw, shade_missing
from symheli.values.arrays import Array
from symheli.values.drawing import label, windowless_figure
from symheli.values.whole_files import write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MEASURED, MARK = "#1b1f24", "#8a949e"
COLOURS = {"one step": "#2e7d32", "1 s": "#d9730d", "free run": "#b3261e"}
CLOSE = 10.0
"""Seconds that the right-hand column shows."""


def figure(result: AgainstConstant) -> Figure:
    """A row for each output of the first model, and one for its scheduling: the whole record, and
    the first 10 s of what is held out.

    A dashed line marks where the held-out part begins; free runs start anew there and behind each
    gap. The titles give the fits of each model on the held-out part (on all where nothing is), one
    step, 1 s and free run, in percent. The axes hold what was measured: a prediction may leave
    them, and one that leaves them by more than their height is drawn to there.
    """
    model, parts = result.scheduled, [r for r in (result.training, result.test) if r is not None]
    heights = [1.9] * len(model.outputs) + [1.2]
    picture = windowless_figure(11.0, 0.8 + sum(heights))
    axes = picture.subplots(
        len(heights),
        2,
        sharex="col",
        squeeze=False,
        gridspec_kw={"width_ratios": [3, 2], "height_ratios": heights},
    )
    shown = [*model.outputs, model.parameters[0]]
    measured = np.concatenate([part.columns(model.outputs) for part in parts])
    for part in parts:
        drawn = {
            h: _until_lost(part, predicted(model, part, n, result.hold_p), measured)
            for h, n in steps(model.dt).items()
        }
        for i, (row, name) in enumerate(zip(axes, shown, strict=True)):
            for ax in row:
                draw(
                    ax,
                    part,
                    part[name],
                    color=MEASURED,
                    linewidth=1.4,
                    label="measured" if part is parts[0] else None,
                )
                shade_missing(ax, part, part[name])
                for h, values in drawn.items() if i < len(model.outputs) else ():
                    draw(
                        ax,
                        part,
                        values[:, i],
                        color=COLOURS[h],
                        linewidth=0.9,
                        label=h if part is parts[0] else None,
                    )
    for row, name in zip(axes, shown, strict=True):
        measured = np.concatenate([part[name] for part in parts])
        low, high = np.nanmin(measured), np.nanmax(measured)
        margin = 0.15 * (high - low) or 1.0
        row[0].set_ylim(low - margin, high + margin)
        row[1].set_ylim(low - margin, high + margin)
        fits = f": {_fits(result.judged, str(name))}" if name in model.outputs else ""
        row[0].set_title(label(name) + fits, fontsize=9, loc="left")
        if result.test is not None:
            row[0].axvline(result.test.time[0], color=MARK, linewidth=1.0, linestyle="--")
    start, stop = parts[-1].time[0], parts[-1].time[-1]
    axes[0][1].set_xlim(start, min(start + CLOSE, stop))
    axes[0][1].set_title(
        "held out, from its beginning" if result.test is not None else "from the beginning",
        fontsize=9,
        loc="left",
    )
    for ax in axes[-1]:
        ax.set_xlabel("time (s)")
    picture.legend(
        *axes[0][0].get_legend_handles_labels(),
        loc="outside upper center",
        ncols=4,
        frameon=False,
        fontsize=9,
    )
    return picture


def _until_lost(part: FlightRecord, values: Array, measured: Array) -> Array:
    """Predictions (n, ny), missing from where one of them leaves for good to the end of its part of
    the record.
    """
    low, high = np.nanmin(measured, axis=0), np.nanmax(measured, axis=0)
    span, out = np.where(high > low, high - low, 1.0), values.copy()
    for piece in part.segments():
        with np.errstate(invalid="ignore"):
            beyond = (values[piece] > high + span) | (values[piece] < low - span)
        if len(lost := np.flatnonzero(beyond.any(axis=1))):
            out[piece.start + lost[0] : piece.stop] = np.nan
    return out


def save(picture: Figure, path: Path) -> Path:
    """Write in the format of the extension (png, svg, pdf), whole or not at all."""
    content = io.BytesIO()
    picture.savefig(content, format=path.suffix[1:].lower(), dpi=130)
    return write_bytes(path, content.getvalue())


def _fits(models: tuple[Scored, ...], output: str) -> str:
    """Return the fits of each model in percent, the horizons in order."""

    def shown(scored: Scored) -> str:
        fits = (scored.held_out or scored.in_sample).by_horizon.values()
        return " / ".join(percent(fit[output]) for fit in fits)

    return ", ".join(f"{scored.label} {shown(scored)} %" for scored in models)
