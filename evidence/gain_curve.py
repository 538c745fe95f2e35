"""Gains of several loops against the permitted acceleration, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from synthesis import GainCurve


def save(curves: Sequence[GainCurve], path: Path) -> None:
    """One panel a curve, to `path`; its ending says the format."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        1, len(curves), figsize=(2 + 6 * len(curves), 4.5), squeeze=False, layout="constrained"
    )
    for curve, ax in zip(curves, axes[0], strict=True):
        curve.plot(ax)
    figure.savefig(path, dpi=130)
    plt.close(figure)
