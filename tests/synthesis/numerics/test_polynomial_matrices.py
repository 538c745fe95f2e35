"""Polynomial matrices over a box: an algebra that agrees with evaluation, in floats and in
rationals.
"""

import numpy as np
import pytest

from symheli import LFT, LPVStateSpace, Scheduling
from symheli.errors import InputError
from synthesis import l2_gain
from synthesis.analysis import PolynomialMatrix
from synthesis.certify.assemble.imposed import (
    coefficient_conditions,
    sums_of_squares,
    vertex_conditions,
)
from synthesis.numerics.polynomial.definite import negative_definite, negative_definite_exactly
from synthesis.numerics.polynomial.exact import exact, rational
from synthesis.numerics.polynomial.matrix import block
from synthesis.numerics.polynomial.pieces import pieces
from synthesis.numerics.polynomial.regions import convert
from synthesis.numerics.polynomial.symmetric import smat, svec

BOX = ((-1.0, 2.0), (0.5, 3.0))
POINTS = np.array([[-1.0, 0.5], [2.0, 3.0], [0.3, 1.7], [1.9, 0.6]])


def random(degrees, rows, columns, seed=0):
    return PolynomialMatrix(
        BOX, np.random.default_rng(seed).standard_normal((*(d + 1 for d in degrees), rows, columns))
    )


def test_algebra_is_pointwise():
    F, G, H = random((2, 1), 3, 2, 1), random((1, 3), 2, 4, 2), random((0, 2), 3, 2, 3)
    at = {M: M(POINTS) for M in (F, G, H)}
    # 1e-12: some tens of roundings of numbers of order one
    np.testing.assert_allclose((F @ G)(POINTS), at[F] @ at[G], atol=1e-12)
    np.testing.assert_allclose((F - 2.0 * H)(POINTS), at[F] - 2 * at[H], atol=1e-12)
    np.testing.assert_allclose((G.T @ F.T)(POINTS), np.swapaxes(at[F] @ at[G], 1, 2), atol=1e-12)
    np.testing.assert_allclose(
        (F.T @ F).congruence(G)(POINTS),
        np.swapaxes(at[G], 1, 2) @ np.swapaxes(at[F], 1, 2) @ at[F] @ at[G],
        atol=1e-11,
    )
    np.testing.assert_allclose(F.elevate((4, 2))(POINTS), at[F], atol=1e-12)
    np.testing.assert_allclose(
        block([[F, H], [H, F]])(POINTS), np.block([[at[F], at[H]], [at[H], at[F]]]), atol=1e-12
    )


@pytest.mark.parametrize("axis", [0, 1])
def test_derivative_and_halves(axis):
    F, h = random((3, 2), 2, 2), 1e-6
    step = h * np.eye(2)[axis]
    inside = POINTS[2:]
    # central differences of a cubic: h^2 f'''/6 plus rounding 1e-16/h
    np.testing.assert_allclose(
        F.derivative(axis)(inside), (F(inside + step) - F(inside - step)) / (2 * h), atol=1e-8
    )
    low, high = F.split(axis)
    middle = np.mean(BOX[axis])
    for p in POINTS:
        part = low if p[axis] <= middle else high
        np.testing.assert_allclose(part(p), F(p), atol=1e-11)


def test_a_sum_of_monomials_has_its_values():
    terms = {(0, 0): np.eye(2), (2, 1): np.array([[1.0, 2], [3, 4]]), (0, 3): -np.ones((2, 2))}
    F = PolynomialMatrix.from_monomials(terms, BOX)
    assert F.degrees == (2, 3)
    expected = [sum(p[0] ** a * p[1] ** b * M for (a, b), M in terms.items()) for p in POINTS]
    np.testing.assert_allclose(F(POINTS), expected, rtol=1e-13)


def test_rationals_agree_with_floats_and_are_exact():
    number = rational()
    F, G = random((2, 1), 2, 2, 4), random((1, 2), 2, 2, 5)
    f, g = convert(F, number), convert(G, number)
    np.testing.assert_allclose(
        (f @ g + f.elevate((3, 3))).coefficients.astype(float),
        (F @ G + F.elevate((3, 3))).coefficients,
        atol=1e-13,
    )
    # an identity of polynomials holds to the last bit: (F + G)'(F + G) = F'F + F'G + G'F + G'G,
    # also on a half of the box
    left = ((f + g).T @ (f + g)).split(0)[1]
    right = (f.T @ f + f.T @ g + g.T @ f + g.T @ g).split(0)[1]
    assert np.all(left.coefficients == right.coefficients)


def test_a_sum_of_squares_is_what_it_says():
    degrees, N = (3, 2), 2
    t = np.array([[0.0, 0.0], [0.2, 0.9], [0.7, 0.4], [1.0, 1.0]])
    unit = ((0.0, 1.0), (0.0, 1.0))
    terms = list(sums_of_squares(degrees, N))
    # t1 or 1 - t1 with squares of degree 1; 1 or t2 (1 - t2) with squares of degrees 1 and 0
    assert [term.size for term in terms] == [8, 4, 8, 4]
    weights = [
        t[:, 0],
        t[:, 0] * t[:, 1] * (1 - t[:, 1]),
        1 - t[:, 0],
        (1 - t[:, 0]) * t[:, 1] * (1 - t[:, 1]),
    ]
    for term, weight in zip(terms, weights, strict=True):
        R = np.random.default_rng(term.size).standard_normal((term.size, term.size))
        Q = R @ R.T
        S = PolynomialMatrix(unit, smat((term.map @ svec(Q)).reshape(4, 3, -1), N))(t)
        k2 = term.size // (2 * N) - 1
        for value, (t1, t2), w in zip(S, t, weight, strict=True):
            z = np.kron([1 - t1, t1], [1 - t2, t2] if k2 else [1.0])
            Z = np.kron(z[:, None], np.eye(N))
            np.testing.assert_allclose(value, w * Z.T @ Q @ Z, atol=1e-12)


def test_conditions_are_values_and_coefficients():
    F = random((3, 2), 1, 1)
    c = F.coefficients.reshape(12, -1)
    corners = (vertex_conditions(F.degrees).negative @ c).ravel()
    np.testing.assert_allclose(
        corners, F(np.array([[a, b] for a in BOX[0] for b in BOX[1]])).ravel(), atol=1e-14
    )
    halves = (coefficient_conditions(F.degrees, 0, 1).negative @ c).ravel()
    expected = np.concatenate(
        [q.coefficients.ravel() for half in F.split(0) for q in half.split(1)]
    )
    np.testing.assert_allclose(halves, expected, atol=1e-14)


@pytest.mark.parametrize("gap", [1e-2, 1e-4, -1e-4, -1e-2])
def test_definiteness_is_decided_between_the_coefficients(gap):
    """-(p1 - p2/2)^2 - gap: its coefficients are positive where the values are not; touches along a
    line for gap = 0.
    """
    F = PolynomialMatrix.from_monomials(
        {(2, 0): [[-1.0]], (1, 1): [[1.0]], (0, 2): [[-0.25]], (0, 0): [[-gap]]}, BOX
    )
    assert F.coefficients.max() > 0.1
    assert negative_definite(F) == (gap > 0)
    assert negative_definite_exactly(convert(F, rational())) == (gap > 0)


def test_a_model_from_an_lft_is_the_same_model():
    p, q = Scheduling("p", "1", 1.0, 3.0), Scheduling("q", "1", -1.0, 2.0, 0.5)
    A = {(0, 0): [[-1.0, 0.2], [0.0, -2.0]], (2, 1): [[0.1, 0.0], [0.3, 0.0]]}
    B, C, D = {(0, 1): [[1.0], [0.5]]}, {(0, 0): [[1.0, 0.0]]}, {(0, 0): [[0.0]]}
    model = LPVStateSpace.polynomial(A, B, C, D, [p, q])
    other = LFT.polynomial(A, B, C, D, [p, q]).reduce().to_lpv()
    ((A, _, C, _),) = pieces(other).models.values()
    assert A.degrees == (2, 1)
    assert C.degrees == (0, 0)
    points = np.array([[1.0, -1.0], [2.2, 0.7], [3.0, 2.0]])
    for one, two in zip(model.matrices(points), other.matrices(points), strict=True):
        np.testing.assert_allclose(one, two, atol=1e-11)
    line = model.along([1.0, -1.0], [3.0, 2.0])
    np.testing.assert_allclose(line.matrices(0.2).A, model.matrices([2.2, 0.8]).A, atol=1e-12)
    # q may move 0.5 per second and covers 1.5 per unit of the line
    assert line.scheduling.rate == pytest.approx(1 / 3)


def test_a_rational_lft_is_refused():
    s = Scheduling("p", "1", 1.0, 3.0)
    rational_loop = LFT.polynomial(
        {(0,): [[-1.0]], (1,): [[-0.2]]},
        {(0,): [[1.0]]},
        {(0,): [[1.0]]},
        {(0,): [[0.0]], (1,): [[0.3]]},
        [s],
    )
    with pytest.raises(InputError, match="rational function"):
        l2_gain(rational_loop.feedback({("u1", "y1"): 0.5}))


def test_wrong_input_gets_a_sentence():
    with pytest.raises(InputError, match="the boxes differ"):
        _ = random((1, 1), 2, 2) + PolynomialMatrix(
            ((0.0, 1.0), (0.0, 1.0)), np.zeros((1, 1, 2, 2))
        )
    with pytest.raises(InputError, match="exponents >= 0"):
        PolynomialMatrix.from_monomials({(1,): np.eye(2)}, BOX)
    with pytest.raises(InputError, match="axes of coefficients"):
        PolynomialMatrix(BOX, np.zeros((2, 2)))
    parameters = [Scheduling("p", "1", 0.0, 1.0)]
    with pytest.raises(InputError, match=r"B: expected matrices of shape \(2, 1\)"):
        LPVStateSpace.polynomial(
            {(0,): -np.eye(2)}, {(0,): [[1.0]]}, {(0,): [[1.0, 0]]}, {(0,): [[0.0]]}, parameters
        )


@pytest.mark.guard
def test_a_matrix_that_is_definite_to_rounding_only_is_not_shown_to_be():
    """Singular Gram matrices of integers less 1e-40: of either sign in doubles, indefinite."""
    number, rng = rational(), np.random.default_rng(0)
    tiny = number(1) / number(10) ** 40
    signs = []
    for _ in range(20):
        V = rng.integers(-9, 10, (3, 2))
        M = exact(V @ V.T, number) - tiny * np.eye(3, dtype=int).astype(object)
        signs.append(np.linalg.eigvalsh((V @ V.T).astype(float))[0] > 0)
        assert not negative_definite_exactly(PolynomialMatrix(((0.0, 1.0),), -M[None]))
    assert any(signs)
