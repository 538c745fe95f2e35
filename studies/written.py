"""A table as CSV and its figure, side by side in a folder."""

from __future__ import annotations

import io
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from symheli.lpv.whole_files import write_text


def write(folder: Path, name: str, csv: str, plot: Callable[[], Any]) -> list[Path]:
    """Write `name`.csv and, where matplotlib is installed, `name`.svg of the axes `plot()` returns; the paths written."""
    written = [write_text(folder / f"{name}.csv", csv)]
    if find_spec("matplotlib"):
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt

        with matplotlib.rc_context({"svg.hashsalt": "symheli", "font.size": 9}):
            figure = plot().figure
            picture = io.StringIO()
            figure.savefig(picture, format="svg", metadata={"Date": None})
            plt.close(figure)
        written.append(write_text(folder / f"{name}.svg", picture.getvalue()))
    return written
