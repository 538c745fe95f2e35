"""CasADi functions in SymPy and mpmath: every operation, and the whole model."""

from __future__ import annotations

import math

import casadi
import mpmath
import numpy as np
import pytest
import sympy

import symheli
from symheli.equations import evaluate, to_steps, to_sympy

OPERATIONS = {
    "sums and products": lambda x, y: x + y - 2 * x * y / (1 + y**2),
    "squares and roots": lambda x, y: (
        casadi.sqrt(x**2 + 1) + y**2 * casadi.constpow(x + 3, 0.3) + (2 + x) ** 1.5
    ),
    "trigonometry": lambda x, y: casadi.sin(x) * casadi.cos(y) + casadi.tan(x),
    "inverse trigonometry": lambda x, y: (
        casadi.atan2(x, y) + casadi.asin(x / 9) - casadi.acos(y / 9) * casadi.atan(x)
    ),
    "exponentials": lambda x, y: (
        casadi.exp(x) - casadi.log(4 + y) + casadi.tanh(x) + casadi.sinh(y) / casadi.cosh(y)
    ),
    "absolute values and signs": lambda x, y: (
        casadi.fabs(x) * casadi.sign(y) + casadi.floor(x) - casadi.ceil(y) + casadi.hypot(x, y)
    ),
    "branches": lambda x, y: (
        casadi.if_else(x < y, x, casadi.if_else(y <= 0, 3.0, y)) + casadi.if_else(x == y, 5.0, 0.0)
    ),
    "smaller and larger": lambda x, y: casadi.fmin(x, 2 * y) + casadi.fmax(x, y),
    "logic": lambda x, y: (
        casadi.if_else(casadi.logic_and(x > 0, y > 0), 1.0, 2.0)
        + casadi.logic_or(x > 1, casadi.logic_not(y != x))
    ),
    "powers": lambda x, y: (3 + x) ** (y / 4),
}
POINTS = ((0.3, -1.2), (-2.0, 0.7), (1.5, 1.5), (0.0, 2.0))


def in_floats(definitions, expressions, values):
    """Values of `to_steps`, one definition after the other."""
    known = {sympy.Symbol(name, real=True): value for name, value in values.items()}
    for symbol, expression in definitions:
        known[symbol] = expression.subs(known)
    return [float(e.subs(known)) for e in expressions]


@pytest.mark.parametrize("name", OPERATIONS)
@pytest.mark.parametrize("point", POINTS)
def test_every_operation_means_the_same_in_all_three(name, point):
    x, y = casadi.SX.sym("x"), casadi.SX.sym("y")
    f = casadi.Function("f", [x, y], [OPERATIONS[name](x, y)], ["x", "y"], ["z"])
    expected = pytest.approx(float(f(*point)), rel=1e-14, abs=1e-14)  # a few roundings
    assert float(evaluate(f, *point)[0][0]) == expected
    values = {"x": point[0], "y": point[1]}
    assert in_floats([], to_sympy(f)[0], values)[0] == expected
    definitions, (whole,) = to_steps(f)
    assert in_floats(definitions, whole, values)[0] == expected


def test_shapes_and_structural_zeros_are_kept():
    A = casadi.SX.sym("A", 2, 3)
    sparse = casadi.SX(2, 3)
    sparse[0, 2] = A[1, 0]
    f = casadi.Function("f", [A], [sparse, A.T], ["A"], ["sparse", "turned"])
    given = np.arange(6.0).reshape(2, 3)
    expected = [np.array(m) for m in f(given)]
    for got, right in zip(evaluate(f, given), expected, strict=True):
        np.testing.assert_array_equal(np.array(got.tolist(), float), right)
    assert to_sympy(f)[0] == sympy.Matrix([[0, 0, sympy.Symbol("A_1_0", real=True)], [0, 0, 0]])


def test_constants_are_the_binary_numbers_and_digits_are_kept():
    x = casadi.SX.sym("x")
    f = casadi.Function("f", [x], [casadi.sqrt(x) + 0.1], ["x"], ["y"])
    with mpmath.workdps(60):
        exact = mpmath.sqrt(2) + mpmath.mpf(0.1)
        assert abs(evaluate(f, 2.0, digits=50)[0][0] - exact) < mpmath.mpf(10) ** -49
        assert (
            abs(exact - mpmath.sqrt(2) - mpmath.mpf("0.1")) > mpmath.mpf(10) ** -20
        )  # 0.1 the float is not 1/10


def test_quotients_and_roots_follow_the_floating_point_rules():
    x = casadi.SX.sym("x")
    f = casadi.Function(
        "f",
        [x],
        [1 / x, casadi.sqrt(x - 1), casadi.if_else(x > 0, 1 / x, 7.0)],
        ["x"],
        ["a", "b", "c"],
    )
    inverse, root, guarded = (m[0] for m in evaluate(f, 0.0))
    assert mpmath.isinf(inverse)
    assert mpmath.isnan(root)
    assert guarded == 7


def test_unknown_operations_wrong_shapes_and_opaque_functions_are_refused_by_name():
    x = casadi.SX.sym("x")
    with pytest.raises(symheli.errors.InputError, match="OP_ERF"):
        evaluate(casadi.Function("f", [x], [casadi.erf(x)], ["x"], ["y"]), 0.1)
    f = casadi.Function("g", [x], [x])
    with pytest.raises(symheli.errors.InputError, match=r"shape \(1, 1\)"):
        evaluate(f, [1.0, 2.0])
    with pytest.raises(symheli.errors.InputError, match="takes 1 arguments"):
        to_sympy(f, 1, 2)
    table = casadi.interpolant("table", "linear", [[0, 1, 2, 3, 4]], [0, 1, 4, 9, 16])
    with pytest.raises(symheli.errors.InputError, match="no scalar operation"):
        evaluate(table, 0.5)


def test_mx_functions_are_expanded():
    x = casadi.MX.sym("x", 2)
    f = casadi.Function("f", [x], [casadi.mtimes(x.T, x)])
    assert evaluate(f, [3.0, 4.0])[0][0] == 25


def test_the_whole_right_hand_side_in_sympy_and_in_50_digits(heli):
    """A state off trim in 50 digits, floats and SymPy: one set of operations, three arithmetics."""
    point = symheli.trim(heli, 6.0)
    rng = np.random.default_rng(5)
    x, u, wind = (
        point.x.array + 0.05 * rng.normal(size=len(heli.states)),
        point.u.array,
        np.array([0.5, -1.0, 0.3]),
    )
    floats = np.array(heli.rhs(x, u, wind)).ravel()
    digits = np.array(evaluate(heli.rhs, x, u, wind)[0].tolist(), float).ravel()
    np.testing.assert_allclose(
        floats, digits, rtol=1e-12, atol=1e-12
    )  # rounding of some 1000 operations
    definitions, (xdot,) = to_steps(
        heli.rhs, *[[sympy.Float(float(v), 50) for v in argument] for argument in (x, u, wind)]
    )
    assert not definitions  # numbers in, numbers out: every branch is decided on the way
    np.testing.assert_allclose(np.array(xdot, float).ravel(), digits, rtol=1e-15, atol=1e-15)


@pytest.mark.slow
def test_right_hand_side_with_symbols_agrees_with_casadi_at_random_states_and_parameters(heli):
    """The same code through SymPy, every parameter a symbol; parameters changed at random in
    both.
    """
    equations = heli.sympy()
    rng = np.random.default_rng(7)
    function = sympy.lambdify(
        [
            equations.states,
            equations.inputs,
            equations.wind,
            equations.inflow,
            list(equations.parameters),
        ],
        [equations.xdot, equations.balance],
        cse=True,
    )
    values = {
        symbol: value * rng.uniform(0.9, 1.1) for symbol, value in equations.parameters.items()
    }
    values |= {
        symbol: 4.0 for symbol in equations.parameters if str(symbol).endswith(".blades")
    }  # no part of a blade
    changed = heli.with_parameters({str(symbol): value for symbol, value in values.items()})
    x0 = symheli.trim(heli, 8.0).x.array
    for _ in range(5):
        x, u = x0 + 0.2 * rng.normal(size=len(x0)), rng.uniform(-0.1, 0.2, 4)
        wind, lam = rng.normal(size=3), rng.uniform(0.01, 0.08, 2)
        for got, right in zip(
            function(x, u, wind, lam, list(values.values())),
            changed.implicit(x, u, wind, lam),
            strict=True,
        ):
            np.testing.assert_allclose(
                got, np.array(right), rtol=1e-12, atol=1e-12
            )  # rounding of some 400 operations


def test_implicit_form_at_the_solved_inflow_is_the_right_hand_side(heli):
    point = symheli.trim(heli, 5.0)
    x, u, wind = point.x.array, point.u.array, np.zeros(3)
    d = heli.compiled("diagnostics")(x=x, u=u, wind=wind)
    tail = heli.vehicle.values("tail_rotor")
    tip = tail["gear_ratio"] * heli.nominal_speed * tail["radius"]
    lam = np.array([float(d["lam0"]), float(d["V_itr"]) / tip])
    xdot, balance = (np.array(m).ravel() for m in heli.implicit(x, u, wind, lam))
    np.testing.assert_allclose(xdot, np.array(heli.rhs(x, u, wind)).ravel(), atol=1e-12)
    assert np.abs(balance).max() < 1e-15  # against terms of 2e-3: rounding
    assert math.isclose(
        float(d["Z"]), -float(d["T_mr"]), rel_tol=0.1
    )  # most of the vertical force is thrust
