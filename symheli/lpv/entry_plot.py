"""Entries of the matrices over the scheduling parameter, as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from symheli.lpv.entries import Entry, Names, Stacked, chosen, entries
from symheli.values.arrays import Array
from symheli.values.drawing import GREY, axes_of, label, legend_beside, plain
from symheli.values.signal import Signal

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_entries(
    ax: Axes | None,
    over: Signal,
    values: Array,
    names: Names,
    matrices: Stacked,
    wanted: Sequence[str] | None,
    marker: str,
) -> Axes:
    """The `wanted` entries (default: the diagonal of A, what damps each state by itself) against
    `values` (K,) of `over`, each by its largest magnitude, which the legend gives with its unit.
    """
    every = list(entries(names, matrices))
    wanted = [f"A[{s}, {s}]" for s in names.states] if wanted is None else wanted
    return draw_scaled(axes_of(ax), over, values, chosen(every, wanted), marker)


def draw_scaled(
    ax: Axes, over: Signal, values: Array, drawn: Sequence[Entry], marker: str = "."
) -> Axes:
    """Quantities of different units on one axis: each divided by its largest magnitude, which the
    legend gives with its unit.
    """
    for name, along in drawn:
        largest = float(np.abs(along).max())
        unit = "" if name.unit == "1" else f" {name.unit}"
        ax.plot(
            values, along / (largest or 1.0), marker=marker, label=f"{name}, {largest:.3g}{unit}"
        )
    ax.axhline(0.0, color=GREY, linewidth=0.8)
    ax.set_xlabel(label(over))
    ax.set_ylabel("entry by its largest magnitude")
    legend_beside(ax)
    return plain(ax)
