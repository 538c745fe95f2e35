"""LPV models: evaluation, feedback, sampling and response."""

from dataclasses import replace

import numpy as np
import pytest
from families import SPEED, random_lpv, stacked
from scipy.integrate import solve_ivp

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv import BSpline, CubicSpline, PiecewiseLinear, Polynomial, UserFunctions
from symheli.lpv.bases import Patches
from symheli.lpv.lpv_matrices import Matrices
from symheli.lpv.scheduling import parameters
from symheli.lpv.tools import TrimSchedule, simulate


def stable(dt=None):
    A0, A1 = np.array([[0.0, 1.0], [-4.0, -1.0]]), np.array([[0.0, 0.0], [-0.5, -0.1]])
    return LPVStateSpace.polynomial(
        A=[A0, A1], B=[[[0.0], [1.0]]], C=[np.eye(2)], D=[np.zeros((2, 1))], scheduling=SPEED, dt=dt
    )


def test_powers_of_p_are_in_physical_units():
    lpv, whole = random_lpv(3)
    p = 9.3
    np.testing.assert_allclose(
        stacked(lpv.at(p)), sum(M * p**i for i, M in enumerate(whole)), atol=1e-12
    )


def test_a_channel_measured_in_its_size_counts_that_as_one():
    lpv = stable().discretize(0.1, degree=1)  # a fit, whose misfit is measured so too
    scaled = lpv.scaled({"u1": 0.01}, {"y2": 0.1})
    for p in (0.0, 7.0, 13.0):
        own, model = scaled.at(p), lpv.at(p)
        np.testing.assert_allclose(own.B, 0.01 * model.B)
        np.testing.assert_allclose(own.C, model.C / [[1.0], [0.1]])
        np.testing.assert_allclose(own.D, 0.01 * model.D / [[1.0], [0.1]])
    np.testing.assert_allclose(scaled.residuals.B, 0.01 * lpv.residuals.B, atol=1e-16)
    for wrong in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(InputError, match="size of the input u1 must be a number > 0"):
            lpv.scaled({"u1": wrong})


def test_feedthrough_that_moves_beside_the_loop_is_no_part_of_it():
    """u1 = k y1 + r, with D(p) from u2 to y1 and from u1 to y2: the loop is constant, and closed
    exactly.
    """
    rng = np.random.default_rng(0)
    A, B, C, D = ([rng.standard_normal((2, 2)), rng.standard_normal((2, 2)) / 13] for _ in range(4))
    D[1][0, 0] = 0.0
    lpv = LPVStateSpace.polynomial(A, B, C, D, SPEED)
    closed = lpv.feedback({("u1", "y1"): 0.3})
    for p in (0.0, 5.0, 13.0):
        np.testing.assert_allclose(
            stacked(closed.at(p)), stacked(lpv.at(p).feedback({("u1", "y1"): 0.3})), atol=1e-11
        )
    with pytest.raises(InputError, match="depends on the scheduling"):
        lpv.feedback({("u2", "y1"): 0.3})


def test_many_p_at_once_are_the_frozen_models_one_by_one():
    lpv, _ = random_lpv(2)
    p = np.linspace(0, 13, 5)
    np.testing.assert_allclose(lpv.matrices(p).B[3], lpv.at(p[3]).B, atol=1e-14)


def test_outside_the_range_is_refused_with_both_ranges():
    with pytest.raises(InputError, match=r"spans \[14, 14\] m/s but the model holds on \[0, 13\]"):
        random_lpv(1)[0].at(14.0)
    with pytest.raises(InputError, match="the basis covers"):
        random_lpv(1)[0].with_scheduling(Scheduling("airspeed", "m/s", 0.0, 20.0))


def test_feedback_closes_the_loop_at_every_p():
    lpv = stable()
    closed = lpv.feedback({("u1", "y2"): -3.0})
    for p in (0.0, 5.0, 13.0):
        model = lpv.at(p)
        np.testing.assert_allclose(closed.at(p).A, model.A + model.B @ [[0.0, -3.0]], atol=1e-13)


def test_a_rational_loop_is_closed_by_the_lft_that_the_message_names():
    lpv, gains = random_lpv(1)[0], {("u1", "y1"): 0.1}
    with pytest.raises(InputError, match=r"lpv\.to_lft\(\)\.feedback\(\.\.\.\) closes it exactly"):
        lpv.feedback(gains)
    for p in (0.0, 5.0, 13.0):
        np.testing.assert_allclose(
            stacked(lpv.to_lft().feedback(gains).at(p)),
            stacked(lpv.at(p).feedback(gains)),
            atol=1e-12,
        )


def test_a_spline_is_closed_where_its_products_stay_splines():
    nodes = (0.0, 3.0, 5.0, 13.0)
    rng = np.random.default_rng(0)
    A, C = rng.standard_normal((4, 2, 2)), rng.standard_normal((4, 1, 2))
    B = np.broadcast_to(rng.standard_normal((2, 1)), (4, 2, 1))
    lpv = LPVStateSpace(
        PiecewiseLinear(nodes), A, B, C, np.zeros((4, 1, 1)), SPEED, ("x1", "x2"), ("u1",), ("y1",)
    )
    closed = lpv.feedback({("u1", "y1"): 2.0})
    for p in (0.0, 4.1, 13.0):
        np.testing.assert_allclose(
            stacked(closed.at(p)), stacked(lpv.at(p).feedback({("u1", "y1"): 2.0})), atol=1e-14
        )
    assert closed.basis == lpv.basis
    moving = replace(lpv, B=rng.standard_normal((4, 2, 1)))
    squares = moving.feedback({("u1", "y1"): 2.0})  # B(p) C(p) between the nodes
    assert squares.basis == Patches(2, nodes)
    for p in (0.0, 2.9, 4.1, 13.0):
        np.testing.assert_allclose(
            stacked(squares.at(p)), stacked(moving.at(p).feedback({("u1", "y1"): 2.0})), atol=1e-13
        )
    brought = UserFunctions((np.ones_like, np.sin, np.cos, np.sqrt), 0.0, 13.0)
    sines = replace(moving, basis=brought)
    closed = sines.feedback({("u1", "y1"): 2.0})
    for p in (0.0, 2.9, 13.0):
        np.testing.assert_allclose(
            stacked(closed.at(p)), stacked(sines.at(p).feedback({("u1", "y1"): 2.0})), atol=1e-10
        )


def test_sampled_model_is_the_hold_equivalent_at_the_nodes_up_to_its_residuals():
    lpv = stable()
    discrete = lpv.discretize(0.02, degree=4)
    assert discrete.dt == 0.02
    for p in (0.0, 3.3, 13.0):
        miss = np.abs(discrete.at(p).A - lpv.at(p).discretize(0.02).A).max()
        assert miss < 1e-9  # the exponential of this polynomial, fitted to degree 4
    assert np.abs(discrete.residuals.A).max() < 1e-9


@pytest.mark.slow
def test_simulation_agrees_with_an_ode_solver_and_converges_with_the_step():
    lpv = stable()

    def speed(t):
        return 6.5 - 6.5 * np.cos(0.8 * t)

    def drive(t):
        return np.sin(2.0 * t)

    def rhs(t, x):
        model = lpv.at(float(np.clip(speed(t), 0, 13)))
        return model.A @ x + model.B[:, 0] * drive(t)

    end = 4.0
    exact = solve_ivp(rhs, (0, end), [1.0, 0.0], rtol=1e-10, atol=1e-12).y[:, -1]
    errors = []
    for n in (400, 800):
        t = np.arange(n + 1) * end / n
        middle = np.minimum(
            t + 0.5 * end / n, end
        )  # p and u are held: their values at the middle of the step are second order
        x, _ = simulate(lpv, speed(middle), drive(middle)[:, None], [1.0, 0.0], dt=end / n)
        errors.append(np.abs(x[-1] - exact).max())
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)


def test_simulation_with_constant_p_is_exact_and_a_drift_is_added_as_a_rate():
    lpv, dt, n = stable(), 0.1, 30
    u = np.random.default_rng(0).standard_normal((n, 1))
    x, y = simulate(lpv, np.full(n, 4.0), u, dt=dt)
    model, state = lpv.at(4.0).discretize(dt), np.zeros(2)
    for k in range(n):
        np.testing.assert_allclose(x[k], state, atol=1e-12)
        state = model.A @ state + model.B @ u[k]
    np.testing.assert_allclose(y, x)
    pushed, _ = simulate(
        lpv, np.full(n, 4.0), np.zeros((n, 1)), dt=dt, drift=np.tile([0.0, 1.0], (n, 1))
    )
    forced, _ = simulate(lpv, np.full(n, 4.0), np.ones((n, 1)), dt=dt)  # B = [0, 1]
    np.testing.assert_allclose(pushed, forced, atol=1e-12)
    with pytest.raises(InputError, match="sample period dt"):
        simulate(lpv, np.full(n, 4.0), u)
    with pytest.raises(InputError, match=r"discrete at 0\.1 s; leave dt"):
        simulate(lpv.discretize(0.1), np.full(n, 4.0), u, dt=0.2)


def test_matrices_of_unequal_shape_are_refused():
    with pytest.raises(InputError, match="differ in shape"):
        LPVStateSpace.polynomial(
            A=[np.eye(2), np.eye(3)],
            B=[np.ones((2, 1))],
            C=[np.eye(2)],
            D=[np.zeros((2, 1))],
            scheduling=SPEED,
        )
    with pytest.raises(InputError, match="at least one coefficient"):
        LPVStateSpace.polynomial(
            A=[], B=[np.ones((2, 1))], C=[np.eye(2)], D=[np.zeros((2, 1))], scheduling=SPEED
        )
    with pytest.raises(InputError, match="positive number of seconds"):
        stable(dt=-0.1)


def test_a_loop_closes_around_a_fitted_model_on_a_part_of_its_range():
    """The residuals of the narrower model are those inside: what the fit missed elsewhere is no
    business of its loops.
    """
    narrow = replace(SPEED, low=2.0, high=8.0)
    lpv = stable().discretize(0.02, degree=3, nodes=14)
    part = lpv.with_scheduling(narrow)
    nodes = lpv.residuals.nodes
    inside = (nodes >= 2.0) & (nodes <= 8.0)
    np.testing.assert_array_equal(part.residuals.nodes, nodes[inside])
    closed = part.feedback({("u1", "y1"): -1.0})
    whole = lpv.feedback({("u1", "y1"): -1.0})
    np.testing.assert_allclose(closed.residuals.A, whole.residuals.A[inside], atol=1e-13)
    between = replace(SPEED, low=nodes[3] + 1e-3, high=nodes[4] - 1e-3)
    assert lpv.with_scheduling(between).residuals is None


NODES = np.array([1.0, 6.0])
BREAKS = (0.0, 3.0, 7.0, 8.5, 13.0)


@pytest.mark.parametrize(
    "basis",
    [
        Polynomial(3, 0.0, 13.0),
        PiecewiseLinear(BREAKS),
        CubicSpline(BREAKS),
        BSpline(2, BREAKS),
        Patches(2, BREAKS),
        UserFunctions((np.ones_like, np.sqrt), 0.0, 13.0),
    ],
    ids=lambda basis: type(basis).__name__,
)
def test_another_unit_of_a_parameter_is_converted_to(basis):
    """The same model at the same airspeed, its trim and residuals too, whatever that is told in."""
    rng = np.random.default_rng(0)
    whole = [
        rng.standard_normal((basis.size, *shape)) for shape in ((2, 2), (2, 1), (1, 2), (1, 1))
    ]
    x0 = rng.standard_normal((5, 2))
    trim = TrimSchedule(CubicSpline(BREAKS), x0, x0[:, :1])
    known = LPVStateSpace(basis, *whole, SPEED, ("x1", "x2"), ("u1",), ("y1",), trim=trim)
    known = known.with_residuals(NODES, Matrices(*(np.zeros((2, *M.shape[1:])) for M in whole)))
    told = known.with_scheduling(Scheduling("V", "km/h", 0.0, 36.0, rate=3.6))
    assert told.residuals.nodes == pytest.approx(3.6 * NODES)
    for speed in (0.0, 2.5, 7.2, 10.0):
        for name in "ABCD":
            same = getattr(known.at(speed), name)
            np.testing.assert_allclose(getattr(told.at(3.6 * speed), name), same, atol=1e-9)
        np.testing.assert_allclose(told.trim.state(3.6 * speed), trim.state(speed), atol=1e-9)
        # per km/h, at an acceleration of 1 m/s^2
        drift = told.trim.drift(3.6 * speed, 3.6), trim.drift(speed, 1.0)
        np.testing.assert_allclose(*drift, atol=1e-8 * np.abs(drift[1]).max())
    back = told.with_scheduling(replace(SPEED, high=10.0))
    np.testing.assert_allclose(back.at(5.0).A, known.at(5.0).A, atol=1e-9)
    assert told.with_trim_drift().inputs[-1].unit == "km/h/s"
    with pytest.raises(InputError, match=r"\[0\.0, 46\.8.* V ranges over \[0\.0, 50"):
        known.with_scheduling(Scheduling("V", "km/h", 0.0, 50.0))


def test_a_unit_of_another_quantity_is_refused_and_one_where_there_was_none_is_taken():
    with pytest.raises(InputError, match=r"is in m/s, got a range in rad, .* give it in m/s"):
        stable().with_scheduling(Scheduling("airspeed", "rad", 0.0, 1.0))
    with pytest.raises(InputError, match=r"expected 1 parameter\(s\), for airspeed, got 2"):
        stable().with_scheduling((SPEED, Scheduling("a", "m/s^2", -1.0, 1.0)))
    bare = stable().with_scheduling(SPEED)
    bare = replace(bare, parameters=replace(SPEED, name="p", unit="1"))
    np.testing.assert_array_equal(bare.with_scheduling(SPEED).at(4.0).A, stable().at(4.0).A)


def test_the_rate_of_a_parameter_is_in_its_unit_per_second():
    """km/h that change by an acceleration in m/s^2 would change 3.6 times too slowly."""
    speed = Scheduling("V", "km/h", 0.0, 36.0, rate="a")
    with pytest.raises(InputError, match=r"a \(m/s\^2\) cannot be the rate .* expected km/h/s"):
        parameters((speed, Scheduling("a", "m/s^2", -3.0, 3.0)))
    assert len(parameters((speed, Scheduling("a", "km/h/s", -3.0, 3.0)))) == 2
    own = Scheduling("valve", "turns", 0.0, 1.0, rate="speed")
    assert len(parameters((own, Scheduling("speed", "turns/s", -3.0, 3.0)))) == 2


def test_a_constant_model_is_the_same_everywhere():
    model = stable().at(4.0)
    box = (SPEED, Scheduling("a", "m/s^2", -3.0, 3.0))
    np.testing.assert_array_equal(LPVStateSpace.constant(model, box).at(3.0, -1.0).A, model.A)
    alone = LPVStateSpace.constant(model)
    assert [s.name for s in alone.parameters] == ["constant"]
    np.testing.assert_array_equal(alone.at(0.7).A, model.A)
