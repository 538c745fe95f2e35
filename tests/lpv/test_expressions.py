"""Models written down as expressions are those expressions, exactly."""

from dataclasses import replace

import casadi
import numpy as np
import pytest
import sympy

from symheli import LFT, LPVStateSpace, Scheduling
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import UserFunctions
from synthesis import l2_gain

P = Scheduling("rho", "1", low=-0.5, high=2.0, rate=1.0)
Q = Scheduling("mass", "kg", low=7.0, high=9.5)
p, q = P.symbol, Q.symbol
RNG = np.random.default_rng(0)
POINTS = np.column_stack([RNG.uniform(-0.5, 2.0, 50), RNG.uniform(7.0, 9.5, 50)])

POLYNOMIAL = ([[-1 - p**2, p], [0.1, -2 * q]], [[0], [1 + p * q**2]], [[1, p]], [[0.3]])
RATIONAL = (
    [[-1 / q, p / (1 + p**2)], [p**3 - 0.1, -2]],
    [[1 / q], [(1 + p) / (q + p)]],
    [[1, p]],
    [[0.3]],
)
OTHER = (
    [[-2 + sympy.sin(p), p], [0.1, -sympy.sqrt(q)]],
    [[0], [p * q]],
    [[1, sympy.cos(p) * q + 1 / (1 + q)]],
    [[0]],
)


def same(model, matrices):
    """To the last digits, at random points."""
    symbols = sorted(set().union(*(sympy.Matrix(M).free_symbols for M in matrices)), key=str)
    order = [["rho", "mass"].index(str(s)) for s in symbols]
    names = [["rho", "mass"].index(s.name) for s in model.parameters]
    exact = [sympy.lambdify(symbols, sympy.Matrix(M)) for M in matrices]
    for point in POINTS:
        frozen = model.at(*point[names])
        for found, M in zip((frozen.A, frozen.B, frozen.C, frozen.D), exact, strict=True):
            np.testing.assert_allclose(found, M(*point[order]), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("matrices", [POLYNOMIAL, OTHER])
def test_an_lpv_model_of_expressions_is_exact(matrices):
    model = LPVStateSpace.from_expressions(*matrices, [P, Q], inputs=["u"], outputs=["y"])
    same(model, matrices)
    assert (model.states, model.inputs, model.outputs) == (("x1", "x2"), ("u",), ("y",))


@pytest.mark.parametrize("matrices", [POLYNOMIAL, RATIONAL])
def test_an_lft_of_expressions_is_exact(matrices):
    same(LFT.from_expressions(*matrices, [P, Q]), matrices)


def test_one_parameter_and_sympy_matrices():
    matrices = [sympy.Matrix(M) for M in ([[-3 * (1 - p)]], [[3 * p * (2 - p)]], [[1]], [[0]])]
    model = LPVStateSpace.from_expressions(*matrices, P, dt=0.1)
    assert model.dt == 0.1
    same(model, matrices)
    decaying = LPVStateSpace.from_expressions([[sympy.exp(-p) - 3]], [[1]], [[1]], [[0]], P)
    same(decaying, ([[sympy.exp(-p) - 3]], [[1]], [[1]], [[0]]))


@pytest.mark.parametrize("kind", [casadi.SX, casadi.MX])
def test_casadi_expressions_are_the_same_models(kind):
    """As a matrix, and as entries of a list; numbers of CasADi too."""
    v = kind.sym("rho")
    A = casadi.vertcat(casadi.horzcat(-2 + casadi.sin(v), v), casadi.horzcat(0.1, -casadi.exp(v)))
    model = LPVStateSpace.from_expressions(A, [[0], [v**2]], [[1, 1 / (3 + v)]], casadi.DM(0.5), P)
    expected = [[-2 + sympy.sin(p), p], [0.1, -sympy.exp(p)]]
    same(model, (expected, [[0], [p**2]], [[1, 1 / (3 + p)]], [[0.5]]))
    assert "0" not in model.basis.names
    rational = LFT.from_expressions([[-1 / (1 + v**2)]], [[1]], [[1]], [[0]], P)
    same(rational, ([[-1 / (1 + p**2)]], [[1]], [[1]], [[0]]))


def test_expressions_of_a_basis_know_their_slopes_in_any_unit():
    basis = UserFunctions.from_expressions([1, sympy.sin(p), 1 / (3 + p)], P)
    at = POINTS[:, 0]
    slopes = np.column_stack([0 * at, np.cos(at), -1 / (3 + at) ** 2])
    np.testing.assert_allclose(basis(at, 1), slopes, rtol=1e-12, atol=1e-15)
    model = LPVStateSpace(
        basis, *np.ones((4, 3, 1, 1)), (replace(P, unit="m"),), ("x",), ("u",), ("y",)
    )
    in_cm = model.with_scheduling(Scheduling("rho", "cm", low=-50.0, high=200.0))
    np.testing.assert_allclose(in_cm.basis(100 * at, 1), slopes / 100, rtol=1e-12, atol=1e-15)
    root = UserFunctions.from_expressions([1, sympy.sqrt(p + 0.5)], P)  # its slope has a pole
    for later in (lambda: root(at, 1), lambda: basis(at, 2)):
        with pytest.raises(InputError, match="no known derivative of this order"):
            later()


@pytest.mark.slow
def test_a_textbook_model_is_certified_as_it_is_written_down():
    """x' = -(1 + p) x + u: the gain is one over the slowest pole."""
    rho = Scheduling("p", "1", low=0.0, high=1.0, rate=0.1)
    plant = LPVStateSpace.from_expressions([[-1 - rho.symbol]], [[1]], [[1]], [[0]], rho)
    assert l2_gain(plant).gamma == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(
    ("kind", "matrices", "error", "message"),
    [
        (LPVStateSpace, RATIONAL, InputError, "LFT.from_expressions"),
        (
            LPVStateSpace,
            ([[casadi.sum1(casadi.MX.sym("rho", 2))]], [[1]], [[1]], [[0]]),
            InputError,
            "rho is a vector",
        ),
        (
            LPVStateSpace,
            ([[casadi.SX.sym("mas")]], [[1]], [[1]], [[0]]),
            UnknownNameError,
            "did you mean 'mass'",
        ),
        (LFT, OTHER, InputError, "no rational function"),
        (LPVStateSpace, ([[sympy.sin(p * q)]], [[1]], [[1]], [[0]]), InputError, "no product"),
        (LFT, ([[-1.0]], [[1]], [[1]], [[0]]), InputError, "a LinearModel holds"),
        (
            LFT,
            ([[sympy.Symbol("mas")]], [[1]], [[1]], [[0]]),
            UnknownNameError,
            "did you mean 'mass'",
        ),
        (LPVStateSpace, ([[p, 1]], [[1]], [[1]], [[0]]), InputError, r"expected A \(nx, nx\)"),
        (LPVStateSpace, ([[p / 0.0]], [[1]], [[1]], [[0]]), InputError, "real, finite"),
        (
            LPVStateSpace,
            ([["rho"], [1, 2]], [[1]], [[1]], [[0]]),
            InputError,
            "A: expected a matrix",
        ),
    ],
)
def test_what_cannot_be_held_is_refused_with_what_can(kind, matrices, error, message):
    with pytest.raises(error, match=message):
        kind.from_expressions(*matrices, [P, Q])


def test_a_denominator_that_vanishes_in_the_range_is_found():
    model = LFT.from_expressions([[-1 / (p - 1)]], [[1]], [[1]], [[0]], P)
    found = model.well_posed()
    assert found.holds is False
    assert found.where["rho"] == pytest.approx(1.0, abs=1e-6)
