"""Families of functions of the scheduling parameters."""

from symheli.lpv.bases.basis import Basis
from symheli.lpv.bases.bspline import BSpline
from symheli.lpv.bases.function_space import FunctionSpace, Piece
from symheli.lpv.bases.interpolating import CubicSpline, PiecewiseLinear
from symheli.lpv.bases.patches import Patches
from symheli.lpv.bases.polynomial import Polynomial
from symheli.lpv.bases.product import Product
from symheli.lpv.bases.user_functions import UserFunctions

__all__ = [
    "BSpline",
    "Basis",
    "CubicSpline",
    "FunctionSpace",
    "Patches",
    "Piece",
    "PiecewiseLinear",
    "Polynomial",
    "Product",
    "UserFunctions",
]
