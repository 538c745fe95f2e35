"""A tube holds for the nonlinear equations, and nothing less than a proof makes one."""

import json
from dataclasses import replace

import casadi
import numpy as np
import pytest

from evidence.planar_vtol.flights import from_its_border as vtol_from_its_border
from evidence.planar_vtol.metric import Metric, proven_positive, refuted
from evidence.planar_vtol.model import over_ground
from evidence.planar_vtol.tubes import CASES as VTOL
from evidence.planar_vtol.tubes import motions, sizes
from evidence.planar_vtol.tubes import proven as vtol_tube
from evidence.tables import chosen, renewed
from evidence.tube_flights import from_its_border, worst
from studies.cli import main
from symheli import Helicopter, trim
from symheli.errors import InputError
from symheli.steady import trim_batch
from synthesis.tubes import Motions, Tube, tube
from synthesis.tubes.controllers import Choice
from synthesis.tubes.deviations import CommandCell, Deviations, _covered
from synthesis.tubes.enclosure import AffineForm, SegmentAverages, equations
from synthesis.tubes.inequality import elementwise, rank_one
from synthesis.tubes.reference import TUBE_SIZES, moving
from synthesis.tubes.tube import _covers


@pytest.fixture(scope="module")
def proven():
    found = tube(Helicopter.load("xcell60", governor="ideal"), 0.0, gust=0.5)
    assert found.verified, found.why
    return found


@pytest.mark.slow
def test_no_nonlinear_flight_leaves_the_tube(proven):
    # from its border, in gusts of full size that change at random, slowly and fast
    assert from_its_border(proven, 40, 1.0) < 1 + 1e-6  # that of the integration


@pytest.mark.slow
def test_the_worst_gust_found_fills_a_good_part_of_the_tube(proven):
    # .4 of its size at least: the tube is not much larger than it must be
    assert 0.4 < worst(proven, float(proven.nodes[-1])) < 1


@pytest.mark.slow
def test_a_saved_tube_is_proven_again_from_its_file(proven, tmp_path, capsys):
    path = proven.save(tmp_path / "tube.json")
    again = Tube.load(path)
    assert again.verified
    np.testing.assert_array_equal(again.P, proven.P)
    assert main(["verify", str(path)]) == 0
    assert "invariant tube of the nonlinear equations" in capsys.readouterr().out


FORGED_FLIGHT = {
    "another flight": lambda c: c["steady"][0][0][0].__setitem__(0, c["steady"][0][0][0][0] + 1.0),
    "larger accelerations": lambda c: c["limits"].__setitem__(0, 2 * c["limits"][0] + 0.1),
    "a heavier helicopter": lambda c: c.update(
        vehicle=c["vehicle"].replace("mass = { value = ", "mass = { value = 1")
    ),
}
"""Of what a file of a helicopter holds; the inequalities are those of any model, `FORGED`."""


@pytest.mark.slow
@pytest.mark.parametrize("forgery", FORGED_FLIGHT)
def test_a_forged_tube_of_a_helicopter_is_not_proven(proven, tmp_path, forgery):
    path = proven.save(tmp_path / "tube.json")
    content = json.loads(path.read_text())
    FORGED_FLIGHT[forgery](content)
    path.write_text(json.dumps(content))
    assert not Tube.load(path).verified
    assert main(["verify", str(path)]) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "damage",
    [
        lambda c: c["limits"].pop(),
        lambda c: c["airspeeds"].append(0.0),
    ],
)
def test_a_damaged_file_of_a_helicopter_is_refused(proven, tmp_path, damage):
    path = proven.save(tmp_path / "tube.json")
    content = json.loads(path.read_text())
    damage(content)
    path.write_text(json.dumps(content))
    with pytest.raises(InputError):
        Tube.load(path)


@pytest.mark.guard
def test_where_there_is_no_tube_it_says_why(tmp_path):
    model, about = _pendulum()
    large = tube(model, about, gust=5.0, sizes=(0.2, 0.3))
    assert not large.verified
    assert "no tube" in str(large)
    with pytest.raises(InputError, match="only a proven tube"):
        large.save(tmp_path / "none.json")
    falls = tube(*_pendulum(gain=(0.0, 0.0)), gust=0.1, sizes=(0.2, 0.3))
    assert not falls.verified


def test_wrong_arguments_are_refused():
    heli = Helicopter.load("xcell60", governor="ideal")
    with pytest.raises(InputError, match="given"):
        tube(heli, 3.0, gust=0.1, known=["u"], gain=np.zeros((4, 10)))
    with pytest.raises(InputError, match="known"):
        tube(heli, 3.0, gust=0.1, known="u")
    with pytest.raises(InputError, match="sampled"):
        tube(heli, (3.0, 4.0), gust=0.1, acceleration=1.0, jerk=1.0, period=0.02)
    with pytest.raises(InputError, match="period"):
        tube(heli, 3.0, gust=0.1, delay=1)
    with pytest.raises(InputError, match="gust"):
        tube(heli, 3.0, gust=float("nan"))
    with pytest.raises(InputError, match="4 by 10"):
        tube(heli, 3.0, gust=0.1, gain=np.zeros((4, 8)))


@pytest.mark.parametrize(
    ("airspeed", "limits"),
    [
        (3.0, {"acceleration": 1.0}),
        ((3.0, 5.0), {}),
        ((3.0, 5.0), {"acceleration": 1.0, "jerk": 0.0}),
        ((5.0, 3.0), {"acceleration": 1.0, "jerk": 1.0}),
        ((3.0, np.nan), {"acceleration": 1.0, "jerk": 1.0}),
        ((3.0, 5.0), {"acceleration": 1.0, "jerk": 1.0, "snap": 0.0}),
    ],
)
def test_limits_of_the_command_that_do_not_fit_are_refused(airspeed, limits):
    heli = Helicopter.load("xcell60", governor="ideal")
    with pytest.raises(InputError):
        tube(heli, airspeed, gust=0.1, **limits)


@pytest.fixture(scope="module")
def accelerating():
    heli = Helicopter.load("xcell60", governor="ideal")
    return heli, moving(heli, np.array([4.0, 5.0, 6.0]), (1.0, 1.0, 2.0))


def _drift(heli, reference):
    data, c = casadi.SX.sym("data", reference.data.shape[1]), casadi.SX.sym("c", 4)
    x, rate, u, _ = reference.between(data, c)
    drift = heli.rhs(x, u, casadi.SX.zeros(3)) - rate
    return casadi.Function("drift", [data, c], [drift, x, rate])


def test_the_reference_follows_the_equations_between_its_nodes(accelerating):
    heli, reference = accelerating
    drift = _drift(heli, reference)
    for i, s, a in ((0, 0.0, 1.0), (0, 0.5, -1.0), (1, 0.3, 0.7), (1, 1.0, 1.0)):
        missed = np.asarray(drift(reference.data[i], [s, a, 0.0, 0.0])[0])
        # splines of 1 m/s: 4 % of the turn that a steady pitch rate of 10 deg/s brings
        assert np.abs(missed).max() < 0.04


def test_the_reference_is_smooth_and_its_rate_that_of_the_state(accelerating):
    heli, reference = accelerating
    drift = _drift(heli, reference)
    a, j, b, h = 0.6, 0.4, -0.5, 1e-5

    def at(t):
        p = 5.0 + a * t + j * t**2 / 2 + b * t**3 / 6
        i, s = reference.place([p])
        c = [s[0], a + j * t + b * t**2 / 2, j + b * t, b]
        return [np.asarray(m)[:, 0] for m in drift(reference.data[i[0]], c)[1:]]

    # across the node at 5 m/s: differences of second order, whose rounding is 1e-16/1e-5
    numeric = (at(h)[0] - at(-h)[0]) / (2 * h)
    np.testing.assert_allclose(numeric, at(0.0)[1], atol=1e-4)


@pytest.mark.slow
def test_the_drift_enclosed_holds_that_of_every_command(accelerating):
    heli, reference = accelerating
    loop = Deviations(heli, reference, 0.1)
    cell = CommandCell(1, (0.25, 0.75), (-0.5, 0.5))
    middle, rest, by_jerk, by_snap = loop.drifts([cell])[0]
    drift, rng = _drift(heli, reference), np.random.default_rng(0)
    for _ in range(300):
        s, a, j, b = rng.uniform([0.25, -0.5, -1, -2], [0.75, 0.5, 1, 2])
        value = np.asarray(drift(reference.data[1], [s, a, j, b])[0])[:, 0]
        # symbols of jerk and snap are their shares of the limits
        assert np.all(np.abs(value - middle - by_jerk * j - by_snap * b / 2) <= rest)


def test_cells_that_leave_a_command_out_are_no_cover(accelerating):
    _, reference = accelerating
    all_ = [CommandCell(i, (0.0, 1.0), a) for i in (0, 1) for a in ((-1.0, 0.0), (0.0, 1.0))]
    assert _covers(all_, reference)
    for k in range(4):
        assert not _covers(all_[:k] + all_[k + 1 :], reference)
    halves = [
        CommandCell(0, (0.0, 0.5), (-1.0, 1.0)),
        CommandCell(0, (0.6, 1.0), (-1.0, 1.0)),
        *all_[2:],
    ]
    assert not _covers(halves, reference)
    assert not _covers([*all_, CommandCell(2, (0.0, 1.0), (-1.0, 1.0))], reference)


def test_a_state_of_the_reference_that_would_jump_with_the_jerk_is_refused(accelerating):
    heli, reference = accelerating
    cells = [CommandCell(i, (0.0, 1.0), (-1.0, 1.0)) for i in (0, 1)]
    assert not _covers(cells, replace(reference, limits=(1.0, 1.0, np.inf)))
    jumping = moving(heli, reference.airspeeds, (1.0, 1.0, np.inf))
    assert _covers(cells, jumping)
    assert not jumping.jerk[:, :10].any()


def test_terms_of_the_remainder_bound_their_matrices():
    rng = np.random.default_rng(2)
    units = rng.uniform(0.1, 2, 7)
    rest = rng.uniform(size=(3, 7)) * (rng.uniform(size=(3, 7)) < 0.7)
    left, weights = elementwise(rest, units)
    matrices = rng.standard_normal((2, 3, 7))
    one, own, more = rank_one(matrices, units)
    for _ in range(300):
        x, v = rng.standard_normal(3), rng.standard_normal(7)
        some = rest * rng.uniform(-1, 1, rest.shape)
        bound = sum(abs(x @ row) * np.sqrt(v @ W @ v) for row, W in zip(left, weights, strict=True))
        assert x @ some @ v <= bound * (1 + 1e-12)
        signs = rng.uniform(-1, 1, 2)
        bound = sum(abs(x @ row) * np.sqrt(v @ W @ v) for row, W in zip(one, own, strict=True))
        bound += np.abs(x) @ more @ np.abs(v)
        assert x @ np.tensordot(signs, matrices, axes=1) @ v <= bound * (1 + 1e-12)


def test_a_jump_between_the_parts_of_a_cell_is_one_number_times_a_matrix():
    # J = A + B s + sign(s - 1/4) l r' (1 + z/10) over four parts of s: two on one side, one open
    rng = np.random.default_rng(3)
    units = np.array([0.5, 2.0, 1.0, 3.0, 1.0])
    A, B = rng.standard_normal((2, 2, 4))
    jump = np.outer(rng.standard_normal(2), rng.standard_normal(4))
    places, open_ = np.array([-0.75, -0.25, 0.25, 0.75])[:, None], np.array([0, 0, 1, 0])
    sides = np.array([-1, -1, 0, 1])
    slopes = np.zeros((4, 2, 4, 3))  # of z and y, and of s within a part
    slopes[..., 2] = 0.25 * B
    slopes[..., 0] = 0.1 * sides[:, None, None] * jump
    centre = A + places[..., None] * B + sides[:, None, None] * jump
    form = AffineForm(centre, slopes, np.zeros(centre.shape), (1, 1, 1))
    switched = open_[:, None, None, None, None] * jump[..., None]
    turning = np.zeros((4, 1, 2, 4, 3, 1))
    turning[..., 0, :] = 0.1 * switched
    parts = SegmentAverages(form, switched, turning)
    found, left, weights = _covered(parts, places, np.array([0.25]), 0, units)
    np.testing.assert_allclose(found.centre, A, atol=1e-2)
    np.testing.assert_allclose(found.slopes[..., 2], B, atol=1e-2)  # offsets are tamed by 1e-3
    assert len(left) == 1
    # left is what the parts turn with z: by -.1, -.1, 0 and .1 of the jump, by -.025 on average
    assert found.rest.max() < 0.13 * np.abs(jump).max()
    for _ in range(300):
        part, (z, y), s, k, t = rng.integers(4), *rng.uniform(-1, 1, (2, 2)), *rng.uniform(-1, 1, 2)
        s = s[0]
        J = centre[part] + slopes[part] @ [z, y, s] + open_[part] * jump * (k + 0.1 * t * z)
        at = found.centre + found.slopes @ [z, y, places[part, 0] + 0.25 * s]
        x, v = rng.standard_normal(2), rng.standard_normal(5)
        bound = np.abs(x) @ found.rest @ np.abs(v[:4])
        bound += sum(
            abs(x @ row) * np.sqrt(v @ W @ v) for row, W in zip(left, weights, strict=True)
        )
        assert abs(x @ (J - at) @ v[:4]) <= bound * (1 + 1e-12)


def test_rows_that_are_not_run_stay_as_the_page_has_them():
    names = [["one", "3"], ["other", "3"], ["other", "8"]]
    shown = [["one", "3", "0.5", "the day before"], ["other", "3", "0.6", "the day before"]]
    kept, found = renewed(names, lambda k: [f"found {k}"], chosen(["other, 3"], names), shown)
    assert kept == shown[0]
    assert found[:3] == ["other", "3", "found 1"]
    assert chosen([], names) == {0, 1, 2}
    with pytest.raises(InputError, match="no row 'other'; rows are"):
        chosen(["other"], names)


def test_along_a_range_the_feedback_spares_the_pitching_moment_of_the_tail():
    heli, p = Helicopter.load("xcell60", governor="ideal"), np.array([12.5, 12.5])
    level = trim(heli, airspeed=p[0])
    edges = trim_batch(heli, p, acceleration=np.array([-1.0, 1.0]))
    sides = [heli.jacobian(*at, np.zeros(3))[:2] for at in zip(edges.x, edges.u, strict=True)]

    def jump(choice):
        K = choice.regulator(heli, np.array(level.x), np.array(level.u))
        low, high = (np.asarray(A + B @ K)[4] * np.array(TUBE_SIZES[:10]) for A, B in sides)
        return np.linalg.norm(high - low)

    # in the wake, and out of it with a stalled tail: about .4 of that with one weight for all
    assert jump(Choice(moving=True)) < 0.5 * jump(Choice())


@pytest.mark.slow
def test_the_set_of_a_cell_with_two_kinks_holds_the_jacobians_in_it():
    heli, n, count = Helicopter.load("xcell60", governor="ideal"), 10, 800
    loop = Deviations(heli, moving(heli, np.array([9.0, 10.0]), (1.0, 1.0, 1.0)), 0.15)
    cell, factor = CommandCell(0, (0.0, 1.0), (0.0, 0.5)), np.diag(0.2 * np.array(TUBE_SIZES[:n]))
    drifts = np.zeros((1, 4, n))
    (over,) = loop.enclosed([cell], factor[None], drifts)
    e, w, c, data = (
        casadi.SX.sym(name, k)
        for name, k in zip("ewcd", (n, 3, 4, len(loop.reference.data[0])), strict=True)
    )
    rate = loop.rate(e, w, c, data)
    slopes = casadi.Function("J", [e, w, c, data], [casadi.jacobian(rate, casadi.vertcat(e, w))])
    rng = np.random.default_rng(4)
    z, y = (rng.standard_normal((count, k)) for k in (n, 3))
    z, y = (m / np.linalg.norm(m, axis=1, keepdims=True) for m in (z, y))
    share = rng.uniform(size=(2, count))
    c = np.stack([share[0], 0.5 * share[1], *rng.uniform(-1, 1, (2, count))])
    nodes, weight = np.polynomial.legendre.leggauss(25)  # 1e5 Jacobians
    J = np.zeros((count, n, n + 3))
    for at, own in zip((nodes + 1) / 2, weight / 2, strict=True):
        found = slopes.map(count)(at * (z @ factor).T, at * y.T, c, loop.reference.data[0])
        J += own * np.asarray(found).reshape(n, count, n + 3).transpose(1, 0, 2)
    corners, way = over.corners[..., :-1], 2 * share - 1
    s, a, j = np.stack([way[0], way[1], c[2]])[..., None, None] / 2
    at = sum(
        (0.5 + (2 * p - 1) * s)
        * (0.5 + (2 * q - 1) * a)
        * (0.5 + (2 * r - 1) * j)
        * corners[p, q, r]
        for p in (0, 1)
        for q in (0, 1)
        for r in (0, 1)
    )
    linear = np.tensordot(z, over.tube, axes=1) + np.tensordot(y, over.gust, axes=1)
    off = J - at - linear[..., :-1]
    # the products with (e, w): the set has z H w as y G e
    v = np.hstack([z @ factor, y, np.zeros((count, 1))])
    missed = np.einsum("cab,cb->ca", off, v[:, :-1])
    x = rng.standard_normal((200, n)) / np.diag(factor)
    limit = np.abs(x @ over.left.T) @ np.sqrt(np.einsum("ca,kab,cb->kc", v, over.weights, v))
    assert np.all(np.abs(x @ missed.T) <= limit + 1e-3)  # of a quadrature over kinks


def _pendulum(reference=None, gain=(-3.0, -2.0), **about):
    x, u, w = (casadi.SX.sym(n, k) for n, k in (("x", 2), ("u", 1), ("w", 1)))
    f = casadi.vertcat(x[1], casadi.sin(x[0]) + u + w)
    if reference is None:
        c = casadi.SX.sym("c", 0)
        reference = casadi.Function("upright", [c], [casadi.SX.zeros(2), casadi.SX.zeros(1)])
    return casadi.Function("pendulum", [x, u, w], [f]), Motions(reference, [list(gain)], **about)


@pytest.fixture(scope="module")
def upright():
    model, about = _pendulum()
    found = tube(model, about, gust=0.2, sizes=(0.2, 0.3))
    assert found.verified, found.why
    return found.with_gain(["x0"]).with_gain(["x0"], energy=False)


@pytest.fixture(scope="module")
def swinging():
    """About angles from 0 to a quarter, commanded with their rate and acceleration."""
    c = casadi.SX.sym("c", 3)
    swing = [casadi.vertcat(c[0], c[1]), c[2] - casadi.sin(c[0])]
    model, about = _pendulum(
        casadi.Function("swing", [c], swing),
        schedule=[0.0, 0.25],
        rate=(-0.2, 0.2),
        others=[[-0.2, 0.2]],
        pieces=(2, 1),
    )
    found = tube(model, about, gust=0.2, sizes=(0.2, 0.3))
    assert found.verified, found.why
    return found


@pytest.mark.guard
def test_a_saved_tube_about_moving_references_is_proven_again(swinging, tmp_path, capsys):
    path = swinging.save(tmp_path / "tube.json")
    again = Tube.load(path)
    assert again.verified
    np.testing.assert_array_equal(again.P, swinging.P)
    assert main(["verify", str(path)]) == 0
    assert "invariant tube of the nonlinear equations" in capsys.readouterr().out


def _without_a_part(content):
    for name in ("cells", "factors", "multipliers"):
        content[name].pop()


FORGED = {
    "larger gusts": lambda c: c.update(gust=2.0 * c["gust"]),
    "a smaller tube": lambda c: c.update(P=(4 * np.array(c["P"])).tolist()),
    "a larger tube than enclosed": lambda c: c.update(P=(0.5 * np.array(c["P"])).tolist()),
    "no feedback": lambda c: c.update(gain=(0 * np.array(c["gain"])).tolist()),
    "the feedback's sign": lambda c: c.update(gain=(-np.array(c["gain"])).tolist()),
    "negative multiplier": lambda c: c["multipliers"][0].update(wind=[[-1.0]]),
    "no multiplier": lambda c: c["multipliers"][-1].update(tube=np.zeros((2, 2)).tolist()),
    "a part of the commands left out": _without_a_part,
    "the proof of a part left out": lambda c: c["multipliers"].pop(),
    "a faster command": lambda c: c.update(rate=[2 * r for r in c["rate"]]),
    "a wider command": lambda c: c["others"].__setitem__(0, [-0.6, 0.6]),
    "a longer schedule": lambda c: c["schedule"].__setitem__(-1, 0.9),
    "other equations": lambda c: c["model"]["operations"].__setitem__(2, ["cos", 1]),
}


@pytest.mark.guard
@pytest.mark.parametrize("forgery", FORGED)
def test_a_forged_tube_is_not_proven(swinging, tmp_path, forgery):
    path = swinging.save(tmp_path / "tube.json")
    content = json.loads(path.read_text())
    FORGED[forgery](content)
    path.write_text(json.dumps(content))
    assert not Tube.load(path).verified
    assert main(["verify", str(path)]) == 1


@pytest.mark.guard
@pytest.mark.parametrize(
    "damage",
    [
        lambda c: c.pop("gain"),
        lambda c: c.update(P=[[1.0]]),
        lambda c: c.update(gust=float("nan")),
        lambda c: c.update(version=1),
        lambda c: c["cells"].append([0]),
        lambda c: c["others"].append([0.0]),
        lambda c: c.update(schema="another"),
        lambda c: c["multipliers"][0].update(terms="text"),
    ],
)
def test_a_damaged_file_is_refused(swinging, tmp_path, damage):
    path = swinging.save(tmp_path / "tube.json")
    content = json.loads(path.read_text())
    damage(content)
    path.write_text(json.dumps(content))
    with pytest.raises(InputError):
        Tube.load(path)


@pytest.mark.guard
def test_a_tube_of_any_model_and_its_gains_are_proven_again_from_the_file(upright, tmp_path):
    again = Tube.load(upright.save(tmp_path / "tube.json"))
    assert again.verified
    assert [gain.gamma for gain in again.gains] == [gain.gamma for gain in upright.gains]
    assert again.hypotheses == upright.hypotheses


@pytest.mark.guard
@pytest.mark.parametrize(
    "forgery",
    [
        lambda c: (
            c.update(gust=1.2 * c["gust"]),
            [gain.update(gust=c["gust"]) for gain in c["gains"]],
        ),
        lambda c: c["gains"][0].update(energy=False),
        lambda c: c["gains"][0]["multipliers"][0].update(
            wind=(0.9 * np.array(c["gains"][0]["multipliers"][0]["wind"])).tolist()
        ),
        lambda c: c["gains"][1].update(Q=(0.9 * np.array(c["gains"][1]["Q"])).tolist()),
        lambda c: c["gains"][1].update(multipliers=[]),
        lambda c: c["gains"][0].update(bias=-1e-3),
    ],
)
def test_a_forged_gain_is_not_proven(upright, tmp_path, forgery):
    path = upright.save(tmp_path / "tube.json")
    content = json.loads(path.read_text())
    forgery(content)
    path.write_text(json.dumps(content))
    assert not Tube.load(path).verified


@pytest.mark.guard
@pytest.mark.parametrize(
    ("forgery", "words"),
    [
        *(
            (lambda c, gust=g: c["gains"][0].update(gust=gust), "gusts of")
            for g in (2, 20, -0.2, 0)
        ),
        (lambda c: c.update(gust=-0.2, gains=[]), "gust: expected"),
        (lambda c: c.update(gust=0.0), "gusts of 0"),
        (lambda c: c.update(states=["x0", "x0"]), "once each"),
        (lambda c: c.update(factors=np.zeros_like(c["factors"]).tolist()), "singular"),
        (lambda c: c["factors"][0].__setitem__(1, c["factors"][0][0]), "singular"),
    ],
)
def test_a_forged_tube_is_refused_in_words(upright, tmp_path, forgery, words):
    """The gain of a pendulum was a hundredth of the true one after one number was changed."""
    path = upright.save(tmp_path / "tube.json")
    content = json.loads(path.read_text())
    forgery(content)
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=words) as told:
        Tube.load(path)
    assert str(path) in str(told.value)


@pytest.mark.guard
def test_a_gain_in_other_gusts_than_its_tube_is_not_verified(upright):
    other = replace(upright, gains=(replace(upright.gains[0], gust=20.0),))
    assert upright.verify()
    assert not other.verify()


@pytest.mark.guard
@pytest.mark.parametrize("moving", [True, False])
def test_a_reference_that_does_not_exist_for_all_commands_has_no_tube(moving):
    """sqrt(c) for c from -1/2 on; the plant is linear, so that its Jacobian does not see x_r."""
    x, u, w, c = (casadi.SX.sym(n, k) for n, k in (("x", 2), ("u", 1), ("w", 1), ("c", 1)))
    line = casadi.Function("line", [x, u, w], [casadi.vertcat(x[1], u + w)])
    outputs = [casadi.vertcat(0.1 * casadi.sqrt(c), 0), casadi.SX.zeros(1), casadi.SX.zeros(2)]
    root = casadi.Function("root", [c], outputs[: 3 if moving else 2])
    found = {
        low: tube(line, Motions(root, [[-3, -2]], others=[[low, 0.5]]), gust=0.1, sizes=[0.2, 0.3])
        for low in (-0.5, 0.1)
    }
    assert found[0.1].verified
    assert not found[-0.5].verified
    assert "reference is not defined" in found[-0.5].why


def test_a_tube_without_gusts_has_no_gain():
    model, about = _pendulum()
    with pytest.raises(InputError, match="gust > 0"):
        tube(model, about, gust=0.0, sizes=(0.2, 0.3)).with_gain(["x0"])


def test_a_local_gain_is_between_that_flown_and_that_of_the_extreme_linear_loops(upright):
    # x'' = (slope - 3) x - 2 x' + w, slope = sin(x)/x within [.997, 1] on the tube
    energy, peak = (gain.gamma for gain in upright.gains)
    # no resonance above d = 1/sqrt 2: the static gain 1/2; peak^2 = 1/(2 2 omega^2), X of Lyapunov
    assert 0.5 <= energy < 0.5 * 1.02
    assert 8**-0.5 <= peak < 8**-0.5 * 1.05


def test_a_gain_of_a_state_that_there_is_none_is_refused(upright):
    for outputs in ("x0", [], ["x0", "speed"]):
        with pytest.raises(InputError, match="outputs"):
            upright.with_gain(outputs)


def test_equations_are_the_same_when_read_again():
    x = casadi.SX.sym("x", 2)
    f = casadi.Function(
        "f", [x], [casadi.fabs(x[0]) / x[1] - casadi.if_else(x[0] > 0.1, casadi.sin(x[1]), 2.5)]
    )
    again = equations.read(json.loads(json.dumps(equations.written(f))))
    for at in ([0.3, 2.0], [-0.2, 0.7]):
        assert float(again(at)) == float(f(at))


@pytest.mark.parametrize(
    "damage",
    [
        lambda c: c["operations"].append(["add", 0, 10**6]),
        lambda c: c["operations"].append(["unknown", 0]),
        lambda c: c["operations"].__setitem__(0, ["input", 3, 0]),
        lambda c: c["outputs"].append([10**6]),
    ],
)
def test_equations_that_are_none_are_refused(damage):
    x = casadi.SX.sym("x", 2)
    content = equations.written(casadi.Function("f", [x], [x[0] * x[1]]))
    damage(content)
    with pytest.raises(InputError):
        equations.read(content)


def test_motions_that_do_not_fit_are_refused():
    model, about = _pendulum()
    with pytest.raises(InputError, match="sizes"):
        tube(model, about, gust=0.1)
    with pytest.raises(InputError, match="Motions"):
        tube(model, 3.0, gust=0.1, sizes=(1, 1))
    with pytest.raises(InputError, match="helicopter"):
        tube(model, about, gust=0.1, sizes=(1, 1), acceleration=1.0)
    with pytest.raises(InputError, match="must take"):
        tube(casadi.Function("f", [], []), about, gust=0.1, sizes=(1, 1))
    for wrong in (
        {"gain": (1.0, 2.0, 3.0)},
        {"others": [[0.0, 1.0]]},
        {"schedule": [1.0, 0.0]},
        {"rate": (0.0, 1.0)},
        {"pieces": (0,)},
        {"states": ("x",)},
    ):
        with pytest.raises(InputError):
            _pendulum(**wrong)


def test_a_reference_that_misses_the_equations_moves_the_tube():
    c = casadi.SX.sym("c", 0)
    drifting = casadi.Function(
        "off", [c], [casadi.SX([0.02, 0]), casadi.SX(0.0), casadi.SX([0, 0])]
    )
    model, about = _pendulum(drifting)
    found = tube(model, about, gust=0.2, sizes=(0.2, 0.3))
    _, exact = _pendulum()
    assert found.verified
    # .02 of an acceleration are a tenth of the gust
    assert (
        found.half_widths[0] > 1.05 * tube(model, exact, gust=0.2, sizes=(0.2, 0.3)).half_widths[0]
    )


@pytest.mark.slow
@pytest.mark.parametrize("case", [c for c in VTOL if not c.bank], ids=lambda c: c.motions)
def test_the_planar_vtol_stays_within_less_than_the_published_tube(case):
    found = vtol_tube(case)
    assert found.verified, found.why
    position, control = sizes(found)
    assert position < 0.5713518919661784  # compute_tubes.m, lambda 1.2
    assert control < 0.5687971228165479
    assert vtol_from_its_border(found, 500, 40) < 1 + 1e-6  # that of the integration


@pytest.mark.slow
def test_the_cells_of_a_schedule_are_enclosed_with_all_others():
    case = next(c for c in VTOL if c.bank)
    loop = Deviations(over_ground(), motions(case), case.gust)
    cell = CommandCell(1, (0.0, 1.0), loop.reference.ranges[0], loop.reference.ranges[1:])
    factor = np.diag([0.1, 0.1, 0.15, 0.3, 0.3, 1.0])
    (over,) = loop.enclosed([cell], factor[None], loop.drifts([cell]))
    rng, data = np.random.default_rng(0), loop.reference.data[1]
    for _ in range(300):
        z, w = rng.standard_normal(6), rng.uniform(-1, 1)
        e = factor @ z / np.linalg.norm(z)
        c = [rng.uniform(low, high) for low, high in cell.ranges]
        moved = np.asarray(loop.rate(e, w, c, data))[:, 0]
        x = rng.standard_normal(6)
        # x'F (e, w, 1) is at most that at a corner, plus what symbols and terms add
        v = np.concatenate([e, [w, 1.0]])
        bound = max(x @ F @ v for F in over.corners.reshape(-1, 6, 8))
        bound += np.linalg.norm([x @ over.onto @ H @ v for H in over.tube])
        bound += np.linalg.norm([x @ over.onto @ H @ v for H in over.gust])
        for row, W in zip(over.left, over.weights, strict=True):
            bound += abs(x @ row) * np.sqrt(v @ W @ v)
        assert x @ moved <= bound * (1 + 1e-9) + 1e-12  # roundings of this sum


@pytest.mark.slow
def test_the_published_metric_is_refuted_at_its_own_tube():
    metric = Metric.stored("position")
    found = refuted(metric, metric.tube)
    assert found is not None
    assert found[1] < 0
    assert refuted(metric, 2 * metric.tube) is None


@pytest.mark.slow
def test_positions_of_the_published_metric_are_bounded_between_the_points():
    metric = Metric.stored("position")
    assert proven_positive(metric.position(0.6785))  # the largest on a grid is .67650
    assert not proven_positive(metric.position(0.676))
