"""Guaranteed bounds of functions and of their Jacobians over boxes and ellipsoids.

Every bound is first order in the symbols of the domain, rounding errors included: see `enclose`.
"""

from synthesis.tubes.enclosure.domain import Domain
from synthesis.tubes.enclosure.enclosure import (
    Enclosure,
    SegmentAverages,
    enclose,
    segment_averages,
)
from synthesis.tubes.enclosure.form import AffineForm

__all__ = ["AffineForm", "Domain", "Enclosure", "SegmentAverages", "enclose", "segment_averages"]
