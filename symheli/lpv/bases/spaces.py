"""Sums and products of function spaces, and the coefficients of a function in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases.basis import Basis
from symheli.lpv.bases.function_space import FunctionSpace, Piece, tensor_grid
from symheli.lpv.bases.patches import Patches
from symheli.lpv.bases.polynomial import Polynomial
from symheli.lpv.bases.polynomials import factors_of
from symheli.lpv.bases.product import Product
from symheli.lpv.bases.user_functions import UserFunctions
from symheli.values.arrays import Array

MERGE_ULPS = 4
"""Breaks of two bases that differ by at most this many units in the last place of the larger end
of the range are the same number, computed twice.
"""
WIDER = 1e6
"""Such breaks are joined only where the pieces on both sides are wider than they are apart by this
factor, and the functions do not jump: what joining changes is then below the rounding of p.
"""


def sum_space(a: FunctionSpace, b: FunctionSpace) -> FunctionSpace:
    """Return a space that contains every f + g, f in `a` and g in `b`, factor by factor.

    Polynomials stay polynomials, other piecewise polynomials become `Patches` over the breaks of
    both; `UserFunctions` and polynomials become the `UserFunctions` of both. Raises `InputError`
    for user functions beside piecewise polynomials.
    """
    return a if a == b else _combined(a, b, _sum)


def product_space(a: FunctionSpace, b: FunctionSpace) -> FunctionSpace:
    """Return a space that contains every f g, f in `a` and g in `b`: as `sum_space`, the degrees
    added.
    """
    return _combined(a, b, _product)


def coefficients_in(space: FunctionSpace, function: Callable[[Array], Array]) -> Array:
    """Coefficients (n, ...) of a `function` of the space, p -> (K, ...): exact to rounding, by as
    many values as each factor needs.
    """
    factors = factors_of(space)
    axes = [_nodes(f) for f in factors]
    values = function(axes[0] if len(axes) == 1 else tensor_grid(axes))
    tensor = values.reshape(*(len(nodes) for nodes in axes), *values.shape[1:])
    for i, (factor, nodes) in enumerate(zip(factors, axes, strict=True)):
        tensor = np.moveaxis(factor.fit(nodes, np.moveaxis(tensor, i, 0)), 0, i)
    return tensor.reshape(space.size, *values.shape[1:])


def _combined(
    a: FunctionSpace, b: FunctionSpace, rule: Callable[[FunctionSpace, FunctionSpace], Basis]
) -> FunctionSpace:
    factors = [rule(f, g) for f, g in zip(factors_of(a), factors_of(b), strict=True)]
    return factors[0] if len(factors) == 1 else Product(tuple(factors))


def _sum(f: FunctionSpace, g: FunctionSpace) -> Basis:
    return _basis(f) if f == g else _either(f, g, products=False)


def _product(f: FunctionSpace, g: FunctionSpace) -> Basis:
    return _either(f, g, products=True)


def _either(f: FunctionSpace, g: FunctionSpace, products: bool) -> Basis:
    """The factor for both, or for their products: of the larger degree, or of their sum."""

    def degree(first: int, second: int) -> int:
        return first + second if products else max(first, second)

    for one, other in ((f, g), (g, f)):
        if one.degrees == (0,):
            return _basis(other)
    if any(isinstance(h, UserFunctions) for h in (f, g)) and all(
        isinstance(h, UserFunctions) or h.degrees is not None for h in (f, g)
    ):
        return UserFunctions.of_both(_basis(f), _basis(g), products)
    (low_f, high_f), (low_g, high_g) = f.ranges[0], g.ranges[0]
    low, high = max(low_f, low_g), min(high_f, high_g)
    if f.degrees is not None and g.degrees is not None:
        return Polynomial(degree(f.degrees[0], g.degrees[0]), low, high)
    try:
        pieces = f.pieces(), g.pieces()
    except InputError as error:
        raise InputError(
            f"functions of {type(f).__name__} and of {type(g).__name__} have no basis in common,"
            " nor for their products: both must be polynomials or piecewise polynomials;"
            " interpolate with kind='polynomial' or 'spline'"
        ) from error
    first, second = (max(p.bernstein.shape[1] - 1 for p in each) for each in pieces)
    total = degree(first, second)
    return Patches(total, _breaks(pieces, low, high, total))


def _breaks(
    spaces: Sequence[Sequence[Piece]], low: float, high: float, degree: int
) -> tuple[float, ...]:
    """Return the breaks of every space between `low` and `high`; equal ones count once, also those
    that two spaces computed from one number.
    """
    unit = float(np.spacing(max(abs(low), abs(high))))
    # room for degree + 1 values of p that can be told apart
    least = unit * max(MERGE_ULPS, 8 * (degree + 1))
    breaks = [low]
    for at in sorted({low, high, *(p.low for each in spaces for p in each)}):
        apart = at - breaks[-1]
        if not low < at <= high or apart == 0:
            continue
        if apart > least:
            breaks.append(at)
        elif apart > MERGE_ULPS * unit or not all(_joins(each, breaks[-1], at) for each in spaces):
            raise InputError(
                f"the functions have breaks at {breaks[-1]!r} and at {at!r}, too near to one"
                " another to tell the polynomial between them, and they are not the same: give"
                " the same number for both, or move them apart"
            )
        elif at == high:
            breaks[-1] = high
    if len(breaks) < 2:
        raise InputError(f"a basis needs low < high, got [{low!r}, {high!r}]")
    return tuple(breaks)


def _joins(pieces: Sequence[Piece], a: float, b: float) -> bool:
    """Whether the functions change by no more than the rounding of p does where a break of theirs
    moves from `a` to `b` or back.
    """
    for left, right in pairwise(pieces):
        if not a <= right.low <= b:
            continue
        jump = np.abs(left.bernstein[:, -1] - right.bernstein[:, 0])
        size = max(np.abs(left.bernstein).max(), np.abs(right.bernstein).max())
        narrow = min(left.high - left.low, right.high - right.low)
        if jump.max() > 64 * np.finfo(float).eps * size or narrow < WIDER * (b - a):
            return False
    return True


def _basis(factor: FunctionSpace) -> Basis:
    assert isinstance(factor, Basis)  # noqa: S101  (factors are bases of one parameter)
    return factor


def _nodes(factor: FunctionSpace) -> Array:
    """Return points of one parameter at which the functions are distinguished without loss of
    digits, none on a break at which they may jump.
    """
    if isinstance(factor, Polynomial):
        x = np.polynomial.legendre.leggauss(factor.size)[0]
        return 0.5 * (factor.low + factor.high) + 0.5 * (factor.high - factor.low) * x
    return factor.points(factor.degree + 1) if isinstance(factor, Patches) else factor.samples()
