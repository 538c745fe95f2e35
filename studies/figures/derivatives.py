"""Derivatives over airspeed as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from symheli import DerivativeTable

SHOWN = ("X_u", "Z_w", "M_u", "M_w", "Y_v", "L_v", "N_v", "N_r")
"""Those that shape the transition."""


def plot(table: DerivativeTable, ax: Axes | None = None, names: Sequence[str] = SHOWN) -> Axes:
    """Each of `names` against airspeed, divided by its largest magnitude, which the legend gives
    with its unit.
    """
    if ax is None:
        import matplotlib.pyplot as plt

        ax = plt.subplots(figsize=(7.0, 4.5), layout="constrained")[1]
    for name in names:
        values = table[name]
        largest = float(np.abs(values).max()) or 1.0
        unit = next(s.unit for s in table if s == name)
        ax.plot(
            table.airspeeds, values / largest, marker=".", label=f"{name}, {largest:.3g} {unit}"
        )
    ax.axhline(0.0, color="#8a949e", linewidth=0.8)
    ax.set_xlabel("airspeed (m/s)")
    ax.set_ylabel("derivative by its largest magnitude")
    ax.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8)
    return ax
