"""Figures of every flight of every controller: against the size of the gusts, and seed by seed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from studies.controllers.designs import BASELINE, HINF, IDENTIFIED, LFT, LQR
from studies.controllers.flown import WINDS
from symheli.values.drawing import BLUE, GREEN, GREY, ORANGE, RED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from studies.controllers.certified import CertifiedControllers
    from studies.controllers.flown import FlownControllers

RATIOS = (
    "Energy ratio of every flight against the size of the gusts; line: medians; dashed: the proven"
    " gain. Crosses: flights that were lost."
)
SEEDS = (
    "Scatter over the seeds: every flight, one point a seed, the same gusts and noise for all"
    " controllers (a thin line joins them); bar: the median. Crosses: flights that were lost."
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
        ax.set_title(name.replace(" from ", "\nfrom "))
        ax.set_xlabel("gusts (m/s)")
    axes[0][0].set_ylim(bottom=0.0)
    axes[0][0].set_ylabel("energy ratio")
    return figure


def seeds(found: FlownControllers) -> Figure:
    """A panel a size of turbulence, a column a controller."""
    import matplotlib.pyplot as plt

    winds = [wind for wind in WINDS if found.at(wind)]
    figure, axes = plt.subplots(
        1, len(winds), figsize=(3.8 * len(winds), 3.4), sharey=True, squeeze=False
    )
    for ax, wind in zip(axes[0], winds, strict=True):
        flown = found.at(wind)
        for ratios in zip(*([f.ratio for f in one.flights] for one in flown), strict=True):
            ax.plot(range(len(flown)), ratios, color=GREY, linewidth=0.4, alpha=0.6)
        for k, one in enumerate(flown):
            for lost, marker in ((False, "o"), (True, "x")):
                own = [f.ratio for f in one.flights if f.lost is lost]
                ax.plot([k] * len(own), own, marker, color=COLOURS[one.name], ms=3.5)
            ax.plot([k - 0.3, k + 0.3], [one.ratio] * 2, color=COLOURS[one.name], linewidth=2.2)
        labels = [one.name.replace(" ", "\n").replace("from\n", "from ") for one in flown]
        ax.set_xticks(range(len(flown)), labels, fontsize=8)
        ax.set_title(f"gusts of {flown[0].gust:.1f} m/s")
    axes[0][0].set_ylim(bottom=0.0)
    axes[0][0].set_ylabel("energy ratio")
    return figure
