"""A quasi-LPV model made of nonlinear equations is those equations, to rounding."""

import casadi
import numpy as np
import pytest

import symheli
from symheli.errors import InputError, UnknownNameError

SX = casadi.SX
X, U = SX.sym("x", 2), SX.sym("u")
BOX = {"x1": (-2.0, 2.0), "x2": (-1.0, 3.0)}
INPUT = {"u": (-1.0, 1.0)}


def function(*rows, outputs=()):
    found = [casadi.vertcat(*rows), *([casadi.vertcat(*outputs)] if outputs else [])]
    return casadi.Function("f", [X, U], found)


MIXED = function(X[0] * X[1] + U * casadi.cos(X[0]), -(X[1] ** 3) / (1 + X[0] ** 2) + U)
VAN_DER_POL = function(X[1], (1 - X[0] ** 2) * X[1] - X[0] + U)


def states(count, seed=1):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-2, 2, count), rng.uniform(-1, 3, count)]), rng.uniform(
        -1, 1, (count, 1)
    )


@pytest.mark.slow(but="at1-f1")
@pytest.mark.parametrize("f", [MIXED, VAN_DER_POL])
@pytest.mark.parametrize("at", [{}, {"x1": 0.3, "x2": 1.0, "u": 0.2}])
def test_the_embedding_is_the_nonlinear_model(f, at):
    found = symheli.embedding.embed(f, BOX, INPUT, at=at)
    for x, u in zip(*states(50), strict=True):
        np.testing.assert_allclose(
            found.derivative(x, u), np.array(f(x, u)).ravel(), rtol=1e-11, atol=1e-12
        )
    assert found.error < 1e-12
    assert str(found).startswith(f"{len(found.model.parameters)} scheduling parameter")


def test_the_parameters_may_be_told_to_depend_on_some_variables_only():
    """Van der Pol's equation is affine in x2 and u: (1 - x1^2) is the one parameter of A."""
    found = symheli.embedding.embed(VAN_DER_POL, BOX, INPUT, scheduled_by=["x1"])
    p = found.parameters([0.7, -0.5], [0.3])
    np.testing.assert_array_equal(p, found.parameters([0.7, 2.5], [-0.9]))
    names = [s.name for s in found.model.parameters]
    assert names == ["A[x2, x2]"]
    assert p[0] == pytest.approx(1 - 0.49, abs=1e-14)
    low, high = found.model.parameters[0].low, found.model.parameters[0].high
    assert low <= 1 - 4.0
    assert high >= 1.0
    with pytest.raises(InputError, match="x2 cannot be factored: it is not affine in x2"):
        symheli.embedding.embed(MIXED, BOX, INPUT, scheduled_by=["x1"])
    with pytest.raises(UnknownNameError, match="state or input"):
        symheli.embedding.embed(MIXED, BOX, INPUT, scheduled_by=["x3"])


def test_parameters_depend_on_the_fewest_variables():
    """A cart's pendulum, 9.81 sin x1 + u cos x1: affine in u and x2, so the parameters are
    9.81 sin(x1)/x1 and cos x1; x1 x2 asks for one of both, u x2 for the state.
    """
    found = symheli.embedding.embed(
        function(X[1], 9.81 * casadi.sin(X[0]) + casadi.cos(X[0]) * U), BOX, INPUT
    )
    assert [s.name for s in found.model.parameters] == ["A[x2, x1]", "B[x2, u]"]
    for x1, x2, u in ((0.7, -0.5, 0.3), (-1.9, 2.0, -1.0)):
        p = found.parameters([x1, x2], [u])
        assert p == pytest.approx([9.81 * np.sin(x1) / x1, np.cos(x1)], rel=1e-12)
    product = symheli.embedding.embed(function(X[0] * X[1], U), BOX, INPUT)
    assert len(product.model.parameters) == 1
    by_state = symheli.embedding.embed(function(X[0], U * X[1]), BOX, INPUT)
    assert [s.name for s in by_state.model.parameters] == ["B[x2, u]"]


def test_ranges_are_asked_for_by_name():
    for given in (["u"], {"u": 1.0}, {"u": (-1.0, 0.0, 1.0)}):
        with pytest.raises(InputError, match="two numbers a name"):
            symheli.embedding.embed(VAN_DER_POL, BOX, given)


def test_outputs_are_embedded_too():
    f = function(X[1], -X[0] + U, outputs=[casadi.sin(X[0]), X[1]])
    found = symheli.embedding.embed(f, BOX, INPUT, outputs=["height", "speed"])
    model = found.model
    assert model.outputs == ("height", "speed")
    p = found.parameters([1.2, 0.4], [0.0])
    np.testing.assert_allclose(model.at(*p).C @ [1.2, 0.4], [np.sin(1.2), 0.4], rtol=1e-12)
    assert [s.name for s in model.parameters] == ["C[height, x1]"]


@pytest.mark.parametrize(
    ("f", "message"),
    [
        (function(casadi.fabs(X[0] - 0.5), U), r"x1 is not smooth enough.*kinks \(fabs\)"),
        (function(X[1], -X[0] + U), "the model is linear"),
        (casadi.Function("f", [X], [X]), "a casadi.Function of"),
        (casadi.Function("f", [X, U], [X[0]]), "returns 1 derivatives"),
    ],
)
def test_what_cannot_be_embedded_is_refused_with_the_reason(f, message):
    with pytest.raises(InputError, match=message):
        symheli.embedding.embed(f, BOX, INPUT)


@pytest.mark.slow
def test_the_helicopter_is_embedded_about_a_trim(ideal):
    """Six degrees of freedom with implicit inflow and flapping, within .2 m/s, .06 rad/s, 1 deg."""
    point = symheli.trim(ideal, 8.0)
    size = {"u": 0.2, "v": 0.1, "w": 0.1, "p": 0.06, "q": 0.06, "r": 0.06, "phi": 0.02}
    size |= {"theta": 0.02, "a1": 0.003, "b1": 0.003}
    x, u = SX.sym("x", 10), SX.sym("u", 4)
    f = casadi.Function("f", [x, u], [ideal.rhs(x, u, casadi.DM.zeros(3))])
    at = {**{s: point.x[s] for s in ideal.states}, **{s: point.u[s] for s in ideal.inputs}}
    found = symheli.embedding.embed(
        f,
        {s: (at[s] - size[s], at[s] + size[s]) for s in ideal.states},
        {s: (at[s] - 0.003, at[s] + 0.003) for s in ideal.inputs},
        at=at,
    )
    assert found.error < 1e-11
    assert np.abs(found.offset).max() < 1e-9  # a trim
    exact = symheli.linearize(ideal, point)
    here = found.model.at(*found.parameters(found.x0.array, found.u0.array))
    np.testing.assert_allclose(here.A, exact.A, rtol=1e-8, atol=1e-8)
