"""Functions of the scheduling parameter, and the parameter itself."""

import math

import numpy as np
import pytest
from scipy import interpolate
from scipy.interpolate import BPoly

from symheli import Scheduling
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import BSpline, CubicSpline, PiecewiseLinear, Polynomial, Product, UserFunctions
from symheli.lpv.bases import Patches
from symheli.values.units import to_si

NODES = (0.0, 1.0, 3.0, 7.0, 13.0)
BASES = [
    Polynomial(4, 0.0, 13.0),
    CubicSpline(NODES),
    PiecewiseLinear(NODES),
    BSpline(3, NODES),
    BSpline(2, NODES),
]


BOX = Product((Polynomial(2, 0.0, 13.0), Polynomial(3, 0.9, 1.3)))


def test_polynomials_are_orthonormal_over_the_range():
    basis = Polynomial(5, 0.0, 13.0)
    x, weights = np.polynomial.legendre.leggauss(12)
    f = basis(6.5 + 6.5 * x)
    np.testing.assert_allclose(f.T * weights / 2 @ f, np.eye(6), atol=1e-13)


def test_monomial_coefficients_go_back_and_forth():
    basis, given = (
        Polynomial(3, 2.0, 9.0),
        np.array([[1.0, -2.0], [0.5, 0.0], [0.0, 3.0], [0.1, 0.2]]),
    )
    inside = basis.from_monomial(given)
    np.testing.assert_allclose(basis.to_monomial(inside), given, atol=1e-12)
    p = np.linspace(2, 9, 7)
    np.testing.assert_allclose(
        basis(p) @ inside, np.polynomial.polynomial.polyval(p, given).T, atol=1e-11
    )


FORMS = {
    "monomial": lambda p, j: p**j,
    "scaled": lambda p, j: ((2 * p - 11) / 7) ** j,
    "legendre": lambda p, j: np.polynomial.legendre.legval((2 * p - 11) / 7, np.eye(5)[j]),
    "chebyshev": lambda p, j: np.polynomial.chebyshev.chebval((2 * p - 11) / 7, np.eye(5)[j]),
    "bernstein": lambda p, j: math.comb(4, j) * ((p - 2) / 7) ** j * ((9 - p) / 7) ** (4 - j),
}


@pytest.mark.parametrize("name", FORMS)
def test_each_form_of_a_polynomial_is_the_same_polynomial(name):
    basis, p = Polynomial(4, 2.0, 9.0), np.linspace(2, 9, 11)
    coefficients = np.random.default_rng(1).normal(size=5)
    written = basis.form(name).T @ coefficients
    # 1e-10: monomials on 2-9 m/s cancel by up to 1e5
    np.testing.assert_allclose(
        sum(written[j] * FORMS[name](p, j) for j in range(5)), basis(p) @ coefficients, atol=1e-10
    )


@pytest.mark.parametrize("total", [None, 2])
def test_products_are_products_and_their_forms_are_products_of_forms(total):
    basis = Product((Polynomial(2, 0.0, 13.0), Polynomial(2, 0.9, 1.3)), total)
    assert basis.size == (9 if total is None else 6)
    p = np.random.default_rng(2).uniform([0, 0.9], [13, 1.3], (5, 2))
    coefficients = np.random.default_rng(3).normal(size=basis.size)
    by_hand = sum(
        c * basis.factors[0](p[:, 0])[:, i] * basis.factors[1](p[:, 1])[:, j]
        for c, (i, j) in zip(coefficients, basis.indices, strict=True)
    )
    np.testing.assert_allclose(basis(p) @ coefficients, by_hand, atol=1e-12)
    monomial = basis.form("monomial").T @ coefficients
    powers = sum(
        c * p[:, 0] ** i * p[:, 1] ** j for c, (i, j) in zip(monomial, basis.indices, strict=True)
    )
    np.testing.assert_allclose(
        powers, by_hand, atol=1e-9
    )  # monomials on 0.9-1.3 cancel by up to 1e4


def test_products_of_orthonormal_polynomials_are_orthonormal_over_the_box():
    x, weights = np.polynomial.legendre.leggauss(8)
    first, second = np.meshgrid(6.5 + 6.5 * x, 1.1 + 0.2 * x, indexing="ij")
    f = BOX(np.stack([first, second], axis=-1))
    gramian = np.einsum("a,b,abi,abj->ij", weights / 2, weights / 2, f, f)
    np.testing.assert_allclose(gramian, np.eye(12), atol=1e-13)


def test_b_splines_add_up_to_one_are_local_and_of_degree_one_are_hats():
    basis, p = BSpline(3, NODES), np.linspace(0, 13, 53)
    np.testing.assert_allclose(basis(p).sum(axis=1), 1.0, atol=1e-14)
    assert np.count_nonzero(basis(2.0)) == 4
    np.testing.assert_allclose(BSpline(1, NODES)(p), PiecewiseLinear(NODES)(p), atol=1e-14)


def test_functions_brought_along_are_taken_as_they_are():
    basis = UserFunctions(
        (np.ones_like, np.sqrt, lambda p: np.exp(-p)), 0.0, 13.0, ("1", "root", "decay")
    )
    np.testing.assert_allclose(basis([4.0, 9.0]), [[1, 2, math.exp(-4)], [1, 3, math.exp(-9)]])


@pytest.mark.parametrize("basis", BASES, ids=lambda b: type(b).__name__)
def test_derivatives_agree_with_differences(basis):
    p, h = np.array([0.5, 2.2, 5.0, 11.9]), 1e-5
    np.testing.assert_allclose(basis(p, 1), (basis(p + h) - basis(p - h)) / (2 * h), atol=1e-8)


@pytest.mark.parametrize("basis", BASES, ids=lambda b: type(b).__name__)
def test_bernstein_pieces_are_the_functions(basis):
    for piece in basis.pieces():
        p = np.linspace(piece.low, piece.high, 6)
        for j in range(basis.size):
            np.testing.assert_allclose(
                BPoly(piece.bernstein[j][:, None], [piece.low, piece.high])(p),
                basis(p)[:, j],
                atol=1e-11,
            )


def test_spline_is_the_cubic_spline_through_values():
    values = np.sin(NODES)
    p = np.linspace(0, 13, 40)
    np.testing.assert_allclose(
        CubicSpline(NODES)(p) @ values, interpolate.CubicSpline(NODES, values)(p), atol=1e-12
    )
    np.testing.assert_allclose(
        PiecewiseLinear(NODES)(p) @ values, np.interp(p, NODES, values), atol=1e-12
    )


@pytest.mark.parametrize("basis", BASES, ids=lambda b: type(b).__name__)
def test_fit_recovers_coefficients_and_counts_its_nodes(basis):
    rng = np.random.default_rng(0)
    coefficients, p = rng.standard_normal((basis.size, 2, 3)), np.linspace(0, 13, 30)
    np.testing.assert_allclose(
        basis.fit(p, np.tensordot(basis(p), coefficients, 1)), coefficients, atol=1e-10
    )
    with pytest.raises(InputError, match=rf"needs {basis.size} distinct nodes, got 2"):
        basis.fit([1.0, 2.0, 2.0], np.zeros(3))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: BSpline(0, NODES), "degree must be an integer >= 1"),
        (lambda: BSpline(2, (1.0, 1.0)), "strictly increasing breakpoints"),
        (
            lambda: UserFunctions((np.log,), 0.0, 1.0),
            "function f0: expected finite numbers.*not finite",
        ),
        (lambda: UserFunctions((), 0.0, 1.0), "at least one callable"),
        (
            lambda: UserFunctions((np.cos,), 0.0, 1.0).pieces(),
            "not known to be piecewise polynomial",
        ),
        (lambda: UserFunctions((np.cos,), 0.0, 1.0)(0.5, 1), "no known derivative"),
        (lambda: UserFunctions((np.cos,), 0.0, 1.0).form("monomial"), "has no 'monomial' form"),
        (lambda: Product((Polynomial(1, 0, 1),)), "at least two"),
        (
            lambda: Product((Polynomial(1, 0, 1), BSpline(1, NODES)), total_degree=1),
            "total_degree is for polynomial",
        ),
        (lambda: BOX([0.5, 1.0, 2.0]), "expected 2 along the last axis"),
        (lambda: BOX([0.5, 7.0]), r"scheduling parameter 2 of 2 spans \[7, 7\]"),
        (lambda: Polynomial(1, 0, 1).form("monomail"), "did you mean 'monomial'"),
        (
            lambda: Product((Polynomial(1, 0, 1),) * 2, total_degree=1).form("bernstein"),
            "mixes degrees",
        ),
        (lambda: Polynomial(-1, 0, 1), "degree: expected a whole number"),
        (lambda: Polynomial(2, 5.0, 5.0), "low < high"),
        (lambda: CubicSpline((0.0, 1.0, 2.0)), "at least 4 strictly increasing"),
        (lambda: PiecewiseLinear((0.0, 0.0)), "strictly increasing"),
        (lambda: Polynomial(1, 0, 1).from_monomial([1, 2, 3]), "degree 2 does not fit"),
        (lambda: Polynomial(1, 0, 1)(1.1), "declare the basis over the whole range"),
        (lambda: Scheduling("p", "1", 1.0, 0.0), "low < high"),
        (lambda: Scheduling("p", "1", 0.0, 1.0, -1.0), "rate must be >= 0"),
        (lambda: Scheduling("p", "1", 0.0, math.nan), "finite"),
    ],
)
def test_what_cannot_be_is_refused_when_made(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_scheduling_knows_middle_radius_and_rate():
    p = Scheduling("airspeed", "m/s", 2.0, 12.0)
    assert (p.middle, p.radius, p.rate) == (7.0, 5.0, math.inf)
    assert p.with_rate(3.0).rate == 3.0
    np.testing.assert_array_equal(
        p.check([2.0, 12.0 + 1e-9]), [2.0, 12.0 + 1e-9]
    )  # rounding passes


@pytest.mark.parametrize(
    ("unit", "factor", "si"),
    [
        ("deg", math.pi / 180, "rad"),
        ("kt", 1852 / 3600, "m/s"),
        ("ft", 0.3048, "m"),
        ("rpm", math.pi / 30, "rad/s"),
        ("ms", 1e-3, "s"),
    ],
)
def test_units_convert_to_si(unit, factor, si):
    assert to_si(unit) == (pytest.approx(factor, rel=1e-15), si)


def test_a_misspelt_unit_gets_the_nearest():
    with pytest.raises(UnknownNameError, match="did you mean 'deg/s'"):
        to_si("deg/sec")


@pytest.mark.parametrize(
    ("degree", "breaks", "message"),
    [
        (-1, (0.0, 1.0), "degree: expected 0 or more"),
        (2, (0.0,), "breaks: expected at least two increasing"),
        (2, (0.0, 2.0, 1.0), "breaks: expected at least two increasing"),
    ],
)
def test_patches_without_an_interval_or_a_degree_are_refused(degree, breaks, message):
    with pytest.raises(InputError, match=message):
        Patches(degree, breaks)


def test_patches_give_back_polynomials_that_jump():
    basis = Patches(2, (0.0, 1.0, 4.0))
    p = basis.points(5)
    values = np.where(p < 1, 1 + p**2, 7 - p)
    np.testing.assert_allclose(basis(p) @ basis.fit(p, values), values, atol=1e-12)
    sides = [piece.bernstein.T @ basis.fit(p, values) for piece in basis.pieces()]
    # Bernstein coefficients begin and end with the values at the ends: 2 on one side of the jump, 6
    # on the other
    assert (sides[0][-1], sides[1][0]) == pytest.approx((2.0, 6.0))


@pytest.mark.parametrize(
    "basis",
    [
        Polynomial(2, 0.0, 13.0),
        PiecewiseLinear((0.0, 4.0, 13.0)),
        CubicSpline((0.0, 2.0, 5.0, 13.0)),
        BSpline(2, (0.0, 4.0, 13.0)),
        Patches(3, (0.0, 4.0, 13.0)),
    ],
)
def test_the_constant_of_every_basis_is_one_everywhere(basis):
    p = np.linspace(0.0, 13.0, 41)
    np.testing.assert_allclose(basis(p) @ basis.constant(), 1.0, atol=1e-13)
