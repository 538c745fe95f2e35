"""The bracket of a certificate as a picture."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from symheli.errors import InputError
from symheli.values.drawing import BLUE, GREY, ORANGE, axes_of, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from synthesis.certify.questions.certificate import Certificate


def plot_certificate(certificate: Certificate, ax: Axes | None) -> Axes:
    """See `Certificate.plot`."""
    facets = certificate.kind.facets
    if not facets.sense:
        raise InputError(f"a {certificate.kind} certificate has no bounds to draw: print it")
    ax = axes_of(ax, 5.5, 3.5)
    bounds = {
        "frozen": (certificate.frozen, GREY),
        "attained": (certificate.limit, ORANGE),
        "proven": (certificate.bound, BLUE),
    }
    for place, (name, (bound, colour)) in enumerate(bounds.items()):
        if math.isfinite(bound):
            ax.plot([place], [bound], "o", color=colour)
            ax.annotate(f"{bound:.4g}", (place, bound), (6, 4), textcoords="offset points")
        else:
            words = {"proven": "nothing proven"}.get(name, "none" if math.isnan(bound) else "grows")
            at = ax.get_xaxis_transform()
            ax.text(place, 0.5, words, transform=at, ha="center", color=colour)
    if math.isfinite(certificate.limit) and math.isfinite(certificate.bound):
        ax.axhspan(
            *sorted((certificate.limit, certificate.bound)), color=ORANGE, alpha=0.15, linewidth=0
        )
    rates = ", ".join(f"{rate:g}" for rate in certificate.rates)
    ax.set_xticks(range(len(bounds)), list(bounds))
    ax.set_xlim(-0.5, len(bounds) - 0.5)
    ax.margins(y=0.2)
    if certificate.kind.gains:
        ax.set_ylim(bottom=0.0)  # differences of a few per mille look like that
    ax.set_ylabel(f"{certificate.kind} ({facets.unit})")
    ax.set_title(f"{certificate.kind}, |dp/dt| ≤ {rates} per second", fontsize=9, loc="left")
    return plain(ax)
