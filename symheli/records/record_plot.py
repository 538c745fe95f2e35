"""A record as a picture: one panel a signal, or what was commanded and flown on one screen."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.drawing import GRID, LINE, SHADE, label, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from symheli.records.flight_record import FlightRecord

MAX_PANELS = 6
"""Largest number of signals in one column."""
SCREEN = (
    ("airspeed", "airspeed_command"),
    ("phi", "theta"),
    ("p", "q", "r"),
    ("d_lon", "d_lat", "d_col", "d_ped"),
)
"""Signals of a flight on one screen, by panel; dashed what they are held to, <name>_reference."""


def plot_record(record: FlightRecord, names: Sequence[str] | None = None) -> Array:
    """The signals `names` against time (s), with their units: an array (signals,) of matplotlib's
    Axes. Default: all, or of many signals, those of `SCREEN`, a panel for each of its rows.

    Shaded: gaps, and where a sample of that signal is missing; no line crosses them. A sample
    between two missing ones is a dot. A notebook shows their figure, a script at `pyplot.show()`;
    `axes[0].figure.savefig("record.png")` writes it. Raises `InputError` for no signals,
    `UnknownNameError` for those the record lacks.
    """
    if names is None and len(record.signals) > MAX_PANELS:
        panels = [[s for s in row if s in record.signals] for row in SCREEN]
        if any(panels):
            return _on_one_screen(record, [panel for panel in panels if panel])
    shown = record.select(
        record.signals if names is None else [names] if isinstance(names, str) else list(names)
    )
    if not shown.signals:
        raise InputError("name at least one signal to plot")
    wide = 2 if len(shown.signals) > MAX_PANELS else 1
    tall = -(-len(shown.signals) // wide)
    figure = new_figure(7.5 * (1.5 if wide == 2 else 1), 0.6 + 1.3 * tall)
    axes = figure.subplots(tall, wide, sharex=True, squeeze=False).T.reshape(-1)
    for ax, signal, column in zip(axes, shown.signals, shown.values.T, strict=False):
        draw(ax, shown, column, color=LINE, linewidth=0.9)
        shade_missing(ax, shown, column)
        ax.set_title(label(signal), fontsize=9, loc="left")
    for ax in axes[len(shown.signals) :]:
        ax.set_visible(False)
    for ax in (axes[len(shown.signals) - 1], axes[tall - 1]):
        ax.tick_params(labelbottom=True)
        ax.set_xlabel("time (s)")
    if record.note:
        figure.suptitle(record.note, fontsize=9)
    return axes[: len(shown.signals)]


def _on_one_screen(record: FlightRecord, panels: Sequence[Sequence[str]]) -> Array:
    """A panel for each list of signals of one unit, with their references dashed: (panels,) of
    Axes.
    """
    figure = new_figure(8.5, 0.6 + 1.55 * len(panels))
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False).ravel()
    for ax, names in zip(axes, panels, strict=True):
        shown = record.select(names)
        for number, (signal, column) in enumerate(zip(shown.signals, shown.values.T, strict=True)):
            dashed = "--" if signal.endswith("_command") else "-"
            draw(
                ax, shown, column, color=f"C{number}", linewidth=1.0, linestyle=dashed, label=signal
            )
            if (held := f"{signal}_reference") in record.signals:
                reference = record.select([held])
                style = {"color": f"C{number}", "linestyle": "--", "linewidth": 0.8}
                draw(ax, reference, reference.values[:, 0], **style)
        ax.set_ylabel(shown.signals[0].unit)
        ax.legend(loc="upper right", ncols=len(names), fontsize=8, frameon=False)
    axes[-1].set_xlabel("time (s)")
    if record.note:
        figure.suptitle(record.note, fontsize=9)
    return axes


def draw(ax: Axes, record: FlightRecord, column: Array, **style: object) -> None:
    """`column` (n,) against the time of `record`: broken at gaps and where it is not finite, a dot
    where a sample stands alone.
    """
    ends = [part.stop for part in record.segments()[:-1]]
    time, values = (
        np.insert(record.time, ends, np.nan),
        np.insert(np.where(np.isfinite(column), column, np.nan), ends, np.nan),
    )
    (line,) = ax.plot(time, values, **style)  # type: ignore[arg-type]
    known = np.concatenate([[False], np.isfinite(values), [False]])
    alone = known[1:-1] & ~known[:-2] & ~known[2:]
    ax.plot(time[alone], values[alone], ".", color=line.get_color(), markersize=3)
    ax.grid(color=GRID, linewidth=0.6)
    ax.margins(x=0.01)
    ax.spines[["top", "right"]].set_visible(False)


def shade_missing(ax: Axes, record: FlightRecord, column: Array) -> None:
    """Grey from the last sample before a gap, or a missing one, to the next."""
    known = np.flatnonzero(np.isfinite(column))
    part_of = np.repeat(
        np.arange(len(record.segments())), [part.stop - part.start for part in record.segments()]
    )
    for a, b in pairwise(known.tolist()):
        if b > a + 1 or part_of[a] != part_of[b]:
            ax.axvspan(record.time[a], record.time[b], color=SHADE, linewidth=0)
