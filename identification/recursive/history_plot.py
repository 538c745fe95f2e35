"""Plot of the coefficients of a recursive estimate over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from identification.recursive.history import History
from symheli.errors import UnknownNameError
from symheli.values.drawing import GREY, axes_of, label, legend_beside, plain
from symheli.values.signal import Signal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

VERTICAL_RANGE = (-1.0, 3.0)
"""Vertical range relative to the last value; the first samples of an estimate may be anywhere."""
MAX_LEGEND = 12
"""Largest number of curves named in the legend."""


def plot_history(
    history: History, ax: Axes | None, output: str | None, regressors: Sequence[str] | None
) -> Axes:
    """Plot the coefficients of `output` (default: the first), of all regressors or of these, over
    time (s), each divided by its last value, which the legend gives for up to `MAX_LEGEND` of them.
    """
    outputs, names = [str(y) for y in history.outputs], history.regressor_names
    column = _position(outputs[0] if output is None else output, outputs, "output")
    wanted = names if regressors is None else regressors
    rows = [_position(name, names, "regressor") for name in wanted]
    ax = axes_of(ax)
    for row in rows:
        along = history.coefficients[:, row, column]
        last = along[-1]
        said = f"{names[row]}, {last:.3g}" if len(rows) <= MAX_LEGEND else None
        ax.plot(history.time, along / (last or 1.0), linewidth=0.9, label=said)
    ax.axhline(1.0, color=GREY, linewidth=0.8)
    ax.set_ylim(*VERTICAL_RANGE)
    ax.set_xlabel(label(Signal("time", "s")))
    ax.set_ylabel(f"coefficients of {outputs[column]} by their last value")
    ax.margins(x=0.0)
    legend_beside(ax)
    return plain(ax)


def _position(name: str, known: Sequence[str], kind: str) -> int:
    if name not in known:
        raise UnknownNameError(kind, name, known)
    return list(known).index(name)
