"""A trim map as a picture: one quantity over horizontal speed and climb rate, the vortex ring
hatched.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from symheli import TrimMap


def plot(trim_map: TrimMap, ax: Axes | None = None, quantity: str = "power") -> Axes:
    """`quantity` (a state, input or "power") at every trim; hatched: vortex ring; crosses: a
    control beyond its stop; gray: no trim.
    """
    if ax is None:
        import matplotlib.pyplot as plt

        ax = plt.subplots(figsize=(7.0, 4.5), layout="constrained")[1]
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
            {"marker": "o", "facecolors": "none", "edgecolors": "#b3261e", "hatch": "////"},
            "vortex ring",
        ),
        (
            keep & ~trim_map.attainable,
            {"marker": "x", "color": "#1b1f24"},
            "control at or beyond its stop",
        ),
        (trim_map.possible & ~keep, {"marker": ".", "color": "#8a949e"}, "no trim"),
    )
    for mask, style, label in marks:
        if mask.any():
            ax.scatter(level[mask], climb[mask], s=30, label=label, **style)
    ax.set_xlabel("horizontal airspeed (m/s)")
    ax.set_ylabel("climb rate (m/s)")
    if ax.get_legend_handles_labels()[0]:
        ax.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize=8)
    return ax
