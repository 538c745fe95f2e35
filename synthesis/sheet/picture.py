"""Design margins of a specification sheet as a picture: levels shaded, one mark a value of the
parameter.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from symheli.errors import InputError
from symheli.values.drawing import GRID, INK, RED, axes_of, label, windowless_figure
from symheli.values.whole_files import write_bytes
from synthesis.sheet.sheet import Specification

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from synthesis.sheet.evaluation import SpecificationTable

LOWEST, HIGHEST = -210.0, 110.0
"""Ends of the margins that are shown, percent; what is lower is an arrow at the end."""

LEVELS = {
    "Level 1": (0.0, HIGHEST, "#ffffff"),
    "2": (-100.0, 0.0, "#e3e8ec"),
    "3": (LOWEST, -100.0, "#c3ccd4"),
}
"""Shades of grey, so that the marks have the colours."""

COLOURS = "viridis"


def shown(table: SpecificationTable, axis: str) -> list[Specification]:
    """Return the frozen specifications of an axis that have boundaries; raise `InputError` where
    there are none.
    """
    found = [s for s in table.frozen if s.axis == axis and s.sense]
    if not found:
        names = dict.fromkeys(s.axis for s in table.frozen if s.sense)
        raise InputError(f"no frozen specification of {axis}: choose one of {', '.join(names)}")
    return found


def plot_margins(
    table: SpecificationTable, axis: str, controller: str, ax: Axes | None, bar: bool = True
) -> Axes:
    """See `SpecificationTable.plot`; `bar`: with the colours of the parameter."""
    specs = shown(table, axis)
    ax = axes_of(ax, 7.5, 0.9 + 0.27 * len(specs))
    for name, (low, high, shade) in LEVELS.items():
        ax.axvspan(low, high, color=shade, linewidth=0, zorder=0)
        ax.annotate(
            name,
            (0.5 * (low + high), 1.0),
            (0, 2),
            xycoords=ax.get_xaxis_transform(),
            textcoords="offset points",
            ha="center",
            fontsize=7,
            color=INK,
        )
    marks = None
    stable = table.stable[controller]
    for row, spec in enumerate(specs):
        values = table.over(controller, axis, spec.name)
        margins = np.array([spec.design_margin(v) for v in values])
        known = ~np.isnan(margins)
        x = np.maximum(margins, LOWEST + 4)
        style = {"cmap": COLOURS, "vmin": table.at.min(), "vmax": table.at.max(), "zorder": 3}
        for beyond, shape in ((False, "o"), (True, "<")):
            at = known & ((margins < LOWEST + 4) == beyond)
            drawn = ax.scatter(
                x[at],
                np.full(int(at.sum()), row),
                c=table.at[at],
                marker=shape,
                s=26 if spec.counts else 12,
                linewidths=0.4,
                edgecolors="white",
                **style,  # type: ignore[arg-type]
            )
            marks = drawn if not beyond else marks
        if not stable.all():
            ax.plot(LOWEST + 4, row, "x", color=RED, markersize=5, zorder=4)
    ax.axvline(0.0, color=INK, linewidth=0.8, zorder=1)
    ax.hlines(range(len(specs)), LOWEST, HIGHEST, color=GRID, linewidth=0.6, zorder=1)
    names = [s.name if s.counts else f"({s.name})" for s in specs]
    ax.set_yticks(range(len(specs)), names, fontsize=8)
    ax.set_ylim(len(specs) - 0.4, -0.6)
    ax.set_xlim(LOWEST, HIGHEST)
    ax.set_xticks([-200, -100, 0, 100])
    ax.set_xlabel("design margin (%)", fontsize=8)
    ax.tick_params(axis="both", length=0, labelsize=8)
    ax.spines[["top", "right", "left", "bottom"]].set_visible(False)
    unstable = "" if stable.all() else f", × unstable at {int((~stable).sum())} of {len(stable)}"
    ax.set_title(f"{axis}: {controller}{unstable}", fontsize=8, loc="left", pad=14)
    if bar and marks is not None:
        ax.figure.colorbar(marks, ax=ax, label=label(table.parameter), pad=0.02, aspect=30)
    return ax


def figure_of(table: SpecificationTable, axes: Sequence[str] | None = None) -> Figure:
    """Return the margins of these axes (None: of all), a row an axis and a column a controller."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    rows = axes or list(dict.fromkeys(s.axis for s in table.frozen if s.sense))
    names, heights = table.controllers, [len(shown(table, axis)) for axis in rows]
    figure = windowless_figure(2.6 + 2.3 * len(names), sum(0.8 + 0.21 * n for n in heights) + 0.4)
    grid = figure.subplots(
        len(rows),
        len(names),
        squeeze=False,
        sharey="row",
        gridspec_kw={"height_ratios": [n + 3.0 for n in heights]},
    )
    for i, axis in enumerate(rows):
        for k, name in enumerate(names):
            ax = plot_margins(table, axis, name, grid[i, k], bar=False)
            ax.tick_params(labelleft=k == 0)
            if i < len(rows) - 1:
                ax.set_xlabel("")
    s = table.parameter
    colours = ScalarMappable(Normalize(table.at.min(), table.at.max()), COLOURS)
    figure.colorbar(colours, ax=grid, label=label(s), pad=0.01, aspect=30, fraction=0.03)
    return figure


def save(table: SpecificationTable, path: Path) -> Path:
    """Write the margins of all axes in the format of the file's name."""
    content = io.BytesIO()
    figure_of(table).savefig(content, format=path.suffix.removeprefix(".").lower(), dpi=130)
    return write_bytes(path, content.getvalue())
