"""Polynomials in one or several parameters as one kind of basis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from symheli.lpv.bases.function_space import FunctionSpace, Range, tensor_grid
from symheli.lpv.bases.polynomial import Polynomial
from symheli.lpv.bases.product import Product
from symheli.values.arrays import Array


def polynomials(degrees: Sequence[int], ranges: Sequence[Range]) -> Polynomial | Product:
    """Return all polynomials of these degrees in each of the parameters, orthonormal over
    the box.
    """
    factors = tuple(
        Polynomial(d, low, high) for d, (low, high) in zip(degrees, ranges, strict=True)
    )
    return factors[0] if len(factors) == 1 else Product(factors)


def interpolation_points(degrees: Sequence[int], ranges: Sequence[Range]) -> Array:
    """Chebyshev points (K,) or (K, d), as many as such polynomials have coefficients: a fit there
    is exact.
    """
    axes = [
        0.5 * (low + high) - 0.5 * (high - low) * np.cos(np.pi * (np.arange(d + 1) + 0.5) / (d + 1))
        for d, (low, high) in zip(degrees, ranges, strict=True)
    ]
    return axes[0] if len(axes) == 1 else tensor_grid(axes)


def lobatto_points(count: int, ranges: Sequence[Range]) -> Array:
    """`count` Chebyshev-Lobatto points a parameter, (K,) or (K, d), ends included: a fit there
    stays close to the best one between them too.
    """
    axes = [
        0.5 * (low + high) - 0.5 * (high - low) * np.cos(np.pi * np.arange(count) / (count - 1))
        for low, high in ranges
    ]
    return axes[0] if len(axes) == 1 else tensor_grid(axes)


def piecewise_lobatto(knots: Sequence[float], parts: int) -> Array:
    """The knots, and the Chebyshev-Lobatto points that cut every interval in so many parts."""
    inner = 0.5 - 0.5 * np.cos(np.pi * np.arange(parts) / parts)
    return np.r_[np.concatenate([a + (b - a) * inner for a, b in pairwise(knots)]), knots[-1]]


def factors_of(basis: FunctionSpace) -> tuple[FunctionSpace, ...]:
    """The one-parameter bases of a product, or the basis itself."""
    return basis.factors if isinstance(basis, Product) else (basis,)


def coefficients_of(
    scaled: Mapping[tuple[int, ...], Array], ranges: Sequence[Range]
) -> tuple[Polynomial | Product, Array]:
    """Basis and coefficients (n, ...) of sum M_e x^e, every x from -1 to 1 over its range."""
    degrees = [max(column) for column in zip(*scaled, strict=True)]
    first = next(iter(scaled.values()))
    tensor = np.zeros((*(d + 1 for d in degrees), *first.shape))
    for exponents, M in scaled.items():
        tensor[exponents] = M
    basis = polynomials(degrees, ranges)
    for i, factor in enumerate(factors_of(basis)):
        tensor = np.moveaxis(factor.from_scaled(np.moveaxis(tensor, i, 0)), 0, i)  # type: ignore[attr-defined]
    return basis, tensor.reshape(basis.size, *first.shape)


def scaled_powers(basis: FunctionSpace, coefficients: Array) -> dict[tuple[int, ...], Array]:
    """{exponents: M} with sum_j f_j M_j = sum M_e x^e, every x from -1 to 1 over the box."""
    T = basis.form("scaled")
    powers = np.tensordot(T.T, coefficients, axes=1)
    if isinstance(basis, Product):
        return dict(zip(basis.indices, powers, strict=True))
    return {(i,): M for i, M in enumerate(powers)}
