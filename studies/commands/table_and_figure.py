"""A table as CSV and its figure, side by side in a folder."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

from symheli.values.whole_files import write_text


def write(folder: Path, name: str, csv: str, plot: Callable[[], Any]) -> list[Path]:
    """Write `name`.csv and `name`.svg of the axes `plot()` returns; the paths written."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    written = write_text(folder / f"{name}.csv", csv)
    with matplotlib.rc_context({"svg.hashsalt": "symheli", "font.size": 9}):
        figure = plot().figure
        picture = io.StringIO()
        figure.savefig(picture, format="svg", metadata={"Date": None})
        plt.close(figure)
    return [written, write_text(folder / f"{name}.svg", picture.getvalue())]
