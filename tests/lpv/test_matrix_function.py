"""Matrices that depend on the scheduling: sums and products are those of their values."""

from itertools import product

import numpy as np
import pytest

from symheli.errors import InputError
from symheli.lpv import BSpline, CubicSpline, PiecewiseLinear, Polynomial, Product, UserFunctions
from symheli.lpv.bases import Patches
from symheli.lpv.bases.spaces import product_space, sum_space
from symheli.lpv.matrix_function import MatrixFunction, block

BASES = [
    Polynomial(0, 0.0, 13.0),
    Polynomial(3, 0.0, 13.0),
    CubicSpline((0.0, 2.0, 5.0, 9.0, 13.0)),
    PiecewiseLinear((0.0, 5.0, 13.0)),
    BSpline(2, (0.0, 4.0, 13.0)),
    Patches(2, (0.0, 4.0, 9.0, 13.0)),
]
ACROSS = [Polynomial(1, -3.0, 3.0), PiecewiseLinear((-3.0, 0.5, 3.0))]
ROUNDING = 1e-12
"""Some ten products of numbers up to ten, fitted by powers up to the sixth on [0, 1]."""


def random(basis, rows, columns, seed=0, box=None):
    coefficients = np.random.default_rng(seed).standard_normal((basis.size, rows, columns))
    return MatrixFunction(basis, coefficients, box or basis.ranges)


@pytest.mark.parametrize(("a", "b"), product(BASES, BASES), ids=str)
def test_sums_and_products_are_those_of_the_values(a, b):
    M, N = random(a, 2, 3), random(b, 3, 3, seed=1)
    p = np.linspace(0.01, 12.99, 37)
    np.testing.assert_allclose((M @ N)(p), M(p) @ N(p), atol=100 * ROUNDING)
    S = random(b, 2, 3, seed=2)
    np.testing.assert_allclose((M + S)(p), M(p) + S(p), atol=10 * ROUNDING)
    np.testing.assert_allclose(
        block([[M, S], [S, M]])(p), np.block([[M(p), S(p)], [S(p), M(p)]]), atol=10 * ROUNDING
    )


@pytest.mark.parametrize(("a", "b"), product(BASES[1:4], BASES[1:4]), ids=str)
def test_over_two_parameters_each_factor_is_joined_with_its_own(a, b):
    first, second = Product((a, ACROSS[0])), Product((b, ACROSS[1]))
    M, N = random(first, 2, 2), random(second, 2, 2, seed=1)
    p = np.random.default_rng(0).uniform([0.01, -2.99], [12.99, 2.99], (37, 2))
    found = M @ N
    np.testing.assert_allclose(found(p), M(p) @ N(p), atol=100 * ROUNDING)
    assert found.basis.factors[0] == product_space(a, b)


def test_a_constant_costs_neither_basis_nor_degree():
    for basis in (*BASES[1:], UserFunctions((np.ones_like, np.sqrt), 0.0, 13.0)):
        M = random(basis, 2, 2)
        constant = np.array([[1.0, 2.0], [3.0, 4.0]])
        for found in (M @ constant, constant @ M, M + constant):
            assert found.basis == basis
        hidden = MatrixFunction(basis, np.multiply.outer(basis.constant(), constant), M.box)
        assert hidden.is_constant
        assert (M @ hidden).basis == basis
        assert (hidden @ hidden).basis is None
        np.testing.assert_allclose((hidden @ hidden).value, constant @ constant, rtol=1e-13)


def test_a_product_has_the_degree_it_has():
    """(1 + p) in a basis of degree 3 squared is of degree 2."""
    basis = Polynomial(3, 0.0, 13.0)
    line = MatrixFunction(basis, basis.from_monomial([[[1.0]], [[1.0]]]), basis.ranges)
    assert (line @ line).basis == Polynomial(2, 0.0, 13.0)
    np.testing.assert_allclose((line @ line)(np.array([4.0]))[0], 25.0, rtol=1e-13)


def test_breaks_that_differ_by_rounding_are_one():
    a, b = PiecewiseLinear((0.0, 0.3, 1.0)), CubicSpline((0.0, 0.1 + 0.2, 0.6, 1.0))
    assert a.nodes[1] != b.nodes[1]
    assert len(product_space(a, b).breaks) == 4


def test_functions_over_ranges_that_differ_meet_where_both_are_known():
    wide, narrow = Polynomial(2, 0.0, 13.0), Polynomial(1, 2.0, 8.0)
    assert sum_space(wide, narrow) == Polynomial(2, 2.0, 8.0)
    M = random(wide, 2, 2, box=((3.0, 7.0),))
    N = random(narrow, 2, 2, box=((3.0, 7.0),), seed=1)
    p = np.linspace(3.0, 7.0, 9)
    np.testing.assert_allclose((M @ N)(p), M(p) @ N(p), atol=ROUNDING * 10)


ROOT = UserFunctions(
    (np.ones_like, lambda p: np.sqrt(p + 1)),
    0.0,
    13.0,
    derivatives=(np.zeros_like, lambda p: 0.5 / np.sqrt(p + 1)),
)


def test_functions_of_any_kind_have_sums_and_products_with_their_slopes():
    """sqrt(p + 1) beside itself, beside sines and beside polynomials: as many functions as are
    independent, values to rounding. Without slopes there are none of the product.
    """
    sines = UserFunctions((np.sin, np.ones_like), 0.0, 13.0, derivatives=(np.cos, np.zeros_like))
    p = np.linspace(0.0, 13.0, 40)
    M = random(ROOT, 2, 2)
    for basis, sums, products in ((ROOT, 2, 3), (sines, 3, 4), (Polynomial(2, 0.0, 13.0), 4, 6)):
        N = random(basis, 2, 2, seed=1)
        assert ((M + N).basis.size, (M @ N).basis.size) == (sums, products)
        np.testing.assert_allclose((M + N)(p), M(p) + N(p), atol=1e-11)
        np.testing.assert_allclose((M @ N)(p), M(p) @ N(p), atol=1e-10)
        slope = np.tensordot((M @ N).basis(p, 1), (M @ N).coefficients, axes=1)
        by_hand = M.basis(p, 1), N.basis(p, 1)
        dM, dN = (
            np.tensordot(d, X.coefficients, axes=1) for d, X in zip(by_hand, (M, N), strict=True)
        )
        np.testing.assert_allclose(slope, dM @ N(p) + M(p) @ dN, atol=1e-9)
    bare = random(UserFunctions((np.ones_like, np.cbrt), 0.0, 13.0), 2, 2)
    with pytest.raises(InputError, match="no known derivative"):
        (bare @ M).basis(1.0, 1)


def test_functions_that_are_nearly_dependent_count_once():
    """p and p + 1e-14 sin p are one function to rounding; p + 1e-6 sin p is another one."""
    for size, count in ((1e-14, 2), (1e-6, 3)):
        near = UserFunctions((np.ones_like, lambda p, e=size: p + e * np.sin(p)), 0.0, 13.0)
        assert sum_space(near, Polynomial(1, 0.0, 13.0)).size == count


def test_user_functions_beside_splines_are_refused():
    M, N = random(ROOT, 2, 2), random(BASES[2], 2, 2)
    for operation in (lambda: M @ N, lambda: M + N):
        with pytest.raises(InputError, match=r"UserFunctions.* no basis in common"):
            operation()
    assert (M + M).basis == ROOT


def test_matrices_without_rows_or_columns_are_matrices():
    M = random(BASES[2], 0, 3)
    assert (M @ random(BASES[1], 3, 2)).shape == (0, 2)
    assert (random(BASES[1], 2, 0) @ random(BASES[2], 0, 3))(np.array([1.0])).tolist() == [
        [[0.0] * 3] * 2
    ]
