"""Pictures: coefficient functions with their confidence bands, measured frequency responses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.drawing import GRID, LINE, axes_of, label, legend_beside, new_figure, plain
from symheli.values.labelled import per

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from identification.judge.frequency_response import FrequencyResponse
    from identification.judge.uncertainty import Uncertainty

COLUMNS = 4


def plot_bands(known: Uncertainty, level: float = 0.95) -> Array:
    """One panel a coefficient function, its value over p and the normal confidence interval at each
    p: an array (coefficients,) of matplotlib's Axes.

    Raises `InputError` for several scheduling parameters and a level outside (0, 1).
    """
    model = known.model
    if len(model.parameters) != 1:
        raise InputError(
            "coefficients of several scheduling parameters cannot be drawn as curves; evaluate"
            " bands(p) along a line"
        )
    low, high = model.structure.basis.ranges[0]
    p = np.linspace(low, high, 101)
    shown = known.bands(p)
    tall = -(-len(shown) // COLUMNS)
    figure = new_figure(2.6 * COLUMNS, 0.6 + 1.5 * tall)
    axes = figure.subplots(tall, COLUMNS, sharex=True, squeeze=False).reshape(-1)
    for ax, band in zip(axes, shown, strict=False):
        ax.fill_between(p, *band.interval(level), color=LINE, alpha=0.25, linewidth=0)
        ax.plot(p, band.value, color=LINE, linewidth=1.0)
        ax.axhline(0.0, color="0.6", linewidth=0.6)
        ax.set_title(f"{band.regressor} in {band.output}", fontsize=8, loc="left")
        ax.grid(color=GRID, linewidth=0.6)
        ax.tick_params(labelsize=7)
        ax.spines[["top", "right"]].set_visible(False)
    for ax in axes[len(shown) :]:
        ax.set_visible(False)
    for ax in axes[max(len(shown) - COLUMNS, 0) : len(shown)]:
        ax.tick_params(labelbottom=True)
        ax.set_xlabel(label(model.parameters[0]), fontsize=8)
    figure.suptitle(f"coefficients with their {100 * level:g} % confidence bands", fontsize=9)
    return axes[: len(shown)]


def plot_response(response: FrequencyResponse, ax: Axes | None) -> Axes:
    """See `FrequencyResponse.plot`."""
    ax = axes_of(ax)
    for j, u in enumerate(response.inputs):
        for i, y in enumerate(response.outputs):
            magnitude, error = np.abs(response.G[:, i, j]), response.random_error[:, i, j]
            unit = per(y.unit, u.unit)
            name = f"{y} from {u}" + ("" if unit == "1" else f", {unit}")
            (line,) = ax.plot(response.omega, magnitude, label=name)
            low, high = magnitude * np.maximum(1 - error, 0.0), magnitude * (1 + error)
            ax.fill_between(
                response.omega, low, high, color=line.get_color(), alpha=0.2, linewidth=0
            )
    ax.set(xscale="log", yscale="log", xlabel="frequency (rad/s)", ylabel="magnitude")
    legend_beside(ax)
    return plain(ax)
