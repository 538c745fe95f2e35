"""Families of functions of the scheduling parameters."""

from symheli.lpv.bases.basis import Basis, Piece
from symheli.lpv.bases.function_space import FunctionSpace
from symheli.lpv.bases.interpolating import PiecewiseLinear, Spline
from symheli.lpv.bases.polynomial import Polynomial
from symheli.lpv.bases.product import Product

__all__ = ["Basis", "FunctionSpace", "Piece", "PiecewiseLinear", "Polynomial", "Product", "Spline"]
