"""A parallelepiped that no motion of a sampled loop leaves: known cases, and what has none."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from studies.cli import main
from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError
from synthesis.sets import InvariantSet, LowComplexitySet, low_complexity_set


def autonomous(A):
    A = np.array(A, dtype=float)
    n = len(A)
    names = [f"x{i}" for i in range(n)]
    return LinearModel(
        A, np.zeros((n, 0)), np.eye(n), np.zeros((n, 0)), names, [], [f"y{i}" for i in range(n)],
        dt=0.1,
    )  # fmt: skip


BOX = {"x0": 1.0, "x1": 1.0}


def test_where_the_limits_themselves_are_invariant_they_are_found():
    found = low_complexity_set(autonomous([[0.5, 0.4], [-0.3, 0.6]]), state_bounds=BOX)
    assert found.verified
    # the search leaves 1e-9 of every sum, and ends where steps of 1e-4 no longer help
    assert found.volume == pytest.approx(4.0, rel=1e-3)


@pytest.mark.parametrize(("angle", "there"), [(0.3, True), (0.5, False), (1.2, False)])
def test_a_spiral_has_one_where_the_sum_of_its_parts_is_below_one(angle, there):
    # poles r exp(+-j angle): |Re| + |Im| < 1 is necessary and sufficient for one with four faces
    r = 0.78
    turn = r * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    assert (r * (np.cos(angle) + np.sin(angle)) < 1) == there
    assert low_complexity_set(autonomous(turn), state_bounds=BOX).verified == there


def test_of_a_lag_with_a_disturbance_it_is_the_closed_form():
    # .5 X + .1 <= X at a limit of 1; and none at a limit below .2
    lag = LinearModel([[0.5]], [[0.1]], [[1.0]], [[0.0]], ["x"], ["w"], ["y"], dt=0.1)
    loud = {"disturbance": {"w": 1.0}}
    assert low_complexity_set(lag, state_bounds={"x": 1.0}, **loud).half_widths[0] == pytest.approx(
        1.0, rel=1e-6
    )
    assert low_complexity_set(lag, state_bounds={"x": 0.21}, **loud).verified
    assert not low_complexity_set(lag, state_bounds={"x": 0.19}, **loud).verified


@pytest.fixture(scope="module")
def scheduled():
    """Of three states, quadratic in p, which may jump, with a gain."""
    rng = np.random.default_rng(4)
    A = np.stack([rng.standard_normal((3, 3)) * s for s in (0.25, 0.1, 0.05)])
    B = np.stack([rng.standard_normal((3, 2)) * s for s in (0.1, 0.02, 0.0)])
    model = LPVStateSpace.polynomial(
        A, B, np.eye(3)[None], np.zeros((1, 3, 2)),
        scheduling=Scheduling("p", "1", -1.0, 1.0), states=["x0", "x1", "x2"], inputs=["u", "w"],
        outputs=["y0", "y1", "y2"], dt=0.1,
    )  # fmt: skip
    found = low_complexity_set(
        model,
        controller=[[-0.3, 0.2, 0.1]],
        state_bounds={"x0": 1.0, "x1": 1.0, "y2": 2.0},
        input_bounds={"u": 0.5},
        disturbance={"w": 0.5},
    )
    assert found.verified, found.why
    return found


def test_no_motion_leaves_it_and_a_larger_one_is_not_proven(scheduled):
    rng, own = np.random.default_rng(0), scheduled.statement
    K, W = own.feedback.D[0], np.linalg.inv(scheduled.V)
    x = scheduled.V @ rng.choice([-1.0, 1.0], (3, 200))
    for _ in range(50):
        M = own.model.matrices(float(rng.uniform(-1, 1)))
        # from a corner in the disturbance that pushes most; then on from where it got
        ahead = (M.A + M.B[:, :1] @ K) @ x
        face = np.abs(W @ ahead).argmax(axis=0)
        push = np.sign((W @ ahead)[face, range(200)] * (W @ M.B[:, 1])[face])
        x = ahead + 0.5 * np.outer(M.B[:, 1], push)
        assert scheduled.contains(x.T)
        assert np.abs(K @ x).max() <= 0.5
    assert not replace(scheduled, V=1.5 * scheduled.V).verify()  # beyond the limits
    assert not replace(scheduled, V=0.01 * scheduled.V).verify()  # too small for the disturbance
    assert not replace(scheduled, V=scheduled.V[:, [0, 0, 1]]).verify()
    rigid = replace(scheduled.statement, disturbance={"w": 50.0})
    assert not replace(scheduled, statement=rigid).verify()


def test_a_saved_set_is_proven_again_from_its_file(scheduled, tmp_path, capsys):
    path = scheduled.save(tmp_path / "set.json")
    assert LowComplexitySet.load(path).verified
    assert main(["verify", str(path)]) == 0
    assert (
        "proven in exact arithmetic: invariant parallelepiped: no motion leaves it"
        in capsys.readouterr().out
    )
    with pytest.raises(InputError, match="expected InvariantSet"):
        InvariantSet.load(path)
    content = json.loads(path.read_text())
    content["disturbance"] = [["w", 5.0]]
    path.write_text(json.dumps(content))
    assert not LowComplexitySet.load(path).verified
    assert main(["verify", str(path)]) == 1


def test_the_sums_are_those_of_linear_programs(scheduled):
    # the dual of max (W A V)_i z over |z| <= 1 at many p, by brute force over the vertices
    own = scheduled.statement
    K, W = own.feedback.D[0], np.linalg.inv(scheduled.V)
    z = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1)
    for p in np.linspace(-1, 1, 21):
        M = own.model.matrices(p)
        ahead = W @ (M.A + M.B[:, :1] @ K) @ scheduled.V @ z
        push = 0.5 * np.abs(W @ M.B[:, 1])
        assert (np.abs(ahead).max(axis=1) + push).max() <= 1
    assert scheduled.volume == pytest.approx(8 * abs(np.linalg.det(scheduled.V)))
    assert math.isclose(scheduled.level(scheduled.V[:, 0]), 1.0, rel_tol=1e-12)


def test_limits_that_see_no_state_say_so():
    found = low_complexity_set(
        LinearModel([[0.5]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"], dt=0.1),
        controller=[[0.0]],
        input_bounds={"u": 1.0},
    )
    assert not found.verified
    assert "limit a state" in found.why


@pytest.mark.parametrize(
    ("model", "options", "told"),
    [
        (autonomous([[0.5]]), {}, "at least one of"),
        (replace(autonomous([[-0.5]]), dt=None), {"state_bounds": {"x0": 1.0}}, "discrete time"),
        (
            LinearModel([[0.5]], [[1.0]], [[1.0]], [[0.0]], ["x0"], ["u"], ["y"], dt=0.1),
            {"state_bounds": {"x0": 1.0}},
            "expected gains for u",
        ),
        ("model", {"state_bounds": {"x0": 1.0}}, "expected an LPVStateSpace"),
    ],
)
def test_wrong_arguments_are_refused(model, options, told):
    with pytest.raises(InputError, match=told):
        low_complexity_set(model, **options)
