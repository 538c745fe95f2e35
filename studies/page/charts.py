"""Pictures of the pages as SVG: written once for all browsers; colours by style sheet, so that they
follow light and dark.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape

from symheli.values.arrays import Array

WIDTH, HEIGHT = 360.0, 210.0
LEFT, RIGHT, TOP, BOTTOM = 46.0, 10.0, 20.0, 36.0
ROW = 17.0
"""Height of a row of marks below a chart."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A line over x, with a band of half width `band` where there is one; `style` names its
    colour; `marks`: points instead of a line.
    """

    name: str
    x: Array
    y: Array
    style: str
    band: Array | None = None
    marks: bool = False


@dataclass(frozen=True)
class Frame:
    """The box of a chart, and the range of both axes."""

    x: tuple[float, float]
    y: tuple[float, float]

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return the place of a point in the picture."""
        across, up = (
            (value - low) / (high - low)
            for value, (low, high) in zip((x, y), (self.x, self.y), strict=True)
        )
        return (
            LEFT + across * (WIDTH - LEFT - RIGHT),
            HEIGHT - BOTTOM - up * (HEIGHT - BOTTOM - TOP),
        )

    def path(self, x: Sequence[float] | Array, y: Sequence[float] | Array) -> str:
        """Return the path through points; it is broken where one is not finite."""
        words, pen = [], "M"
        for one, other in zip(x, y, strict=True):
            if not math.isfinite(float(one) + float(other)):
                pen = "M"
                continue
            across, up = self.at(float(one), float(other))
            words.append(f"{pen}{across:.1f} {up:.1f}")
            pen = "L"
        return " ".join(words)


def chart(
    curves: Sequence[Curve],
    about: str,
    x_label: str,
    y_label: str,
    *,
    x: tuple[float, float] | None = None,
    y: tuple[float, float] | None = None,
    at: float = math.nan,
) -> str:
    """Return curves over x as SVG; `at`: an x that is marked, `about`: for a screen reader."""
    frame = Frame(x or _range([c.x for c in curves]), y or _range(_heights(curves)))
    words = [_axes(frame, x_label, y_label)]
    if frame.x[0] <= at <= frame.x[1]:
        words.append(f'<path class="now" d="{frame.path([at, at], frame.y)}"/>')
    for curve in curves:
        words += _drawn(frame, curve)
    return _svg(words, about)


def coverage(
    lows: Sequence[float],
    samples: Sequence[int],
    enough: int,
    moved: Mapping[str, Sequence[bool]],
    width: float,
    at: float,
    about: str,
) -> str:
    """Return bars of samples over cells of airspeed from `lows` (m/s), and below a row of squares
    an input: filled where it has moved enough there.
    """
    high = float(max(2 * enough, *samples))
    frame = Frame((lows[0], lows[-1] + width), (0.0, high))
    words = [_axes(frame, "", "samples")]
    for low, count in zip(lows, samples, strict=True):
        (left, top), (right, bottom) = frame.at(low, count), frame.at(low + width, 0.0)
        style = "bar" if count >= enough else "bar few"
        words.append(
            f'<rect class="{style}" x="{left + 1:.1f}" y="{top:.1f}" width="{right - left - 2:.1f}"'
            f' height="{bottom - top:.1f}"><title>{low:g} to {low + width:g} m/s: {count} samples'
            "</title></rect>"
        )
    words.append(f'<path class="limit" d="{frame.path(frame.x, [enough, enough])}"/>')
    if frame.x[0] <= at <= frame.x[1]:
        words.append(f'<path class="now" d="{frame.path([at, at], frame.y)}"/>')
    base = HEIGHT - BOTTOM + 20
    for k, (name, there) in enumerate(moved.items()):
        words += _squares(frame, lows, width, name, there, base + ROW * k)
    words.append(_text(WIDTH / 2, base + ROW * len(moved) + 14, "airspeed, m/s", "middle"))
    return _svg(words, about, base + ROW * len(moved) + 20)


def legend(names: Sequence[tuple[str, str]]) -> str:
    """Return the names of curves beside their colours (name, style)."""
    items = (Markup('<span class="{}">{}</span>').format(style, name) for name, style in names)
    return f'<p class="legend">{" ".join(items)}</p>'


def _squares(
    frame: Frame, lows: Sequence[float], width: float, name: str, there: Sequence[bool], y: float
) -> list[str]:
    words = [_text(LEFT - 4, y + 10, name.rsplit("_", 1)[-1], "end")]
    for low, moved in zip(lows, there, strict=True):
        left, right = frame.at(low, 0.0)[0], frame.at(low + width, 0.0)[0]
        said = f"{low:g} to {low + width:g} m/s: {name} has{'' if moved else ' not'} moved enough"
        words.append(
            f'<rect class="{"moved" if moved else "still"}" x="{left + 1.5:.1f}" y="{y:.1f}"'
            f' width="{right - left - 3:.1f}" height="{ROW - 4:.1f}" rx="2">'
            f"<title>{escape(said)}</title></rect>"
        )
    return words


def _drawn(frame: Frame, curve: Curve) -> list[str]:
    words = []
    if curve.band is not None and len(curve.x) > 1:
        x = np.concatenate([curve.x, curve.x[::-1]])
        y = np.concatenate([curve.y + curve.band, (curve.y - curve.band)[::-1]])
        if np.isfinite(y).all():
            y = np.clip(y, *frame.y)
            words.append(f'<path class="band {curve.style}" d="{frame.path(x, y)} Z"/>')
    if curve.marks:
        for one, other in zip(curve.x, curve.y, strict=True):
            if math.isfinite(other):
                across, up = frame.at(float(one), float(np.clip(other, *frame.y)))
                words.append(
                    f'<circle class="mark {curve.style}" cx="{across:.1f}" cy="{up:.1f}" r="3">'
                    f"<title>{escape(curve.name)}: {other:.4g}</title></circle>"
                )
    y = np.clip(curve.y, *frame.y)
    words.append(f'<path class="line {curve.style}" d="{frame.path(curve.x, y)}"/>')
    return words


def _axes(frame: Frame, x_label: str, y_label: str) -> str:
    words = []
    for value in ticks(*frame.y):
        left, up = frame.at(frame.x[0], value)
        words.append(f'<path class="grid" d="M{left:.1f} {up:.1f} H{WIDTH - RIGHT:.1f}"/>')
        words.append(_text(left - 4, up + 4, _number(value), "end"))
    for value in ticks(*frame.x):
        across, low = frame.at(value, frame.y[0])
        words.append(_text(across, low + 14, _number(value), "middle"))
    if x_label:
        words.append(_text(LEFT + (WIDTH - LEFT - RIGHT) / 2, HEIGHT - 5, x_label, "middle"))
    words.append(_text(2, 9, y_label, "start"))
    return "".join(words)


def ticks(low: float, high: float, count: int = 5) -> list[float]:
    """Return about `count` round numbers from low to high."""
    step = (high - low) / count
    size = 10.0 ** math.floor(math.log10(step))
    step = next(size * k for k in (1, 2, 5, 10) if size * k >= step * 0.999)
    first = math.ceil(low / step - 1e-9)
    return [step * k for k in range(first, math.floor(high / step + 1e-9) + 1)]


def _number(value: float) -> str:
    return f"{value:.4g}" if abs(value) > 1e-12 else "0"


def _range(values: Sequence[Array]) -> tuple[float, float]:
    finite = np.concatenate([np.ravel(v)[np.isfinite(np.ravel(v))] for v in values] or [[]])
    if not len(finite):
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    room = 0.05 * (high - low) or 0.5 * abs(high) or 0.5
    return low - room, high + room


def _heights(curves: Sequence[Curve]) -> list[Array]:
    bands = [c.y + s * c.band for c in curves if c.band is not None for s in (-1.0, 1.0)]
    return [*(c.y for c in curves), *bands]


def _text(x: float, y: float, words: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>'


def _svg(words: Sequence[str], about: str, height: float = HEIGHT) -> str:
    return (
        f'<svg class="chart" viewBox="0 0 {WIDTH:.0f} {height:.0f}" role="img"'
        f' aria-label="{escape(about)}">{"".join(words)}</svg>'
    )
