"""Figures as files and as what a page holds: SVG inside the page, of dense ones a small PNG."""

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

from symheli.values.whole_files import write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LARGEST = 110_000
"""Bytes of an SVG that still stands in the page."""

COLOURS = 64
"""Of a PNG in the page."""

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
    """Write (name, caption, source, figure) as PNG, SVG and PDF, and give what the page shows."""
    import matplotlib
    import matplotlib.pyplot as plt

    out = []
    for name, caption, source, figure in pictures:
        for line, place in _curves(figure):
            line.set_gid(place)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # laid out once, for every kind of file
        with matplotlib.rc_context(STABLE):
            files = {ending: _saved(figure, ending) for ending in ("png", "svg", "pdf")}
        described = json.dumps(_axes(figure), separators=(",", ":"))
        plt.close(figure)
        for ending, content in files.items():
            write_bytes(folder / f"{name}.{ending}", content)
        svg = inside_a_page(files["svg"].decode("utf-8"), name)
        fits = len(svg) <= LARGEST
        words = f'<svg role="img" aria-label="{escape(caption)}" data-axes="{escape(described)}"'
        element = svg.replace("<svg", words, 1) if fits else _image(files["png"], caption)
        out.append(Drawn(name, caption, source, element))
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
    """Of each panel: its box in points from the upper left, what lies at its edges, whether on a
    logarithmic scale, and the names of its curves. By these a page reads numbers off the curves.
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


def _saved(figure: Figure, ending: str) -> bytes:
    stream = io.BytesIO()
    undated = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}[ending]
    figure.savefig(stream, format=ending, dpi=130, metadata=undated)
    return stream.getvalue()


def _image(png: bytes, caption: str) -> str:
    from PIL import Image

    small = io.BytesIO()
    with Image.open(io.BytesIO(png)) as picture:
        picture.convert("RGB").quantize(COLOURS).save(small, "PNG", optimize=True)
    data = base64.b64encode(small.getvalue()).decode("ascii")
    return f'<img src="data:image/png;base64,{data}" alt="{escape(caption)}">'
