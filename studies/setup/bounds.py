"""Bounds of the study: sizes of signals, forms of a proof, and one certificate with its loop."""

from __future__ import annotations

import math
from dataclasses import dataclass

from synthesis import Certificate

SIZES = {"d_lat": 0.01, "d_ped": 0.02, "r": 0.1, "phi": 0.1}
"""A disturbance of this size (rad) and an output of this size (rad/s, rad) count as 1 on the servo
channel; the gust channel is in SI.
"""


PERIOD = 0.02


PLAIN, CONSTANT, MEMORY = "P(p)", "constant P", "P(p, lag)"
LFT_TESTS = {
    "LFT full block": "full block",
    "LFT D/G": "DG",
    "LFT D": "D",
    "LFT small gain": "small gain",
}


COPIES = 1e-12
"""Share of an entry below which a dependence on p gets no copy of its own in an LFT test."""
LEFT_OUT = (
    "of the LFT: dependence on a parameter below 1e-12 of the size that its row and column give an"
    " entry is left out; .to_lft().reduce() leaves none out"
)


FORMS = (MEMORY, PLAIN, CONSTANT, *LFT_TESTS)
"""Forms of a proof, the least conservative first; from `CONSTANT` on they let the airspeed jump."""


@dataclass(frozen=True)
class Bound:
    """One certificate: which model, which channel, permitted acceleration (m/s^2), which of
    `FORMS`.
    """

    model: str
    channel: str
    rate: float
    form: str
    certificate: Certificate


def unit_of(channel: str) -> str:
    """Return the unit of the gain of a channel."""
    return "1" if channel in ("servo", "robust", "controllers") else "(rad/s, rad)/(m/s)"


def proven(b: Bound) -> float:
    """The gain proven, inf where none is."""
    return b.certificate.gamma if b.certificate.verified else math.inf


def rate_text(rate: float) -> str:
    """Return the rate in words."""
    return "frozen" if rate == 0 else "arbitrarily fast" if math.isinf(rate) else f"{rate:g} m/s^2"
