"""The energy ratio of every flight beside what is proven."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from studies.controllers.designs import BASELINE, HINF, IDENTIFIED, LFT, LQR
from symheli.values.drawing import BLUE, GREEN, GREY, ORANGE, RED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from studies.controllers.certified import CertifiedControllers
    from studies.controllers.flown import FlownControllers

CAPTION = (
    "Energy ratio of every flight against the size of the gusts; line: medians; dashed: the proven"
    " gain. Crosses: flights that were lost."
)
COLOURS = {LQR: GREY, HINF: RED, LFT: ORANGE, BASELINE: GREEN, IDENTIFIED: BLUE}


def energy_ratios(found: FlownControllers, proofs: CertifiedControllers | None) -> Figure:
    """A panel a controller."""
    import matplotlib.pyplot as plt

    names = list(dict.fromkeys(one.name for one in found.flown))
    figure, axes = plt.subplots(
        1, len(names), figsize=(2.3 * len(names), 3.2), sharey=True, squeeze=False
    )
    for ax, name in zip(axes[0], names, strict=True):
        own = found.of(name)
        for lost, marker in ((False, "."), (True, "x")):
            at = [(one.gust, f.ratio) for one in own for f in one.flights if f.lost is lost]
            ax.plot(*zip(*at, strict=True) if at else ([], []), marker, color=COLOURS[name], ms=3)
        ax.plot([one.gust for one in own], [one.ratio for one in own], color=COLOURS[name])
        limit = math.inf if proofs is None else proofs.gain(name)
        if math.isfinite(limit):
            ax.axhline(limit, color=COLOURS[name], linestyle="--", linewidth=1)
        ax.set_title(name)
        ax.set_xlabel("gusts (m/s)")
    axes[0][0].set_ylim(bottom=0.0)
    axes[0][0].set_ylabel("energy ratio")
    return figure
