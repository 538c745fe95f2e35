"""Entries of the matrices over the scheduling parameter, as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from symheli.lpv.entries import MatrixEntry, Names, Stacked, chosen, entries
from symheli.lpv.linear_family import AIRSPEED
from symheli.values.arrays import Array
from symheli.values.drawing import GREY, axes_of, label, legend_beside, plain
from symheli.values.signal import Signal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from symheli.lpv.linear_family import LinearFamily

MIN_ALPHA = 0.15
"""Opacity of the first of many curves."""


def plot_entries(
    ax: Axes | None,
    over: Signal,
    values: Array,
    names: Names,
    matrices: Stacked,
    wanted: Sequence[str] | None,
    marker: str,
) -> Axes:
    """Plot the `wanted` entries (default: the diagonal of A where it is not zero, the damping of
    each state by itself) against `values` (K,) of `over`, each divided by its largest magnitude,
    which the legend gives with its unit.
    """
    return draw_scaled(axes_of(ax), over, values, _selected(names, matrices, wanted), marker)


def plot_family(ax: Axes | None, family: LinearFamily, wanted: Sequence[str] | None) -> Axes:
    """Plot the `wanted` entries of a family like `plot_entries`, over airspeed where that is an
    axis; a curve for each combination of the other axes' values, the last one the strongest.
    """
    along = family.axes.index(AIRSPEED) if AIRSPEED in family.axes else 0
    values = family.values[along]
    drawn = [
        MatrixEntry(e.name, np.moveaxis(e.values, along, 0).reshape(len(values), -1))
        for e in _selected(family, family, wanted)
    ]
    ax = draw_scaled(axes_of(ax), family.axes[along], values, drawn)
    others = [
        f"{axis} {nodes[0]:g} (pale) to {nodes[-1]:g}{'' if axis.unit == '1' else f' {axis.unit}'}"
        for axis, nodes in zip(family.axes, family.values, strict=True)
        if axis != family.axes[along]
    ]
    if others:
        ax.set_title(", ".join(others), fontsize=9, loc="left")
    return ax


def _selected(names: Names, matrices: Stacked, wanted: Sequence[str] | None) -> list[MatrixEntry]:
    every = list(entries(names, matrices))
    if wanted is not None:
        return chosen(every, wanted)
    diagonal = chosen(every, [f"A[{s}, {s}]" for s in names.states])
    return [e for e in diagonal if np.any(e.values)] or diagonal


def draw_scaled(
    ax: Axes, over: Signal, values: Array, drawn: Sequence[MatrixEntry], marker: str = "."
) -> Axes:
    """Quantities of different units on one axis: each divided by its largest magnitude, which the
    legend gives with its unit. Of several curves (K, m) of one quantity the last has the label, the
    others are paler.
    """
    for number, (name, along) in enumerate(drawn):
        largest = float(np.abs(along).max())
        unit = "" if name.unit == "1" else f" {name.unit}"
        curves = along.reshape(len(values), -1).T / (largest or 1.0)
        for curve, alpha in zip(
            curves, np.linspace(MIN_ALPHA, 1.0, len(curves) + 1)[1:], strict=True
        ):
            last = alpha == 1.0
            ax.plot(
                values,
                curve,
                color=f"C{number % 10}",
                alpha=alpha,
                marker=marker,
                label=f"{name}, {largest:.3g}{unit}" if last else None,
            )
    ax.axhline(0.0, color=GREY, linewidth=0.8)
    ax.set_xlabel(label(over))
    ax.set_ylabel("entry by its largest magnitude")
    legend_beside(ax)
    return plain(ax)
