"""One loop's gain against the permitted acceleration, from frozen to arbitrarily fast: what is
proven, what was flown, what is open.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, BLUE, ORANGE, GREEN, RED, GREY = (
    "#1b1f24",
    "#0b61a4",
    "#d9730d",
    "#2e7d32",
    "#b3261e",
    "#8a949e",
)
COLOURS = {"P(p)": BLUE, "P(p, lag)": GREEN}


@dataclass(frozen=True)
class GainCurve:
    """Gains of one loop, by permitted acceleration in m/s^2 (0: frozen, inf: the airspeed may
    jump).

    frozen     largest gain of the frozen models
    flown      {acceleration: gain of a computed trajectory}; inf: along it the state grows
    proven     {form of the proof: {acceleration: gain}}, the least conservative form first;
               inf: nothing proven
    jumping    {test: gain} of the proofs that let the airspeed jump; inf: nothing proven
    """

    title: str
    unit: str
    frozen: float
    flown: Mapping[float, float]
    proven: Mapping[str, Mapping[float, float]]
    jumping: Mapping[str, float]

    @property
    def growing(self) -> float:
        """Least acceleration at which growth was found, inf: none."""
        return min(
            (rate for rate, gain in self.flown.items() if math.isinf(gain)), default=math.inf
        )

    @property
    def best(self) -> dict[float, float]:
        """{acceleration: least gain proven there}: what is proven for a larger acceleration holds
        for a smaller one.
        """
        every = [(rate, gain) for gains in self.proven.values() for rate, gain in gains.items()]
        least = {
            rate: min(gain for r, gain in every if r >= rate)
            for rate in sorted({rate for rate, _ in every})
        }
        return {rate: gain for rate, gain in least.items() if math.isfinite(gain)}

    @property
    def fastest(self) -> tuple[float, float]:
        """Largest acceleration at which a gain is proven, and that gain; (nan, inf) without one."""
        return max(self.best.items(), default=(math.nan, math.inf))

    def verdict(self) -> str:
        """What the curve says, in one or two sentences."""
        if math.isinf(self.frozen):
            return "the loop is unstable at an airspeed held, so no gain can be proven."
        proven = {test: gain for test, gain in self.jumping.items() if math.isfinite(gain)}
        if not proven:
            words = "No test that lets the airspeed jump proves anything"
            words += (
                ", and none can: an airspeed that jumps makes the state grow"
                if math.isinf(self.flown.get(math.inf, 0.0))
                else ""
            )
        else:
            test = min(proven, key=lambda name: proven[name])
            more = 100 * (proven[test] / self.frozen - 1)
            words = (
                f"{test} proves {proven[test]:.3g} for an airspeed that jumps, {more:.2g} % above"
                " the frozen gain"
            )
        rate, gain = self.fastest
        if math.isfinite(gain):
            words += (
                f". With a bounded acceleration the gain is proven up to {rate:g} m/s^2, there"
                f" {gain:.3g}"
            )
            words += (
                f" (flown {self.flown[rate]:.3g}, frozen {self.frozen:.3g})"
                if rate in self.flown
                else f" (frozen {self.frozen:.3g})"
            )
        if math.isfinite(self.growing):
            words += f"; at {self.growing:g} m/s^2 a flown airspeed makes the state grow"
        return words + "."


def plot(
    curve: GainCurve,
    ax: Axes | None = None,
    *,
    legend: Literal["upper left", "upper right"] = "upper left",
) -> Axes:
    """Gain against acceleration on logarithmic axes: frozen at the left edge, an airspeed that
    jumps at the right.

    Shaded: grey where neither a proof nor growth is known, red where the state grows along a flown
    airspeed.
    """
    if ax is None:
        import matplotlib.pyplot as plt

        ax = plt.subplots(figsize=(7.0, 4.5), layout="constrained")[1]
    rates = sorted(
        {r for gains in (curve.flown, *curve.proven.values()) for r in gains if 0 < r < math.inf}
    )
    slow, fast = 0.4 * min([0.1, *rates]), 2.0 * max([6.0, *rates])
    place = {0.0: slow, math.inf: fast, **{r: r for r in rates}}
    shown = [
        g
        for g in (curve.frozen, *_finite(curve.jumping, *curve.proven.values(), curve.flown))
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
    flown = sorted((place[r], g) for r, g in curve.flown.items() if math.isfinite(g))
    upper = {place[r]: g for r, g in curve.best.items()}
    both = [(x, g, upper[x]) for x, g in flown if x in upper]
    if both:
        x, low_side, high_side = zip(*both, strict=True)
        ax.fill_between(x, low_side, high_side, color=ORANGE, alpha=0.15, linewidth=0)
    for form, gains in curve.proven.items():
        points = sorted((place[r], g) for r, g in gains.items() if math.isfinite(g))
        if points:
            ax.plot(
                *zip(*points, strict=True),
                "o-",
                color=COLOURS.get(form, INK),
                markersize=4,
                label=f"proven, {form}",
            )
    if flown:
        ax.plot(
            *zip(*flown, strict=True),
            "^--",
            color=ORANGE,
            markersize=4,
            label="flown: no bound can be smaller",
        )
    if math.isfinite(curve.frozen):
        ax.axhline(curve.frozen, color=GREY, linestyle=":", label=f"frozen, {curve.frozen:.3g}")
    else:
        ax.text(
            0.5, 0.5, "unstable at an airspeed held", transform=ax.transAxes, ha="center", color=RED
        )
    nothing = _jumping(curve, ax, slow)
    if nothing:
        words = f"airspeed may jump: nothing proven by\n{', '.join(nothing)}"
        ax.text(0.985, 0.97, words, transform=ax.transAxes, ha="right", va="top", fontsize=8)
    ax.set(xscale="log", yscale="log", xlim=(0.9 * slow, edge), ylim=(low, high), title=curve.title)
    ticks = _ticks(low, high)
    ax.set_xticks([slow, *(r for r in (0.01, 0.1, 1, 3, 6) if slow < r < 0.6 * fast), fast], None)
    ax.set_xticklabels(
        ["frozen", *(f"{r:g}" for r in (0.01, 0.1, 1, 3, 6) if slow < r < 0.6 * fast), "jumps"]
    )
    ax.set_yticks(ticks, [f"{t:g}" for t in ticks])
    ax.minorticks_off()
    ax.set_xlabel("permitted |dV/dt| (m/s²)")
    ax.set_ylabel(f"L2 gain, {curve.unit}")
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc=legend, fontsize=8, frameon=False)
    return ax


def save(curves: Sequence[GainCurve], path: Path) -> None:
    """One panel a curve, to `path`; its ending says the format."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        1, len(curves), figsize=(2 + 6 * len(curves), 4.5), squeeze=False, layout="constrained"
    )
    for curve, ax in zip(curves, axes[0], strict=True):
        plot(curve, ax)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _jumping(curve: GainCurve, ax: Any, left: float) -> list[str]:
    """Lines across for the tests that prove something; the names of the others. Tests that agree to
    1 % share a line.
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
    return [m * 10.0**e for e in range(-6, 7) for m in (1, 2, 5) if low <= m * 10.0**e <= high]
