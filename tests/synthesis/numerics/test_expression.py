"""Inequalities as one writes them: their arithmetic, their names, what decides."""

import cvxpy
import numpy as np
import pytest

from symheli.errors import InputError
from symheli.lpv import Polynomial
from symheli.lpv.bases import BSpline
from synthesis import Solver
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.program.affine_program import AffineProgram, cells
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.expression import block

BOX = ((0.0, 2.0),)
CUBIC, CONSTANT = Polynomial(3, 0.0, 2.0), Polynomial(0, 0.0, 2.0)


@pytest.fixture
def made():
    """A program with P(p), cubic, and a number; a known matrix, a point, values of p."""
    rng = np.random.default_rng(1)
    program = AffineProgram()
    P, number = program.symmetric(2, CUBIC), program.full(1, 1, CONSTANT)
    A = PolynomialMatrix(BOX, rng.normal(size=(3, 2, 2)))
    return program, P, number, A, rng.normal(size=program.count), rng.uniform(0, 2, (5, 1))


def test_arithmetic_is_that_of_the_values(made):
    _, P, number, A, x, p = made
    X, e = P.on(BOX), number.on(BOX)
    C = np.array([[1.0, -2.0]])
    found = 3 * (A.T @ X + X @ A) - 2 * (C.T @ e @ C) + np.eye(2) - X.derivative(0) * 0.5 - (-X)
    values, known = P.at(x, p), A(p)
    slopes = P.unknown.moving(P.coefficients(x).reshape(4, 2, 2), p, np.ones(1))
    both = np.swapaxes(known, -1, -2) @ values + values @ known
    outer = float(number.at(x, p)[0, 0, 0]) * C.T @ C
    expected = 3 * both - 2 * outer + np.eye(2) - 0.5 * slopes + values
    np.testing.assert_allclose(found.at(x)(p), expected, rtol=1e-10, atol=1e-10)


def test_blocks_take_known_and_unknown_ones(made):
    _, P, number, A, x, p = made
    X, e = P.on(BOX), number.on(BOX)
    C = PolynomialMatrix.constant(np.array([[1.0, -2.0]]), BOX)
    found = block([[X @ A, C.T], [C, e]]).at(x)(p)
    np.testing.assert_allclose(found[:, :2, :2], P.at(x, p) @ A(p), rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(found[:, 2:, :2], C(p))
    assert isinstance(block([[A, A]]), PolynomialMatrix)


def test_a_spline_is_written_piece_by_piece():
    spline = BSpline(2, (0.0, 1.0, 2.0))
    program = AffineProgram()
    P = program.symmetric(2, spline)
    x = np.random.default_rng(0).normal(size=program.count)
    for low, high in ((0.0, 1.0), (1.0, 2.0)):
        p = np.linspace(low, high, 7)[:, None]
        np.testing.assert_allclose(P.on(((low, high),)).at(x)(p), P.at(x, p), atol=1e-12)


def test_what_is_not_affine_is_refused(made):
    _, P, number, A, *_ = made
    X = P.on(BOX)
    for product in (lambda: X @ X, lambda: X * number.on(BOX)):
        with pytest.raises(InputError, match="the product of two unknown matrices is not affine"):
            product()
    with pytest.raises(InputError, match="expected matrices of one shape"):
        X + np.ones((1, 2))
    with pytest.raises(InputError, match="products: F @ G"):
        X * A


def test_the_rows_are_those_of_the_other_way_to_impose_them(made):
    """`positive` with arrays at the nodes of a cell imposes the same inequality."""
    program, P, _, A, _, _ = made
    (cell,) = cells(BOX, (5,))
    F = program.value(P) @ A(cell.nodes)
    program.positive(cell, -(F + np.swapaxes(F, -1, -2)))
    program.require(-(P.on(BOX) @ A + A.T @ P.on(BOX)) >> 0, "the same", margin=1e-8)
    program.cone_program(np.zeros(program.count))
    (first, b), (second, c) = (
        tuple(map(np.vstack, zip(*((A.toarray(), b[:, None]) for A, b in rows), strict=True)))
        for rows in (program._positive[:6], program._positive[6:])
    )
    np.testing.assert_allclose(second, first, atol=1e-10)
    np.testing.assert_allclose(c, b, atol=1e-12)


@pytest.mark.parametrize("solver", ["CLARABEL", "SCS"])
def test_the_inequality_that_decides_is_named(solver):
    """The least t with t >= 1 and t >= 2 rests on the second."""
    program = AffineProgram()
    t = program.full(1, 1, CONSTANT).on(BOX)
    program.require(t >> 1, "at least one")
    program.require(t >> 2, "at least two")
    found = program.minimise(t, Solver(solver))
    (name, share), *_ = program.deciding(found)
    assert (name, t.at(found.x)([1.0]).item()) == ("at least two", pytest.approx(2.0, abs=1e-4))
    assert share > 0.999
    assert program.said(found).endswith("it rests on at least two")


def test_a_contradiction_is_named():
    program = AffineProgram()
    t = program.full(1, 1, CONSTANT).on(BOX)
    for name, inequality in {"high": t >> 2, "low": t << 1}.items():
        program.require(inequality, name)
    found = program.minimise(t, Solver("CLARABEL"))
    assert found.answer is Answer.INFEASIBLE
    named = dict(program.deciding(found))
    assert named["high"] == pytest.approx(0.5, abs=1e-6)
    assert named["low"] == pytest.approx(0.5, abs=1e-6)


def test_cvxpy_takes_the_same_program():
    """The least trace of P(p) >= F(p) F(p)' at p = 0, beside Clarabel called directly."""
    program = AffineProgram()
    P = program.symmetric(2, CUBIC).on(BOX)
    F = PolynomialMatrix(BOX, np.array([[[1.0], [0.0]], [[0.0], [1.0]]]))
    one = PolynomialMatrix.constant(np.eye(1), BOX)
    program.require(block([[P, F], [F.T, one]]) >> 0, "above")
    t = program.full(1, 1, CONSTANT).on(BOX)
    program.require(np.ones((1, 2)) @ P @ np.ones((2, 1)) << t, "sum")
    direct = program.minimise(t, Solver("CLARABEL"))
    problem, x = program.cone_program(t).to_cvxpy()
    problem.solve(solver=cvxpy.CLARABEL)
    assert t.at(np.asarray(x.value))([0.0]).item() == pytest.approx(
        t.at(direct.x)([0.0]).item(), abs=1e-6
    )
    with pytest.raises(InputError, match="a number that does not depend on p"):
        program.minimise(P, Solver("CLARABEL"))
