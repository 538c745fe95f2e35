"""Guaranteed bounds of functions and of their Jacobians over boxes and ellipsoids.

Every bound is first order in the symbols of the domain, rounding errors included: see `enclose`.
"""

from symheli.enclosure.domain import Domain
from symheli.enclosure.enclosure import Enclosure, SegmentAverages, enclose, segment_averages
from symheli.enclosure.form import AffineForm

__all__ = ["AffineForm", "Domain", "Enclosure", "SegmentAverages", "enclose", "segment_averages"]
