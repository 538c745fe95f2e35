"""Families of functions of the scheduling parameter."""

from symheli.lpv.bases.basis import Basis, Piece
from symheli.lpv.bases.interpolating import PiecewiseLinear, Spline
from symheli.lpv.bases.polynomial import Polynomial

__all__ = ["Basis", "Piece", "PiecewiseLinear", "Polynomial", "Spline"]
