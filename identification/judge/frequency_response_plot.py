"""A measured frequency response as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from symheli.values.drawing import axes_of, legend_beside, plain
from symheli.values.labelled import per

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from identification.judge.frequency_response import FrequencyResponse


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
