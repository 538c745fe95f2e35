"""Gain over permitted acceleration, one line a jerk, with the flights as marks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from evidence.jerk.flown import Fastest
from evidence.jerk.gains import Loop
from symheli.values.drawing import BLUE, GREEN, GREY, INK, ORANGE, RED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = (BLUE, GREEN, ORANGE, RED)


def plot(title: str, loop: Loop, flights: Mapping[str, Fastest], ax: Axes) -> None:
    """Draw proven gains as lines, lower bounds as triangles; nothing proven: no point.

    The flights stand at their largest acceleration, with their largest jerk.
    """
    from matplotlib.ticker import LogLocator, NullLocator

    for k, jerk in enumerate(sorted({c.jerk for c in loop.cells})):
        cells = sorted(c for c in loop.cells if c.jerk == jerk)
        colour = COLOURS[k % len(COLOURS)]
        label = f"jerk up to {jerk:g} m/s³" if math.isfinite(jerk) else "any jerk"
        rates = [c.acceleration for c in cells]
        ax.plot(rates, [_shown(c.proven) for c in cells], "o-", color=colour, ms=4, label=label)
        ax.plot(rates, [_shown(c.lower) for c in cells], "^:", color=colour, ms=4)
    present = sorted(loop.chosen_knots.items())
    ax.plot(
        [a for a, _ in present],
        [_shown(g) for _, g in present],
        "--",
        color=INK,
        label="P(V), acceleration may jump",
    )
    ax.axhline(loop.frozen, color=GREY, linestyle=":", label=f"frozen, {loop.frozen:.3g}")
    shown = [g for c in loop.cells for g in (c.proven, c.lower)] + list(loop.chosen_knots.values())
    largest = max(g for g in (loop.frozen, *shown) if math.isfinite(g))
    fastest = max(a for a in (*loop.chosen_knots, *(f.acceleration for f in flights.values())))
    ax.set(yscale="log", title=title, ylim=(0.2 * loop.frozen, 2.0 * largest))
    ax.set_xlim(0.0, 1.12 * fastest)
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_locator(NullLocator())
    for name, flight in flights.items():
        ax.plot(flight.acceleration, 0.06, "D", color=INK, ms=6, transform=ax.get_xaxis_transform())
        ax.annotate(
            f"{name} flight\n{flight.jerk:.1f} m/s³",
            (flight.acceleration, 0.06),
            xycoords=ax.get_xaxis_transform(),
            xytext=(0, 7),
            textcoords="offset points",
            ha="center",
            fontsize=8,
        )
    ax.set_xlabel("permitted |dV/dt| (m/s²)")
    ax.set_ylabel("L2 gain: lines proven, triangles lower bounds")
    ax.legend(fontsize=8, frameon=False, loc="upper left")


def _shown(gain: float) -> float:
    return gain if math.isfinite(gain) else math.nan
