"""Common style of all plots: colours, axes, and labels of quantities."""

from __future__ import annotations

from typing import TYPE_CHECKING

from symheli.values.signal import Signal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, BLUE, ORANGE = "#1b1f24", "#0b61a4", "#d9730d"
GREEN, RED, GREY = "#2e7d32", "#b3261e", "#8a949e"
LINE, SHADE, GRID = BLUE, "#eceff1", "#e6e9ec"


def axes_of(ax: Axes | None, width: float = 7.0, height: float = 4.5) -> Axes:
    """The axes given, else those of a `new_figure` of this size (inches)."""
    return new_figure(width, height).subplots() if ax is None else ax


def new_figure(width: float, height: float) -> Figure:
    """A figure of this size (inches), which a notebook shows at the end of its cell and a script at
    `pyplot.show()`; nothing is on the screen before. Where there can be no window, matplotlib
    takes one of its backends for files.
    """
    import matplotlib.pyplot as plt

    return plt.figure(figsize=(width, height), layout="constrained")


def windowless_figure(width: float, height: float) -> Figure:
    """A figure of this size (inches) that belongs to no window: for a file."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def label(signal: Signal) -> str:
    """Name and unit; the name alone where it has none."""
    return str(signal) if signal.unit == "1" else f"{signal} ({signal.unit})"


def plain(ax: Axes) -> Axes:
    """The axes with a light grid and no frame at the top and on the right."""
    ax.grid(color=GRID, linewidth=0.6)
    ax.spines[["top", "right"]].set_visible(False)
    return ax


def legend_beside(ax: Axes) -> None:
    """A legend on the right of the axes, where any curve has a label."""
    if ax.get_legend_handles_labels()[0]:
        ax.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8)
