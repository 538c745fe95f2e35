"""The same functions of parameters in other units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from symheli.errors import InputError
from symheli.lpv.bases.bspline import BSpline
from symheli.lpv.bases.function_space import FunctionSpace
from symheli.lpv.bases.interpolating import Cardinal
from symheli.lpv.bases.patches import Patches
from symheli.lpv.bases.polynomial import Polynomial
from symheli.lpv.bases.polynomials import factors_of
from symheli.lpv.bases.product import Product
from symheli.lpv.bases.user_functions import UserFunctions
from symheli.values.arrays import Array

Space = Any
"""A `FunctionSpace` that comes back as one of its own kind."""


def rescaled(basis: FunctionSpace, sizes: Sequence[float]) -> FunctionSpace:
    """g_j(p) = f_j(size p), one size > 0 a parameter: with the same coefficients the same model,
    over p in units `size` times as large. Raises `InputError` for a basis that is no such family.
    """
    factors = tuple(
        factor if size == 1.0 else _rescaled(factor, size)
        for factor, size in zip(factors_of(basis), sizes, strict=True)
    )
    return replace(basis, factors=factors) if isinstance(basis, Product) else factors[0]


def _rescaled(basis: Space, size: float) -> Space:
    """All are affine in their nodes: the coefficients stay."""

    def all_of(places: Sequence[float]) -> tuple[float, ...]:
        return tuple(place / size for place in places)

    match basis:
        case Polynomial():
            return replace(basis, low=basis.low / size, high=basis.high / size)
        case Cardinal():
            return replace(basis, nodes=all_of(basis.nodes))
        case BSpline():
            return replace(basis, breakpoints=all_of(basis.breakpoints))
        case Patches():
            return replace(basis, breaks=all_of(basis.breaks))
        case UserFunctions():
            functions = tuple(partial(_at, f, size) for f in basis.functions)
            slopes = tuple(partial(_slope, f, size) for f in basis.derivatives)
            low, high = all_of((basis.low, basis.high))
            return replace(basis, functions=functions, derivatives=slopes, low=low, high=high)
    raise InputError(
        f"functions of kind {type(basis).__name__} are not converted to another unit: give the"
        " range in the unit of the model"
    )


def _at(function: Any, size: float, p: Array) -> Array:
    return function(size * p)


def _slope(derivative: Any, size: float, p: Array) -> Array:
    return size * derivative(size * p)
