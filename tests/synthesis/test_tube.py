"""A tube holds for the nonlinear equations, and nothing less than a proof makes one."""

import json

import numpy as np
import pytest

from evidence.tubes import flown, worst
from studies.cli import main
from symheli import Helicopter
from symheli.errors import InputError
from synthesis import Tube, tube
from synthesis.tubes.inequality import elementwise, rank_one

CASES = [
    ("xcell60", 0.0, 0.5),
    pytest.param(("xcell_kahn_hudson", 8.0, 0.25), marks=pytest.mark.slow),
]


@pytest.fixture(scope="module", params=CASES)
def proven(request):
    name, airspeed, gust = request.param
    found = tube(Helicopter.load(name, governor="ideal"), airspeed, gust=gust)
    assert found.proven, found.why
    return found


@pytest.mark.slow
def test_no_nonlinear_flight_leaves_the_tube(proven):
    # from its border, in gusts of full size that change at random, slowly and fast
    rng = np.random.default_rng(0)
    count = 200
    e = rng.standard_normal((count, 10)) @ np.linalg.inv(np.linalg.cholesky(proven.P))
    e /= np.sqrt(np.einsum("ki,ij,kj->k", e, proven.P, e))[:, None]
    held = rng.integers(2, 200, count)
    w = np.zeros((count, 3))

    def gust(k):
        new = rng.standard_normal((count, 3))
        new *= proven.deviations.gust / np.linalg.norm(new, axis=1, keepdims=True)
        change = k % held == 0
        w[change] = new[change]
        return w.copy()

    most = flown(proven, e, gust, 400)
    assert most < 1 + 1e-6  # that of the integration


@pytest.mark.slow
def test_the_worst_gust_found_fills_a_good_part_of_the_tube(proven):
    # .4 of its size at least: the tube is not much larger than it must be
    assert 0.4 < worst(proven) < 1


@pytest.mark.slow
def test_a_saved_tube_is_proven_again_from_its_file(proven, tmp_path, capsys):
    path = proven.save(tmp_path / "tube.json")
    again = Tube.load(path)
    assert again.proven
    np.testing.assert_array_equal(again.P, proven.P)
    assert main(["verify", str(path)]) == 0
    assert "invariant tube of the nonlinear equations" in capsys.readouterr().out


FORGED = {
    "larger gusts": lambda c: c.update(gust=1.5 * c["gust"]),
    "a smaller tube": lambda c: c.update(P=(4 * np.array(c["P"])).tolist()),
    "a larger tube than enclosed": lambda c: c.update(P=(0.8 * np.array(c["P"])).tolist()),
    "no feedback": lambda c: c.update(gain=np.zeros((4, 10)).tolist()),
    "the feedback's sign": lambda c: c.update(gain=(-np.array(c["gain"])).tolist()),
    "another flight": lambda c: c["x"].__setitem__(0, c["x"][0] + 1.0),
    "negative multiplier": lambda c: c["multipliers"].update(wind=[[-1.0]]),
    "no multiplier": lambda c: c["multipliers"].update(tube=np.zeros((10, 10)).tolist()),
    "a heavier helicopter": lambda c: c.update(
        vehicle=c["vehicle"].replace("mass = { value = ", "mass = { value = 1")
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("forgery", FORGED)
def test_a_forged_tube_is_not_proven(proven, tmp_path, forgery):
    path = proven.save(tmp_path / "tube.json")
    content = json.loads(path.read_text())
    FORGED[forgery](content)
    path.write_text(json.dumps(content))
    assert not Tube.load(path).proven
    assert main(["verify", str(path)]) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "damage",
    [
        lambda c: c.pop("gain"),
        lambda c: c.update(P=[[1.0]]),
        lambda c: c.update(gust=float("nan")),
        lambda c: c.update(version=2),
        lambda c: c.update(schema="another"),
        lambda c: c["multipliers"].update(terms="text"),
    ],
)
def test_a_damaged_file_is_refused(proven, tmp_path, damage):
    path = proven.save(tmp_path / "tube.json")
    content = json.loads(path.read_text())
    damage(content)
    path.write_text(json.dumps(content))
    with pytest.raises(InputError):
        Tube.load(path)


@pytest.mark.slow
def test_where_there_is_no_tube_it_says_why(tmp_path):
    heli = Helicopter.load("xcell60", governor="ideal")
    large = tube(heli, 8.0, gust=3.0)
    assert not large.proven
    assert "no tube" in str(large)
    with pytest.raises(InputError, match="only a proven tube"):
        large.save(tmp_path / "none.json")
    loose = tube(heli, 0.0, gust=0.1, gain=np.zeros((4, 10)))
    assert not loose.proven


def test_wrong_arguments_are_refused():
    heli = Helicopter.load("xcell60", governor="ideal")
    with pytest.raises(InputError, match="ideal governor"):
        tube(Helicopter.load("xcell60"), 3.0, gust=0.1)
    with pytest.raises(InputError, match="gust"):
        tube(heli, 3.0, gust=float("nan"))
    with pytest.raises(InputError, match="4 by 10"):
        tube(heli, 3.0, gust=0.1, gain=np.zeros((4, 8)))


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
