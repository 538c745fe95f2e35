"""The gain of a loop against the permitted rate, as a picture."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

from symheli.values.drawing import BLUE, GREEN, GREY, INK, ORANGE, RED, axes_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from synthesis.certify.questions.gain_curve import GainCurve

COLOURS = {"P(p)": BLUE, "P(p, lag)": GREEN}
ATTAINED = "worst trajectory of the linear model"
"""Label of the lower bounds."""


def plot_gain_curve(
    curve: GainCurve,
    ax: Axes | None = None,
    *,
    legend: Literal["upper left", "upper right"] = "upper left",
) -> Axes:
    """See `GainCurve.plot`."""
    ax = axes_of(ax)
    rates = sorted(
        {r for gains in (curve.lower, *curve.bounds.values()) for r in gains if 0 < r < math.inf}
    )
    slow, fast = 0.4 * min([0.1, *rates]), 2.0 * max([6.0, *rates])
    place = {0.0: slow, math.inf: fast, **{r: r for r in rates}}
    shown = [
        g
        for g in (curve.frozen, *_finite(curve.jumping, *curve.bounds.values(), curve.lower))
        if 0 < g < math.inf
    ]
    low, high = 0.6 * min(shown, default=1.0), 2.5 * max(shown, default=1.0)
    last = max(curve.best, default=0.0)
    edge = 1.12 * fast
    if not _finite(curve.jumping) and place[last] < min(curve.growing, fast):
        end = min(curve.growing, edge)
        ax.axvspan(place[last], end, color=GREY, alpha=0.18, linewidth=0)
        ax.text(
            math.sqrt(place[last] * end), low * 1.08, "open", color=INK, ha="center", fontsize=8
        )
    if math.isfinite(curve.growing):
        ax.axvspan(curve.growing, edge, color=RED, alpha=0.14, linewidth=0)
        ax.text(
            math.sqrt(curve.growing * edge), low * 1.08, "grows", color=RED, ha="center", fontsize=8
        )
    attained = sorted((place[r], g) for r, g in curve.lower.items() if math.isfinite(g))
    upper = {place[r]: g for r, g in curve.best.items()}
    both = [(x, g, upper[x]) for x, g in attained if x in upper]
    if both:
        x, low_side, high_side = zip(*both, strict=True)
        ax.fill_between(x, low_side, high_side, color=ORANGE, alpha=0.15, linewidth=0)
    for form, gains in curve.bounds.items():
        points = sorted((place[r], g) for r, g in gains.items() if math.isfinite(g))
        if points:
            ax.plot(
                *zip(*points, strict=True),
                "o-",
                color=COLOURS.get(form, INK),
                markersize=4,
                label=f"proven, {form}",
            )
    if attained:
        ax.plot(
            *zip(*attained, strict=True),
            "^--",
            color=ORANGE,
            markersize=4,
            label=ATTAINED,
        )
    if math.isfinite(curve.frozen):
        ax.axhline(curve.frozen, color=GREY, linestyle=":", label=f"frozen, {curve.frozen:.3g}")
    else:
        ax.text(
            0.5, 0.5, f"unstable at {curve.held}", transform=ax.transAxes, ha="center", color=RED
        )
    nothing = _jumping(curve, ax, slow)
    if nothing:
        words = f"{curve.parameter} may jump: nothing proven by\n{', '.join(nothing)}"
        ax.text(0.985, 0.97, words, transform=ax.transAxes, ha="right", va="top", fontsize=8)
    ax.set(xscale="log", yscale="log", xlim=(0.9 * slow, edge), ylim=(low, high), title=curve.title)
    ticks = _ticks(low, high)
    ax.set_xticks([slow, *(r for r in (0.01, 0.1, 1, 3, 6) if slow < r < 0.6 * fast), fast], None)
    ax.set_xticklabels(
        ["frozen", *(f"{r:g}" for r in (0.01, 0.1, 1, 3, 6) if slow < r < 0.6 * fast), "jumps"]
    )
    ax.set_yticks(ticks, [f"{t:g}" for t in ticks])
    ax.minorticks_off()
    ax.set_xlabel(f"permitted |d {curve.parameter}/dt| ({curve.rate_unit})")
    ax.set_ylabel(f"L2 gain, {curve.unit}")
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc=legend, fontsize=8, frameon=False)
    return ax


def _jumping(curve: GainCurve, ax: Any, left: float) -> list[str]:
    """Draw horizontal lines for the tests that prove a gain for jumps, and return the names of the
    others. Tests that agree to 1 % share a line.
    """
    together: dict[float, list[str]] = {}
    for test, gain in sorted(curve.jumping.items(), key=lambda item: item[1]):
        same = next((g for g in together if g == gain or gain < 1.01 * g), gain)
        together.setdefault(same, []).append(test)
    for gain, names in together.items():
        if math.isfinite(gain):
            ax.axhline(gain, color=RED, linewidth=1, linestyle="-.")
            ax.text(
                left,
                gain * 1.04,
                f"{', '.join(names)}: {gain:.3g}",
                color=RED,
                fontsize=8,
                va="bottom",
            )
    return together.get(math.inf, [])


def _finite(*gains: Mapping[Any, float]) -> list[float]:
    return [g for each in gains for g in each.values() if math.isfinite(g)]


def _ticks(low: float, high: float) -> list[float]:
    for steps in ((1, 2, 5), (1, 1.5, 2, 3, 4, 5, 7)):
        ticks = [m * 10.0**e for e in range(-6, 7) for m in steps if low <= m * 10.0**e <= high]
        if len(ticks) > 2:
            break
    return ticks
