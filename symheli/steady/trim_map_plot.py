"""A trim map as a picture: one quantity over horizontal speed and climb rate, the vortex ring
hatched.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.values.drawing import GREY, INK, RED, axes_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from symheli.steady.trim_map import TrimMap


def plot_trim_map(trim_map: TrimMap, ax: Axes | None = None, quantity: str = "power") -> Axes:
    """See `TrimMap.plot`."""
    ax = axes_of(ax)
    level, climb = (
        trim_map.level_speeds,
        np.broadcast_to(trim_map.climb_rates, trim_map.success.shape),
    )
    values, keep = trim_map[quantity], trim_map.success
    unit = next(s.unit for s in trim_map.signals if s == quantity)
    dots = ax.scatter(
        level[keep], climb[keep], c=values[keep], cmap="viridis", s=42, marker="s", linewidths=0
    )
    ax.figure.colorbar(dots, ax=ax, label=f"{quantity} ({unit})")
    marks: tuple[tuple[np.ndarray, dict[str, Any], str], ...] = (
        (
            keep & trim_map.vortex_ring,
            {"marker": "o", "facecolors": "none", "edgecolors": RED, "hatch": "////"},
            "vortex ring",
        ),
        (
            keep & ~trim_map.attainable,
            {"marker": "x", "color": INK},
            "control at or beyond its stop",
        ),
        (trim_map.possible & ~keep, {"marker": ".", "color": GREY}, "no trim"),
    )
    for mask, style, label in marks:
        if mask.any():
            ax.scatter(level[mask], climb[mask], s=30, label=label, **style)
    ax.set_xlabel("horizontal airspeed (m/s)")
    ax.set_ylabel("climb rate (m/s)")
    if ax.get_legend_handles_labels()[0]:
        ax.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize=8)
    return ax
