"""One LPV state space over several scheduling parameters: whatever one can do, several can."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import symheli
from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import CubicSpline, PiecewiseLinear, Polynomial, Product, nu_gap
from symheli.lpv.tools import simulate

V = Scheduling("airspeed", "m/s", 0.0, 13.0, rate=3.0)
A_X = Scheduling("acceleration", "m/s^2", -4.0, 4.0, rate=10.0)
RNG = np.random.default_rng(5)


def entries(shape, exponents):
    return {e: RNG.uniform(-1, 1, shape) * 0.1 ** sum(e) for e in exponents}


EXPONENTS = ((0, 0), (1, 0), (0, 1), (2, 1))
GIVEN = {
    "A": {
        (0, 0): np.diag([-1.0, -2.0, -3.0]) + 0.3,
        (1, 0): 0.03 * RNG.uniform(-1, 1, (3, 3)),
        (0, 1): 0.05 * RNG.uniform(-1, 1, (3, 3)),
        (2, 1): 0.001 * RNG.uniform(-1, 1, (3, 3)),
    },
    "B": entries((3, 2), EXPONENTS),
    "C": entries((2, 3), EXPONENTS[:3]),
    "D": {(0, 0): RNG.uniform(-1, 1, (2, 2))},
}
POINTS = np.column_stack([RNG.uniform(0, 13, 7), RNG.uniform(-4, 4, 7)])


def model(**over):
    return LPVStateSpace.polynomial(**{**GIVEN, **over}, scheduling=(V, A_X))


def by_hand(name, v, a):
    return sum(v**i * a**j * np.asarray(M) for (i, j), M in GIVEN[name].items())


def test_the_matrices_are_those_of_the_monomials():
    found = model().matrices(POINTS)
    for name, values in zip("ABCD", found, strict=True):
        expected = np.stack([by_hand(name, *p) for p in POINTS])
        np.testing.assert_allclose(values, expected, atol=1e-13)
    np.testing.assert_array_equal(model().at(*POINTS[0]).B, model().matrices(POINTS[0]).B)


def test_an_lft_there_and_back_is_the_same_model():
    lft = model().to_lft()
    for v, a in POINTS:
        np.testing.assert_allclose(lft.at(v, a).A, by_hand("A", v, a), atol=1e-12)
    for back in (lft.to_lpv(), lft.reduce().to_lpv(), lft.to_lpv(degree=(4, 2))):
        assert back.parameters == (V, A_X)
        for one, two in zip(back.matrices(POINTS), model().matrices(POINTS), strict=True):
            np.testing.assert_allclose(one, two, atol=1e-11)
    coarse = lft.to_lpv(degree=1)
    off = coarse.matrices(coarse.residuals.nodes).A - coarse.residuals.A
    exact = np.stack([by_hand("A", *p) for p in coarse.residuals.nodes])
    np.testing.assert_allclose(off, exact, atol=1e-12)


def test_a_narrower_box_is_the_same_lft():
    inner = (Scheduling("airspeed", "m/s", 2.0, 6.0), Scheduling("acceleration", "m/s^2", 0, 3))
    lft = model().with_scheduling(inner).to_lft()
    np.testing.assert_allclose(lft.at(3.3, 1.7).A, by_hand("A", 3.3, 1.7), atol=1e-12)
    with pytest.raises(InputError, match=r"airspeed spans \[1, 1\]"):
        model().with_scheduling(inner).at(1.0, 1.0)


def test_feedback_closes_the_frozen_models():
    """C and B depend on both parameters: the closed loop is a polynomial of twice the degrees."""
    plant = model(D={(0, 0): np.zeros((2, 2))})
    gains = {("u1", "y2"): -0.4, ("u2", "y1"): 0.2}
    closed = plant.feedback(gains)
    for v, a in POINTS:
        expected = plant.at(v, a).feedback(gains)
        for name in "ABCD":
            np.testing.assert_allclose(
                getattr(closed.at(v, a), name), getattr(expected, name), atol=1e-12
            )
    assert closed.basis.degrees == (3, 2)  # V^2 a of B times V or a of C


def test_a_sampled_model_is_the_frozen_one_held_and_knows_its_misfit():
    sampled = model().discretize(0.02, degree=(4, 3))
    for v, a in POINTS:
        exact = model().at(v, a).discretize(0.02)
        np.testing.assert_allclose(sampled.at(v, a).A, exact.A, atol=1e-7)
    nodes = sampled.residuals.nodes
    held = model().at(*nodes[40]).discretize(0.02)
    np.testing.assert_allclose(
        sampled.at(*nodes[40]).A - sampled.residuals.A[40], held.A, atol=1e-13
    )


@pytest.mark.slow
def test_simulation_along_a_flight_converges_to_the_differential_equation():
    def p(t):
        return np.array([6 + 5 * np.sin(0.5 * t), 2.5 * np.cos(0.5 * t)])

    def u(t):
        return np.array([np.sin(t), 1.0])

    def f(t, x):
        A, B, *_ = model().matrices(p(t))
        return A @ x + B @ u(t)

    exact = solve_ivp(f, (0, 4), np.zeros(3), rtol=1e-10, atol=1e-12).y[:, -1]
    errors = []
    for dt in (0.02, 0.01, 0.005):
        t = dt * np.arange(round(4 / dt) + 1)
        middle = t + dt / 2  # held at the middle of each step: second order
        held = np.stack([p(s) for s in middle]), np.stack([u(s) for s in middle])
        x, _ = simulate(model(), *held, dt=dt)
        errors.append(np.abs(x[-1] - exact).max())
    order = np.log2(errors[0] / errors[2]) / 2
    assert 1.9 < order < 2.1
    assert errors[2] < 1e-5


@pytest.mark.slow
def test_reduction_keeps_the_response_over_the_box():
    """A fourth state hardly excited: three keep the response."""
    whole = model()
    A = np.pad(whole.A, ((0, 0), (0, 1), (0, 1)))
    A[0, 3, 3] = -50.0
    B = np.pad(whole.B, ((0, 0), (0, 1), (0, 0)))
    B[0, 3] = 1e-4
    C = np.pad(whole.C, ((0, 0), (0, 0), (0, 1)))
    C[0, :, 3] = 1e-3
    padded = LPVStateSpace(
        whole.basis, A, B, C, whole.D, (V, A_X), ("a", "b", "c", "d"), ("u1", "u2"), ("y1", "y2")
    )
    found = padded.truncate(3, nodes=5)
    assert found.p.shape == (16, 2)
    assert found.nu_gap.max() < 1e-6
    here = found.model.at(5.0, 1.0).discretize(0.05), padded.at(5.0, 1.0).discretize(0.05)
    assert nu_gap(*here) < 1e-6


def test_a_line_through_the_box_is_the_model_on_it_splines_too():
    basis = Product((CubicSpline((0.0, 3.0, 7.0, 13.0)), PiecewiseLinear((-4.0, 0.0, 4.0))))
    rng = np.random.default_rng(2)
    lpv = LPVStateSpace(
        basis,
        *(rng.normal(size=(12, *shape)) for shape in ((2, 2), (2, 1), (1, 2), (1, 1))),
        (V, A_X),
        ("x1", "x2"),
        ("u",),
        ("y",),
    )
    line = lpv.along((1.0, -3.0), (12.0, 4.0))
    assert line.scheduling.rate == pytest.approx(min(3.0 / 5.5, 10.0 / 3.5))
    for s in np.linspace(-1, 1, 9):
        p = (6.5 + 5.5 * s, 0.5 + 3.5 * s)
        np.testing.assert_allclose(line.at(s).A, lpv.at(*p).A, atol=1e-12)
    pieces = line.basis.pieces()
    assert len(pieces) == 4  # two knots in airspeed, one in acceleration
    for piece in pieces:  # the polynomials are the functions, between the ends of the piece too
        x = 0.3
        weights = np.array([math.comb(4, i) * x**i * (1 - x) ** (4 - i) for i in range(5)])
        there = line.basis(piece.low + x * (piece.high - piece.low))
        np.testing.assert_allclose(piece.bernstein @ weights, there, atol=1e-11)


def test_a_moving_trim_drifts_by_its_slopes_and_by_its_own_rates():
    grid = symheli.steady.sweep_grid(
        symheli.Helicopter.load("xcell60", governor="ideal"),
        [4.0, 5.0, 6.0, 7.0],
        acceleration=[-2.0, -1.0, 0.0, 1.0, 2.0],
    )
    lpv = grid.interpolate(degree=(3, 4))
    at = np.array([5.0, 1.0])
    h = 1e-5
    along_v = (lpv.trim.state(at + np.array([h, 0])) - lpv.trim.state(at - np.array([h, 0]))) / (
        2 * h
    )
    along_a = (lpv.trim.state(at + np.array([0, h])) - lpv.trim.state(at - np.array([0, h]))) / (
        2 * h
    )
    xdot = np.array([grid[1, 3].point.xdot[s] for s in lpv.states])
    expected = xdot - 1.0 * along_v - 0.7 * along_a
    np.testing.assert_allclose(lpv.trim.drift(at, [1.0, 0.7]), expected, atol=1e-8)
    # the velocity of the trim moves as the trim says: only attitude and rotor are left to drift
    still = lpv.trim.drift(at, [1.0, 0.0])
    u = lpv.states.index("u")
    assert abs(still[u]) < 0.05 * abs(xdot[u])
    # steady flight has no rates of its own
    level = grid.fix(acceleration=0.0).interpolate(degree=3)
    assert level.trim.xdot is None


def test_a_declared_drift_does_what_the_moving_trim_does():
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    grid = symheli.steady.sweep_grid(
        heli, [4.0, 5.0, 6.0, 7.0], acceleration=[-2.0, -1.0, 0.0, 1.0, 2.0]
    )
    t = 0.02 * np.arange(100)
    p = np.column_stack([5 + t, np.sin(t)])
    rate = np.column_stack([p[:, 1], np.cos(t)])
    both, alone = grid.interpolate("spline"), grid.fix(acceleration=0.0).interpolate("spline")
    for lpv, along, moving, size in (
        (both, p, rate, [1.0, rate[:, 1]]),
        (alone, p[:, 0], rate[:, 0], [rate[:, 0]]),
    ):
        declared = lpv.with_trim_drift()
        assert [str(u) for u in declared.inputs[4:]] == [f"drift_{s.name}" for s in lpv.parameters]
        w = np.column_stack([np.broadcast_to(v, len(t)) for v in size])
        u = np.hstack([np.zeros((len(t), 4)), w])
        x, _ = simulate(declared, along, u, dt=0.02)
        drift = lpv.trim.drift(along, moving)
        expected, _ = simulate(lpv, along, u[:, :4], dt=0.02, drift=drift)
        off = np.abs(declared.residuals.B).max()
        np.testing.assert_allclose(x, expected, atol=1e-9 + 20 * off)
    with pytest.raises(InputError, match="has no trim"):
        model().with_trim_drift()


def test_prediction_of_a_linear_truth_is_exact_and_knows_its_horizon():
    lpv = model().discretize(0.02, degree=(3, 2))
    n, rng = 300, np.random.default_rng(0)
    t = 0.02 * np.arange(n)
    p = np.column_stack([6 + 5 * np.sin(0.4 * t), 2 * np.cos(0.4 * t)])
    u = rng.normal(size=(n, 2))
    x, _ = simulate(lpv, p, u, [1.0, -1.0, 0.5])
    found = lpv.predict(p, u, x)
    np.testing.assert_allclose(found.ahead(25)[25:], x[25:], atol=1e-12)
    assert np.isnan(found.ahead(25)[:25]).all()
    np.testing.assert_allclose(found.free_run(10)[11:], x[11:], atol=1e-12)
    with pytest.raises(InputError, match="horizon"):
        found.ahead(0)
    with pytest.raises(InputError, match="sampled every"):
        lpv.predict(p, u, x, dt=0.01)


def test_the_rate_of_a_parameter_may_be_another():
    tied = model().with_rate({"airspeed": "acceleration"})
    assert tied.parameters[0].rate == "acceleration"
    assert model().with_rate(2.0).parameters[1].rate == 2.0
    with pytest.raises(InputError, match="is the parameter acceleration, not a number"):
        tied.along((0, 0), (1, 1))
    with pytest.raises(UnknownNameError, match="acceleratoin"):
        model().with_rate({"airspeed": "acceleratoin"})
    with pytest.raises(InputError, match=r"cannot be the rate of airspeed .*: expected m/s\^2"):
        LPVStateSpace.polynomial(
            **GIVEN, scheduling=(Scheduling("airspeed", "m/s", 0, 13, "mass"), MASS)
        )
    with pytest.raises(InputError, match="whose own rate must then be a number"):
        model().with_rate({"airspeed": "acceleration", "acceleration": "airspeed"})
    with pytest.raises(InputError, match="name of another"):
        Scheduling("airspeed", "m/s", 0, 13, "airspeed")


MASS = Scheduling("mass", "kg", 7.0, 9.0)


def test_a_further_parameter_changes_nothing(ideal):
    """Matrices, trim and what is known of the misfit."""
    family = symheli.sweep(ideal, [4.0, 5.0, 6.0, 7.0])
    alone = family.interpolate(degree=2)
    both = alone.with_parameter(A_X).with_rate({"airspeed": "acceleration"})
    assert [s.name for s in both.parameters] == ["airspeed", "acceleration"]
    for v, a in ((4.0, -4.0), (5.3, 0.7), (7.0, 4.0)):
        for one, two in zip(both.matrices((v, a)), alone.matrices(v), strict=True):
            np.testing.assert_array_equal(one, two)
        np.testing.assert_array_equal(both.trim.state((v, a)), alone.trim.state(v))
        np.testing.assert_allclose(
            both.trim.drift((v, a), (a, 9.0)), alone.trim.drift(v, a), atol=1e-13
        )
    np.testing.assert_array_equal(both.fitted_to.nodes[::2, 0], alone.fitted_to.nodes)
    np.testing.assert_array_equal(both.fitted_to.nodes[:2, 1], [-4.0, 4.0])
    np.testing.assert_allclose(both.fitted_to.A[1::2], alone.fitted_to.A, atol=1e-12)


def test_a_third_parameter_and_one_beside_a_line():
    third = model().with_parameter(MASS)
    for v, a in POINTS:
        np.testing.assert_array_equal(third.at(v, a, 8.0).A, model().at(v, a).A)
    with pytest.raises(InputError, match="must have different names"):
        model().with_parameter(V)
    line = model().along((0.0, -4.0), (13.0, 4.0)).with_parameter(MASS)
    np.testing.assert_allclose(line.at(0.0, 8.0).A, by_hand("A", 6.5, 0.0), atol=1e-13)


def test_wrong_use_gets_a_sentence():
    with pytest.raises(InputError, match=r"2 scheduling parameters \(airspeed, acceleration\)"):
        _ = model().scheduling
    with pytest.raises(InputError, match=r"expected 2 value\(s\)"):
        model().at(3.0)
    with pytest.raises(InputError, match="along the last axis"):
        model().matrices([1.0, 2.0, 3.0])
    with pytest.raises(InputError, match=r"A: expected \{exponents: matrix\}"):
        model(A=[np.eye(3)])
    with pytest.raises(InputError, match="must have different names"):
        LPVStateSpace.polynomial(**GIVEN, scheduling=(V, V))
    with pytest.raises(InputError, match=r"basis is one of 1 parameter\(s\), the model has 2"):
        LPVStateSpace(
            Polynomial(0, 0.0, 13.0),
            *(np.zeros((1, 1, 1)) for _ in range(4)),
            (V, A_X),
            ("x",),
            ("u",),
            ("y",),
        )
    with pytest.raises(InputError, match="a polynomial of degree 3 needs 4 values"):
        symheli.LinearFamily(
            ("airspeed", "mass"), ([0.0, 1.0], [7.0, 9.0]), [model().at(1.0, 1.0)] * 4
        ).interpolate()


@pytest.mark.parametrize("kind", ["polynomial", "spline", "linear"])
def test_a_grid_is_met_at_its_nodes_and_its_misfit_is_known(kind):
    """Models of a polynomial plant: each kind meets the nodes, the polynomial everything."""
    speeds, mass = np.linspace(0, 13, 6), np.linspace(-4, 4, 4)
    models = [model().at(v, a) for v in speeds for a in mass]
    axes = (
        symheli.values.Signal("airspeed", "m/s"),
        symheli.values.Signal("acceleration", "m/s^2"),
    )
    lpv = symheli.LinearFamily(axes, (speeds, mass), models).interpolate(kind, degree=(2, 1))
    for v in speeds:
        for a in mass:
            np.testing.assert_allclose(lpv.at(v, a).A, by_hand("A", v, a), atol=1e-12)
    assert np.abs(lpv.residuals.A).max() < 1e-12
    assert lpv.residuals.nodes.shape == (24, 2)
    off = np.abs(lpv.at(3.1, 0.4).B - by_hand("B", 3.1, 0.4)).max()
    assert off < 1e-12 if kind != "linear" else 1e-6 < off < 0.1
    assert lpv.trim is None


def test_to_python_control_and_back():
    system = model().to_control(3.0, 1.0)
    back = symheli.LinearModel.from_control(system)
    np.testing.assert_array_equal(back.A, model().at(3.0, 1.0).A)
    assert back.inputs == ("u1", "u2")
