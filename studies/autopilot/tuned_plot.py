"""Margins and responses before and after a change of gains over airspeed: a figure, and a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from studies.autopilot.tuned import CONTROLS, LoopAt
from symheli.values.drawing import plain
from synthesis.design.loops.loop_measures import MEASURES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DRAWN = ("gain", "phase", "bandwidth_3db", "rejection", "rejection_peak", "overshoot")


def csv(before: Sequence[LoopAt], after: Sequence[LoopAt]) -> str:
    """Every number, a row a loop and airspeed, before and after."""
    lines = [",".join(["change", *before[0].as_dict()])]
    for change, rows in (("before", before), ("after", after)):
        lines += [",".join([change, *map(str, row.as_dict().values())]) for row in rows]
    return "\n".join(lines) + "\n"


def plot(before: Sequence[LoopAt], after: Sequence[LoopAt]) -> Axes:
    """A row a quantity, a column a loop: lines over airspeed with their bands, before in grey and
    after in blue; where a loop is not known to be stable there is no line.
    """
    import matplotlib.pyplot as plt

    figure, grid = plt.subplots(
        len(DRAWN), len(CONTROLS), sharex=True, sharey="row", figsize=(9, 2 * len(DRAWN))
    )
    for axes, name in zip(grid, DRAWN, strict=True):
        for ax, control in zip(axes, CONTROLS, strict=True):
            for rows, color, word in ((before, "0.5", "before"), (after, "C0", "after")):
                own = [row for row in rows if row.control == control]
                V = np.array([row.airspeed for row in own])
                value, band = np.array([row.measures.banded(name) for row in own]).T
                value = np.where([row.stable is True for row in own], value, np.nan)
                ax.plot(V, value, color=color, marker=".", label=word)
                ax.fill_between(V, value - band, value + band, color=color, alpha=0.25, lw=0)
            plain(ax)
        axes[0].set_ylabel(f"{MEASURES[name].words}, {MEASURES[name].unit}")
    for ax, control in zip(grid[0], CONTROLS, strict=True):
        ax.set_title(control)
    for ax in grid[-1]:
        ax.set_xlabel("airspeed, m/s")
    grid[0, 0].legend()
    figure.tight_layout()
    return grid[0, 0]
