"""Terminal sets: published ones, closed forms, and a predictive controller that uses them."""

import importlib
from pathlib import Path

import casadi
import numpy as np
import pytest
import sympy
from scipy.linalg import expm

from symheli import LinearModel
from symheli.errors import InputError
from synthesis.regions import TerminalSet, terminal

x, y, u = sympy.symbols("x y u")
HALF = sympy.Rational(1, 2)
CHEN = {x: y + u * (HALF + HALF * x), y: x + u * (HALF - 2 * y)}
"""Chen and Allgoewer, Automatica 34 (1998), section 5: Q = .5 I, R = 1, |u| <= 2."""
DT = 0.1
CUBIC = {x: x + DT * y, y: y + DT * (u - x**3 + HALF * x)}


def chen(**options):
    return terminal(
        CHEN, 0.5 * np.eye(2), [[1.0]], controls=[u], input_bounds={"u": 2.0}, **options
    )


def double_integrator():
    A, B = [[1.0, DT], [0.0, 1.0]], [[DT**2 / 2], [DT]]
    return LinearModel(A, B, np.eye(2), np.zeros((2, 1)), ["p", "v"], ["a"], ["p_m", "v_m"], DT)


def test_the_published_cost_has_at_least_the_published_level():
    found = chen(share=0.95)
    assert found.verify()
    assert found.P == pytest.approx(
        np.array([[16.5926, 11.5926], [11.5926, 16.5926]]), abs=1e-4
    )  # the digits printed
    assert found.K == pytest.approx(np.array([[-2.118, -2.118]]), abs=1e-3)
    assert 0.7 < found.alpha < 0.9


def test_the_set_chosen_is_larger_than_the_published_one():
    found = chen()
    assert found.verified
    assert found.log_volume > chen(share=0.95).log_volume


def test_a_linear_loop_is_limited_by_its_limits_alone():
    bounds = {"p": 1.0, "v": 0.5}
    found = terminal(
        double_integrator(), np.eye(2), [[1.0]], state_bounds=bounds, input_bounds={"a": 1.0}
    )
    back = np.linalg.inv(found.P)
    rows = {"p": [1, 0], "v": [0, 1], "a": found.K[0]}
    levels = [b**2 / (rows[k] @ back @ rows[k]) for k, b in {**bounds, "a": 1.0}.items()]
    assert found.verify()
    assert found.alpha == pytest.approx(min(levels), rel=2e-9)  # 1e-9 below it, by design
    assert found.alpha < min(levels)


@pytest.mark.parametrize("make", [chen, lambda: cubic()], ids=["continuous", "sampled"])
def test_the_cost_falls_by_the_stage_cost_and_limits_are_kept(make):
    found = make()
    root = np.linalg.inv(np.linalg.cholesky(found.P)).T * np.sqrt(found.alpha)
    rng = np.random.default_rng(0)
    z = rng.standard_normal((2000, 2))
    z *= (rng.uniform(size=(2000, 1)) ** 0.5) / np.linalg.norm(z, axis=1, keepdims=True)
    points = z @ root.T
    moved = points @ found.K.T
    at = np.hstack([points, moved])
    f = np.stack([p.values(at) for p in found.f], axis=1)
    cost = np.einsum("ki,ij,kj->k", points, found.Q, points) + (moved**2 * found.R[0, 0])[:, 0]
    if found.dt is None:
        change = 2 * np.einsum("ki,ij,kj->k", points, found.P, f)
    else:
        change = np.einsum("ki,ij,kj->k", f, found.P, f)
        change = change - np.einsum("ki,ij,kj->k", points, found.P, points)
    assert np.all(change <= -cost + 1e-12)
    assert np.all(np.abs(moved) <= dict(found.bounds)["u"])


def cubic():
    return terminal(
        CUBIC, np.diag([10.0, 1.0]), [[1.0]], controls=[u], dt=DT, input_bounds={"u": 1.0}
    )


def test_a_predictive_controller_stays_feasible_and_its_cost_falls():
    """Built here of the two expressions alone, as a user of do-mpc or acados has them."""
    found, steps = cubic(), 12
    given = found.do_mpc(state := casadi.SX.sym("s", 2), control := casadi.SX.sym("c", 1))
    stage = casadi.Function("stage", [state, control], [given["lterm"]])
    last = casadi.Function("last", [state], [given["mterm"], given["terminal"]])

    def after(s, c):
        return casadi.vertcat(s[0] + DT * s[1], s[1] + DT * (c - s[0] ** 3 + 0.5 * s[0]))

    problem = casadi.Opti()
    X, U, start = problem.variable(2, steps + 1), problem.variable(1, steps), problem.parameter(2)
    problem.subject_to(X[:, 0] == start)
    for k in range(steps):
        problem.subject_to(X[:, k + 1] == after(X[:, k], U[k]))
    problem.subject_to(problem.bounded(-1, U, 1))
    cost, within = last(X[:, steps])
    problem.subject_to(within <= 0)
    cost = cost + sum(stage(X[:, k], U[k]) for k in range(steps))
    problem.minimize(cost)
    problem.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    s, before = np.array([0.9, -0.6]), np.inf
    assert not found.contains(s)
    for _ in range(6):
        problem.set_value(start, s)
        solved = problem.solve()
        now = float(solved.value(cost))
        assert now <= before + 1e-6  # IPOPT's tolerance is 1e-8, relative
        spent = float(stage(s, solved.value(U)[0]))
        before = now - spent
        s = np.array(after(casadi.DM(s), solved.value(U)[0])).ravel()
        problem.set_initial(X, solved.value(X))
        problem.set_initial(U, solved.value(U))


def test_fields_for_acados_are_those_of_the_set():
    found = cubic()
    state = casadi.SX.sym("s", 2)
    given = found.acados(state)
    level = casadi.Function("level", [state], [given["con_h_expr_e"]])
    point = np.array([0.1, -0.2])
    assert float(level(point)) == pytest.approx(point @ found.P @ point, rel=1e-12)
    assert given["uh_e"].tolist() == [found.alpha]
    assert given["lh_e"].tolist() == [-1e10]
    assert np.array_equal(given["W_e"], DT * found.P)
    assert np.array_equal(given["W"][:2, :2], found.Q)
    assert given["W"].shape == (3, 3)
    assert given["yref_e"].shape == (2,)
    assert casadi.is_equal(given["cost_y_expr_e"], state)
    assert np.array_equal(chen().acados()["W_e"], chen().P)


def test_the_same_set_for_casadi_and_a_sampled_linear_model():
    s, c = casadi.SX.sym("s", 2), casadi.SX.sym("c")
    f = casadi.vertcat(s[1], c - s[0])
    same = {"input_bounds": {"c": 1.0}}
    one = terminal(f, np.eye(2), [[1.0]], states=s, controls=c, **same)
    function = casadi.Function("f", [s, c], [f])
    two = terminal(function, np.eye(2), [[1.0]], states=["s_0", "s_1"], controls=["c"], **same)
    assert (one.alpha, one.claim, one.conditions) == (two.alpha, two.claim, two.conditions)
    A = expm(DT * np.array([[0.0, 1.0], [-1.0, 0.0]]))
    model = LinearModel(A, [[0.0], [DT]], np.eye(2), np.zeros((2, 1)), ["a", "b"], ["c"],
                        ["a_m", "b_m"], DT)  # fmt: skip
    assert terminal(model, np.eye(2), [[1.0]], **same).dt == DT


def test_a_file_holds_everything(tmp_path):
    found = cubic()
    again = TerminalSet.load(found.save(tmp_path / "terminal.json"))
    assert again.verified
    assert (again.claim, again.conditions, again.facts) == (
        found.claim,
        found.conditions,
        found.facts,
    )


LIMITED = {"controls": [u], "input_bounds": {"u": 1.0}}


@pytest.mark.parametrize(
    ("f", "weights", "options", "message"),
    [
        ({x: u}, ([[1.0]], [[0.0]]), LIMITED, "R: expected a positive definite"),
        ({x: u}, ([[-1.0]], [[1.0]]), LIMITED, "Q: expected a positive semidefinite"),
        ({x: u}, ([[1.0]], [[1.0]]), {"controls": [u]}, "expected a limit"),
        ({x: u}, ([[1.0]], [[1.0]]), LIMITED | {"gain": [[1.0]]}, "not stable at 0"),
        ({x: u}, ([[1.0]], [[1.0]]), LIMITED | {"share": 1.0}, "between 0 and 1"),
        ({x: u}, ([[1.0]], [[1.0]]), LIMITED | {"state_bounds": {"y": 1.0}}, "known: x"),
        ({x: u, y: -y}, ([[1.0, 1], [0, 1]], [[1.0]]), LIMITED, "symmetric"),
        ({x: -x + 0 * u}, ([[0.0]], [[1.0]]), LIMITED, "cost nothing"),
        ({x: 1 + u}, ([[1.0]], [[1.0]]), LIMITED, "must be 0 at 0"),
        ({x: x**3}, ([[1.0]], [[1.0]]), LIMITED, "no control moves it"),
        ({x: -x}, ([[1.0]], [[1.0]]), {}, "controls of SymPy are named"),
        ({x: -x}, ([[1.0]], [[1.0]]), {"controls": []}, "at least one"),
    ],
)
def test_other_input_is_refused(f, weights, options, message):
    with pytest.raises(InputError, match=message):
        terminal(f, *weights, **options)


def test_what_is_not_proven_is_not_handed_over():
    found = terminal({x: x**3 - x}, [[1.0]], [[1.0]], **LIMITED, share=0.5, gain=[[0.0]],
                     state_bounds={"x": 1.0})  # fmt: skip
    assert found.verified
    none = TerminalSet(*(getattr(found, k) for k in list(found.__dataclass_fields__)[:9]),
                       0.0, None, False, "nothing")  # fmt: skip
    for hand in (none.acados, lambda: none.do_mpc(step=1.0), lambda: none.save("x.json")):
        with pytest.raises(InputError, match="nothing"):
            hand()
    with pytest.raises(InputError, match="step: expected"):
        found.do_mpc()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # do-mpc names what else could be installed
def test_in_do_mpc_the_cost_falls_by_the_stage_cost_at_least(monkeypatch):
    pytest.importorskip("do_mpc", reason="do-mpc is not installed")
    monkeypatch.syspath_prepend(Path(__file__).parents[3] / "examples")
    example = importlib.import_module("terminal_in_do_mpc")
    flown = example.flight(example.controller(example.terminal_set()), (1.0, 1.0), 40)
    x, y, u, cost = flown.T
    assert np.abs(u).max() <= 1 + 1e-6
    stage = 10 * x**2 + y**2 + u**2
    assert (np.diff(cost) <= -stage[:-1] + 1e-5 * cost[:-1] + 1e-6).all()  # as ipopt solves
    assert cost[-1] < 1e-3 * cost[0]
