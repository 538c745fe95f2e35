"""An invariant set is as large as closed forms and other programs say, and no motion leaves it."""

import json
import math
from dataclasses import replace

import cvxpy
import matplotlib
import numpy as np
import pytest
from scipy.linalg import expm

import symheli
from studies.cli import main
from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError
from synthesis.sets import InvariantSet, SwitchInside, invariant_set, reference_governor

matplotlib.use("agg")


def linear(A, B, states, inputs, dt=None):
    A = np.array(A, dtype=float)
    n, nu = len(A), len(inputs)
    return LinearModel(
        A, np.reshape(B, (n, nu)), np.eye(n), np.zeros((n, nu)), states, inputs,
        [f"{x}_m" for x in states], dt=dt,
    )  # fmt: skip


CART = linear([[0, 1], [0, 0]], [0, 1], ["x", "v"], ["u"])


@pytest.mark.parametrize(("a", "b"), [(1.0, 2.0), (3.0, 0.5), (0.01, 1.0)])
def test_of_an_unstable_lag_with_a_saturated_input_it_is_the_whole_controllable_set(a, b):
    found = invariant_set(linear([[a]], [b], ["x"], ["u"]), input_bounds={"u": 1.0})
    assert found.verified
    # |x| < b/a; the solver's tolerance and the spare of the inequalities are 1e-7
    assert b / a * (1 - 1e-5) < found.half_widths()[0] < b / a
    assert found.used()["u"] == pytest.approx(1, rel=1e-5)


def test_of_a_sampled_lag_with_a_disturbance_it_is_the_closed_form():
    model = linear([[1.2]], [2.0, 0.1], ["x"], ["u", "w"], dt=0.1)
    found = invariant_set(
        model, state_bounds={"x": 3.0}, input_bounds={"u": 0.2}, disturbance={"w": 1.0}
    )
    # 1.2 X - .4 + .1 = X; alpha is on a grid of sqrt(2), which takes .1 %
    assert found.verified
    assert 1.5 * (1 - 2e-3) < found.half_widths()[0] < 1.5


@pytest.mark.parametrize("u_max", [0.3, 1.0])
def test_a_double_integrator_has_the_set_of_an_independent_program(u_max):
    found = invariant_set(CART, state_bounds={"x": 2.0, "v": 1.0}, input_bounds={"u": u_max})
    Q, Y = cvxpy.Variable((2, 2), symmetric=True), cvxpy.Variable((1, 2))
    A, B = CART.A, CART.B
    motion = A @ Q + B @ Y
    bound = cvxpy.bmat([[Q, Y.T], [Y, np.array([[u_max**2]])]])
    limits = [motion + motion.T << 0, bound >> 0, Q[0, 0] <= 4, Q[1, 1] <= 1]
    cvxpy.Problem(cvxpy.Maximize(cvxpy.log_det(Q)), limits).solve(solver="CLARABEL")
    assert found.verified
    # areas: the log det of cvxpy is exact to its tolerance of 1e-8
    assert found.volume() == pytest.approx(math.pi * np.sqrt(np.linalg.det(Q.value)), rel=1e-5)


def test_a_direction_that_is_asked_for_is_reached_further_than_by_the_largest_volume():
    bounds = {"state_bounds": {"x": 2.0, "v": 1.0}, "input_bounds": {"u": 0.3}}
    wanted = np.array([1.0, 0.6])
    extents = [
        found.level(wanted) ** -0.5
        for found in (
            invariant_set(CART, **bounds, directions=[{"x": 1.0, "v": 0.6}]),
            invariant_set(CART, **bounds),
        )
    ]
    assert extents[0] > 1.01 * extents[1]


def random_plant(seed, dt=None):
    """Of three states over p, unstable, with a control and two disturbances."""
    rng = np.random.default_rng(seed)
    A = np.stack([rng.standard_normal((3, 3)) + 0.3 * np.eye(3), 0.4 * rng.standard_normal((3, 3))])
    B = np.stack([rng.standard_normal((3, 4)), 0.3 * rng.standard_normal((3, 4))])
    if dt is not None:
        A, B = A * dt, B * dt
        A[0] += np.eye(3)
    return LPVStateSpace.polynomial(
        A, B, np.eye(3)[None], np.zeros((1, 3, 4)),
        scheduling=Scheduling("p", "1", -1.0, 1.0, rate=0.0 if dt else 0.5),
        states=["x1", "x2", "x3"], inputs=["u1", "u2", "w1", "w2"], outputs=["y1", "y2", "y3"],
        dt=dt,
    )  # fmt: skip


LIMITS = {
    "state_bounds": {"x1": 1.0, "x2": 2.0, "y3": 3.0},
    "input_bounds": {"u1": 4.0, "u2": 4.0},
    "disturbance": {"w1": 0.1, "w2": 0.2},
}


def furthest(found, count, steps, dt, seed=0):
    """The largest V of motions from the border in the disturbances that push V up most, with p
    moving at its largest rate, and the largest part of a limit that is used.
    """
    rng = np.random.default_rng(seed)
    own, n = found.statement, len(found.shape.states)
    (s,) = own.model.parameters
    p, way = rng.uniform(s.low, s.high, count), rng.choice([-1.0, 1.0], count)
    z = rng.standard_normal((count, n, 1))
    x = np.linalg.cholesky(found.shape.matrices(p).A) @ (z / np.linalg.norm(z, axis=1)[:, None])
    most, used, wide = 0.0, 0.0, np.zeros((count, n + 1, n + 1))
    for _ in range(steps):
        M, at = own.model.matrices(p), found.shape.matrices(p)
        K = np.swapaxes(np.linalg.solve(at.A, np.swapaxes(at.C, 1, 2)), 1, 2)
        A, W = M.A + M.B[:, :, own.moved] @ K, M.B[:, :, own.disturbed]
        way = np.where(rng.random(count) < 0.02, -way, way)
        # continuous: of V now; sampled: of V after the step
        ahead = x if own.model.dt is None else A @ x
        push = own.amplitudes[:, None] * np.sign(
            np.swapaxes(W, 1, 2) @ np.linalg.solve(at.A, ahead)
        )
        used = max(
            used, np.abs((K @ x)[..., 0] / [4.0, 4.0]).max(), np.abs(x[..., 0] / [1, 2, 3]).max()
        )
        if own.model.dt is None:
            wide[:, :n, :n], wide[:, :n, n:] = A, W @ push
            x = (expm(wide * dt) @ np.pad(x, ((0, 0), (0, 1), (0, 0)), constant_values=1.0))[:, :n]
            p = np.clip(p + dt * s.rate * way, s.low, s.high)
        else:
            x = A @ x + W @ push
        most = max(most, found.levels(x[..., 0], p).max())
    return most, used


@pytest.fixture(scope="module")
def random_set():
    found = invariant_set(random_plant(0), **LIMITS, alpha=1.0)
    assert found.verified, found.why
    return found


def test_no_motion_of_a_random_plant_leaves_its_set(random_set):
    most, used = furthest(random_set, 200, 50, 1e-3)
    # p and the disturbance are held for a millisecond: V is off by the square of that
    assert most < 1 + 1e-5
    assert 0.9 < used < 1 + 1e-5


def test_a_larger_disturbance_drives_it_out(random_set):
    # the picture of the test before: it can fail
    own = random_set.statement
    louder = {w: 20 * a for w, a in own.disturbance.items()}
    loose = replace(random_set, statement=replace(own, disturbance=louder))
    assert not loose.verify()
    assert furthest(loose, 200, 50, 1e-3)[0] > 1.01


@pytest.mark.slow
@pytest.mark.parametrize("dt", [None, 0.05])
@pytest.mark.parametrize("seed", [1])
def test_no_motion_of_other_random_plants_leaves_their_sets(seed, dt):
    found = invariant_set(random_plant(seed, dt), **LIMITS)
    assert found.verified, found.why
    most, used = furthest(found, 200, 300, 1e-3)
    assert most < 1 + 1e-5
    assert used < 1 + 1e-5


def test_of_a_given_law_the_set_is_that_of_an_independent_program():
    K = np.array([[-1.0, -1.0]])
    found = invariant_set(
        CART, controller=K, state_bounds={"x": 2.0, "v": 1.0}, input_bounds={"u": 1.0}
    )
    Q = cvxpy.Variable((2, 2), symmetric=True)
    A = CART.A + CART.B @ K
    limits = [A @ Q + Q @ A.T << 0, Q[0, 0] <= 4, Q[1, 1] <= 1, K @ Q @ K.T <= 1]
    cvxpy.Problem(cvxpy.Maximize(cvxpy.log_det(Q)), limits).solve(solver="CLARABEL")
    assert found.verified
    assert found.volume() == pytest.approx(math.pi * np.sqrt(np.linalg.det(Q.value)), rel=1e-5)
    np.testing.assert_array_equal(found.gain(), K)


def test_what_holds_at_the_ends_of_the_range_only_is_not_proven():
    # x' = (4 p (1 - p) - 1/2 ) x: stable at p = 0 and 1, unstable between
    model = LPVStateSpace.polynomial(
        [[[-0.5]], [[4.0]], [[-4.0]]], np.zeros((1, 1, 0)), [[[1.0]]], np.zeros((1, 1, 0)),
        scheduling=Scheduling("p", "1", 0.0, 1.0, rate=0.0), states=["x"], inputs=[], outputs=["y"],
    )  # fmt: skip
    found = invariant_set(model, state_bounds={"x": 1.0})
    assert not found.verified
    assert "no set" in found.why
    narrow = model.with_scheduling(Scheduling("p", "1", 0.0, 0.1, rate=0.0))
    stable = invariant_set(narrow, state_bounds={"x": 1.0})
    assert stable.verified
    assert not replace(stable, statement=replace(stable.statement, model=model)).verify()


def test_a_law_in_pieces_over_p_is_proven_piece_by_piece():
    knots = (0.0, 0.3, 1.0)
    p = Scheduling("p", "1", 0.0, 1.0, rate=math.inf)
    model = LPVStateSpace.polynomial(
        [[[1.0]], [[1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]],
        scheduling=p, states=["x"], inputs=["u"], outputs=["y"],
    )  # fmt: skip
    gains = np.reshape([-1.5, -2.0, -2.5], (3, 1, 1))
    law = LPVStateSpace(
        symheli.lpv.PiecewiseLinear(knots), np.zeros((3, 0, 0)), np.zeros((3, 0, 1)),
        np.zeros((3, 1, 0)), gains, (p,), (), ("x",), ("u",),
    )  # fmt: skip
    found = invariant_set(model, controller=law, input_bounds={"u": 1.0})
    assert found.verified
    assert found.half_widths(0.5)[0] == pytest.approx(1 / 2.5, rel=1e-5)  # |K x| <= 1 at p = 1


FORGED = {
    "a larger set": lambda c: c["shape"]["A"].update(
        array=[1.001 * v for v in c["shape"]["A"]["array"]]
    ),
    "larger disturbances": lambda c: c["disturbance"].__setitem__(0, ["w1", 1.0]),
    "a narrower limit": lambda c: c["input_bounds"].__setitem__(0, ["u1", 0.5]),
    "the sign of the law": lambda c: c["shape"]["C"].update(
        array=[-v for v in c["shape"]["C"]["array"]]
    ),
    "a faster parameter": lambda c: c["model"]["parameters"][0].update(rate={"float": "inf"}),
    "shares above alpha": lambda c: c.update(alpha=0.5 * c["alpha"]),
    "a negative share": lambda c: c["shares"].update(array=[-v for v in c["shares"]["array"]]),
}


@pytest.mark.guard
@pytest.mark.parametrize("forgery", FORGED)
def test_a_forged_set_is_not_proven(random_set, tmp_path, forgery):
    path = random_set.save(tmp_path / "set.json")
    content = json.loads(path.read_text())
    FORGED[forgery](content)
    path.write_text(json.dumps(content))
    assert not InvariantSet.load(path).verified


@pytest.mark.guard
def test_a_saved_set_is_proven_again_from_its_file(random_set, tmp_path, capsys):
    path = random_set.save(tmp_path / "set.json")
    again = InvariantSet.load(path)
    assert again.verified
    np.testing.assert_array_equal(again.shape.A, random_set.shape.A)
    assert main(["verify", str(path)]) == 0
    assert (
        "proven in exact arithmetic: invariant ellipsoid: no motion leaves it"
        in capsys.readouterr().out
    )


@pytest.mark.guard
@pytest.mark.parametrize(
    "damage",
    [
        lambda c: c.pop("shape"),
        lambda c: c.update(version=3),
        lambda c: c.update(schema="another"),
        lambda c: c.update(shares="text"),
        lambda c: c.update(model=None),
        lambda c: c["shape"]["A"].update(shape=[1, 2]),
        lambda c: c.update(disturbance=[["w1", -1.0]]),
        lambda c: c.update(controls=[]),
    ],
)
def test_a_damaged_file_is_refused(random_set, tmp_path, damage):
    path = random_set.save(tmp_path / "set.json")
    content = json.loads(path.read_text())
    damage(content)
    path.write_text(json.dumps(content))
    with pytest.raises(InputError):
        InvariantSet.load(path)


def test_the_cut_touches_the_limit_that_binds(random_set):
    ax = random_set.cut("x1", "x2", 0.0)
    border = ax.lines[0].get_xydata()
    states = np.column_stack([border, np.zeros(len(border))])
    np.testing.assert_allclose(random_set.level(states, 0.0), 1.0, rtol=1e-9)
    assert "binds" in ax.get_title()


def test_the_governor_takes_the_largest_step_of_the_closed_form():
    found = invariant_set(CART, state_bounds={"x": 1.0, "v": 1.0}, input_bounds={"u": 1.0})
    made = reference_governor(found, [1.0, 0.0])
    P, g = np.linalg.inv(found.gramian()), np.array([1.0, 0.0])
    rng = np.random.default_rng(0)
    for _ in range(20):
        x = np.linalg.cholesky(found.gramian()) @ rng.uniform(-0.5, 0.5, 2)
        # (x - g v)'P(x - g v) = 1, the larger root
        a, b, c = g @ P @ g, -2 * g @ P @ x, x @ P @ x - 1
        largest = (-b + math.sqrt(b * b - 4 * a * c)) / (2 * a)
        assert made.next(x, 50.0, 0.0) == pytest.approx(largest, rel=1e-9)
        assert made.next(x, 0.5 * largest, 0.0) == 0.5 * largest


def test_no_command_drives_a_governed_model_out_of_its_set():
    found = invariant_set(CART, state_bounds={"x": 1.0, "v": 1.0}, input_bounds={"u": 0.3})
    made, rng, dt = reference_governor(found, [1.0, 0.0]), np.random.default_rng(0), 0.1
    A = CART.A + CART.B @ found.gain()
    step = expm(A * dt)
    wanted = rng.uniform(-20, 20, 500)
    for governed in (True, False):
        x, v, most = np.zeros((500, 2)), np.zeros(500), np.zeros(500)
        for _ in range(100):
            v = made.next(x, wanted, v) if governed else wanted
            x_r = v[:, None] * np.array([1.0, 0.0])
            x = x_r + (x - x_r) @ step.T
            # level 1 at a step, less afterwards: rounding is all that is left
            most = np.maximum(most, made.level(x, v))
        if governed:
            assert most.max() < 1 + 1e-9
            assert np.abs(v).max() > 2  # and it moves
        else:
            assert np.sum(most > 1) > 450


@pytest.mark.slow
def test_laws_that_switch_inside_their_sets_keep_every_limit():
    bounds = {"state_bounds": {"x": 2.0, "v": 1.0}, "input_bounds": {"u": 0.5}}
    gains = ([[-0.1, -0.5]], [[-4.0, -4.0]])
    sets = [invariant_set(CART, controller=K, **bounds) for K in gains]
    law, dt, rng = SwitchInside(sets), 0.02, np.random.default_rng(0)
    steps = [expm((CART.A + CART.B @ np.array(K)) * dt) for K in gains]
    most, arrived, careless = 0.0, 0, 0.0
    for _ in range(5):
        z = rng.standard_normal(2)
        x, active = np.linalg.cholesky(sets[0].gramian()) @ z / np.linalg.norm(z), 0
        careless = max(careless, np.abs(np.array(gains[1]) @ x).item())
        for _ in range(1000):
            active = law.next(x, 1, active)
            most = max(most, np.abs(law.control(x, active)).max() / 0.5, abs(x[0]) / 2, abs(x[1]))
            x = steps[active] @ x
        arrived += active
    assert most < 1 + 1e-9
    assert arrived == 5  # all have come to the fast law
    assert careless > 1.0  # which would have exceeded its limit at once


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({}, "at least one of state_bounds and input_bounds"),
        ({"state_bounds": {"x": -1.0}}, "number > 0"),
        ({"state_bounds": {"z": 1.0}}, "z"),
        ({"input_bounds": {"x": 1.0}}, "x"),
        ({"input_bounds": {"u": 1.0}, "disturbance": {"gust": 1.0}}, "gust"),
        ({"input_bounds": {"u": 1.0}, "controller": [[1.0]]}, "controller"),
        ({"input_bounds": {"u": 1.0}, "directions": [{"x": 0.0}]}, "directions"),
        ({"input_bounds": {"u": 1.0}, "degree": 2}, "may jump"),
        ({"input_bounds": {"u": 1.0}, "alpha": -1.0}, "alpha"),
        ({"input_bounds": {"u": 1.0}, "rate": -1.0}, "rate"),
    ],
)
def test_wrong_arguments_are_refused(options, told):
    with pytest.raises(InputError, match=told):
        invariant_set(CART, **options)


def test_a_set_without_a_bound_says_so():
    found = invariant_set(CART, input_bounds={"u": 1.0})
    assert not found.verified
    assert "limit more states" in found.why
    with pytest.raises(InputError, match="limit more states"):
        found.save("never.json")
    with pytest.raises(InputError, match="proof"):
        reference_governor(found, [1.0, 0.0])
    with pytest.raises(InputError, match="proof"):
        SwitchInside([found])


def test_a_governor_refuses_states_of_another_size():
    found = invariant_set(CART, state_bounds={"x": 1.0, "v": 1.0}, input_bounds={"u": 1.0})
    made = reference_governor(found, [1.0, 0.0])
    for x in ([], [0.0], [0.0, 0.0, 0.0], [[0.0, 0.0]] * 3):
        with pytest.raises(InputError, match="2 states along the last axis"):
            made.next(x, [1.0, 2.0], 0.0)
    with pytest.raises(InputError, match="steady"):
        reference_governor(found)
