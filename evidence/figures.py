"""Figures of the documentation: panels side by side in one file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def save(panels: Sequence[Callable[[Axes], object]], path: Path) -> None:
    """Draw each panel on axes of its own and write `path`; its ending says the format."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        1, len(panels), figsize=(2 + 6 * len(panels), 4.5), squeeze=False, layout="constrained"
    )
    for draw, ax in zip(panels, axes[0], strict=True):
        draw(ax)
    figure.savefig(path, dpi=130)
    plt.close(figure)
