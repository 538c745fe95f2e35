"""Figures as files and as what a page holds: SVG inside the page, of dense ones a small PNG with
the points of its curves.
"""

from __future__ import annotations

import base64
import io
import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.values.arrays import Array
from symheli.values.whole_files import write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LARGEST = 110_000
"""Bytes of an SVG that still stands in the page."""

DPI = 130.0
"""Pixels an inch of a PNG."""

COLOURS = 64
"""Colours of a PNG in the page."""

READABLE = 76.0
"""Pixels of the screen an inch of a figure needs at least for its words to be read."""

APART = 3.0
"""Of a curve in a PNG the highest and the lowest point of every so many points of the width."""

STABLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "symheli",
    "path.simplify_threshold": 0.3,
}
"""Text stays text; the same figure is the same file."""


@dataclass(frozen=True)
class Drawn:
    """One figure of the page: its name, its caption, where in results.json its numbers are, and
    the element that shows it.
    """

    name: str
    caption: str
    source: str
    element: str


def drawn(pictures: Iterable[tuple[str, str, str, Figure]], folder: Path) -> list[Drawn]:
    """Write (name, caption, source, figure) as PNG, SVG and PDF, and return the figure of
    the page.
    """
    import matplotlib
    import matplotlib.pyplot as plt

    out = []
    for name, caption, source, figure in pictures:
        for line, place in _curves(figure):
            line.set_gid(place)
        with matplotlib.rc_context(STABLE):
            files = _files(figure)
        axes, points = _axes(figure), _points(figure)
        plt.close(figure)
        for ending, content in files.items():
            write_bytes(folder / f"{name}.{ending}", content)
        svg = inside_a_page(files["svg"].decode("utf-8"), name)
        numbers: dict[str, Any] = {"axes": axes}
        if len(svg) > LARGEST:
            svg, numbers["points"] = _pixels(svg, files["png"]), points
        data = "".join(f' data-{key}="{escape(_packed(what))}"' for key, what in numbers.items())
        least = f"--least: {READABLE * figure.get_figwidth():.0f}px"  # narrow screens scroll
        words = f'<svg role="img" aria-label="{escape(caption)}" style="{least}"{data}'
        out.append(Drawn(name, caption, source, svg.replace("<svg", words, 1)))
    return out


def inside_a_page(svg: str, name: str) -> str:
    """The SVG element of a file: no header, no metadata, identifiers of its own, two decimals."""
    svg = svg[svg.index("<svg") :] if "<svg" in svg else svg
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns(?::xlink)?="[^"]*"', "", svg).replace("xlink:href", "href")
    svg = re.sub(r'<svg height="[^"]*"', "<svg", re.sub(r' width="[\d.]+pt"', "", svg, count=1))
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    svg = re.sub(r'href="#', f'href="#{name}-', svg)
    svg = re.sub(r"url\(#", f"url(#{name}-", svg)
    svg = re.sub(r"(-?\d+\.\d\d)\d+", r"\1", svg)
    svg = re.sub(r"\s*\n\s*", "\n", svg).strip()
    return re.sub(r'<g( clip-path="[^"]*")>\n((?:<use [^>]*/>\n)+)</g>', _styled_once, svg)


def _styled_once(markers: re.Match[str]) -> str:
    """Markers of one style, which their group then has."""
    styles = set(re.findall(r' style="([^"]*)"', markers[2]))
    if len(styles) != 1:
        return markers[0]
    plain = re.sub(r' style="[^"]*"', "", markers[2])
    return f'<g{markers[1]} style="{styles.pop()}">\n{plain}</g>'


def _curves(figure: Figure) -> Iterator[tuple[Any, str]]:
    """Each curve with the identifier it has in the SVG."""
    for a, ax in enumerate(figure.axes):
        for k, line in enumerate(ax.lines):
            yield line, f"curve-{a}-{k}"


def _axes(figure: Figure) -> list[dict[str, Any]]:
    """Return for each panel its box in points from the upper left, the values at its edges, whether
    it has a logarithmic scale, and the names of its curves, by which a page reads numbers off the
    curves.
    """
    width, height = 72 * figure.get_size_inches()
    out = []
    for ax in figure.axes:
        x0, y0, x1, y1 = ax.get_position().extents
        box = [x0 * width, (1 - y1) * height, (x1 - x0) * width, (y1 - y0) * height]
        names = [str(line.get_label()) for line in ax.lines]
        out.append(
            {
                "box": [round(float(edge), 2) for edge in box],
                "x": [*map(float, ax.get_xlim()), ax.get_xscale() == "log"],
                "y": [*map(float, ax.get_ylim()), ax.get_yscale() == "log"],
                "names": ["" if name.startswith("_") else name for name in names],
            }
        )
    return out


def _files(figure: Figure) -> dict[str, bytes]:
    """PNG, SVG and PDF of a figure, undated: laid out once and drawn once for each, where
    `savefig` draws twice.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_pdf import FigureCanvasPdf
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    if (engine := figure.get_layout_engine()) is not None:
        engine.execute(figure)
    figure.set_layout_engine("none")
    before, streams = figure.dpi, {ending: io.BytesIO() for ending in ("png", "svg", "pdf")}
    figure.dpi = DPI
    FigureCanvasAgg(figure).print_png(streams["png"])
    FigureCanvasSVG(figure).print_svg(streams["svg"], metadata={"Date": None})
    FigureCanvasPdf(figure).print_pdf(streams["pdf"], metadata={"CreationDate": None})
    figure.dpi = before
    return {ending: stream.getvalue() for ending, stream in streams.items()}


def _points(figure: Figure) -> list[list[list[int]]]:
    """Of each curve of each panel: x, y and the steps from one point to the next, in tenths of a
    point from the upper left corner. No more than `APART` asks for, and none outside the panel.
    """
    height = figure.bbox.height
    out = []
    for ax in figure.axes:
        (left, low), (right, high) = ax.get_window_extent().get_points()
        panel = []
        for line in ax.lines:
            at = line.get_transform().transform(np.column_stack(line.get_data()).astype(float))
            shown = (at >= (left, low)) & (at <= (right, high))  # not NaN either
            at = at[shown.all(axis=1)]
            at = np.column_stack([at[:, 0], height - at[:, 1]]) * 72 / figure.dpi
            tenths = np.rint(10 * _extremes(at)).astype(int)
            panel.append(np.diff(tenths, axis=0, prepend=0).ravel().tolist())
        out.append(panel)
    return out


def _extremes(at: Array) -> Array:
    """The highest and the lowest of the points (n, 2) in every `APART` of the width, in order."""
    column = np.floor(at[:, 0] / APART)
    kept: set[int] = set()
    for here in np.split(np.arange(len(at)), np.flatnonzero(np.diff(column)) + 1):
        if len(here):
            kept |= {int(here[at[here, 1].argmin()]), int(here[at[here, 1].argmax()])}
    return at[sorted(kept)]


def _pixels(svg: str, png: bytes) -> str:
    """The figure of an SVG element as a picture of few colours."""
    from PIL import Image

    small = io.BytesIO()
    with Image.open(io.BytesIO(png)) as picture:
        picture.convert("RGB").quantize(COLOURS).save(small, "PNG", optimize=True)
    data = base64.b64encode(small.getvalue()).decode("ascii")
    box = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg)
    assert box is not None  # noqa: S101
    width, height = box.groups()
    picture = f'<image width="{width}" height="{height}" href="data:image/png;base64,{data}"/>'
    return f'<svg viewBox="0 0 {width} {height}">{picture}</svg>'


def _packed(content: Any) -> str:
    return json.dumps(content, separators=(",", ":"))
