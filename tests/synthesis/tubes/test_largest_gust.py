"""The largest gust of a tube against closed forms."""

import json
from math import sqrt

import casadi
import numpy as np
import pytest

from symheli.errors import InputError
from synthesis.tubes import Motions, Tube, largest_gust

TRUTH = 2 / (3 * sqrt(3))
"""x' = -x + x^3 + w: an interval |x| <= r is invariant where |w| <= r - r^3, at most this."""


def cubic(unit=1.0, time=1.0):
    x, u, w = (casadi.SX.sym(s) for s in ("x", "u", "w"))
    X = unit * x
    f = casadi.Function("cubic", [x, u, w], [time * (-X + X**3 + w) / unit + u])
    return f, at_rest(1, [[0.0]])


def at_rest(n, gain):
    c = casadi.SX.sym("c", 0)
    return Motions(casadi.Function("rest", [c], [casadi.SX(n, 1), casadi.SX(1, 1)]), gain)


@pytest.fixture(scope="module")
def rough():
    return largest_gust(*cubic(), sizes=[0.2], accuracy=0.9, segments=2)


def test_a_rough_search_stays_below_the_truth_and_brackets_it_by_its_accuracy(rough):
    assert rough.tube.verified
    assert rough.tube.deviations.gust == rough.gust
    assert 0.3 * TRUTH < rough.gust < TRUTH
    assert rough.gust < rough.refused <= 2 * rough.gust
    r = rough.tube.half_widths[0]
    assert r - r**3 > rough.gust


def test_a_file_keeps_the_segments(rough, tmp_path):
    file = rough.tube.save(tmp_path / "tube.json")
    assert Tube.load(file).verified
    content = json.loads(file.read_text())
    assert content["segments"] == 2
    for forged in (0, -1, 2.0, "2", 10**6):
        file.write_text(json.dumps(content | {"segments": forged}))
        with pytest.raises(InputError):
            Tube.load(file)


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "time"), [(1.0, 1.0), (1e3, 1.0), (1.0, 1e3)])
def test_the_cubic_is_proven_to_a_twentieth_below_the_truth(unit, time):
    found = largest_gust(*cubic(unit, time), sizes=[0.2 / unit])
    assert found.tube.verify()
    assert 0.94 * TRUTH < found.gust < TRUTH


@pytest.mark.slow
def test_more_segments_come_nearer():
    found = largest_gust(*cubic(), sizes=[0.2], segments=64, accuracy=0.005)
    assert 0.97 * TRUTH < found.gust < TRUTH


@pytest.mark.slow
def test_a_limit_of_a_state_holds():
    limit = 0.3
    found = largest_gust(*cubic(), sizes=[0.2], limits={"x0": limit})
    assert found.tube.half_widths[0] < limit
    assert 0.96 * (limit - limit**3) < found.gust < limit - limit**3


def test_an_unstable_loop_has_no_gust():
    x, u, w = casadi.SX.sym("x", 2), casadi.SX.sym("u"), casadi.SX.sym("w")
    rate = casadi.vertcat(x[1], casadi.sin(x[0]) + 0 * u + w)
    falling = casadi.Function("falling", [x, u, w], [rate])
    found = largest_gust(falling, at_rest(2, np.zeros((1, 2))), sizes=[0.2, 0.3])
    assert found.gust == 0
    assert not found.tube.verified
    assert str(found) == f"no tube at any gust: {found.tube.why}"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"limits": {"y": 1.0}}, "'y' is no state or control; known: x0, u0"),
        ({"limits": {"x0": 0.0}}, "the limit of x0"),
        ({"limits": 0.3}, "limits: expected"),
        ({"accuracy": 0.0}, "accuracy"),
        ({"segments": 0}, "segments"),
        ({"segments": 10**6}, "at most"),
        ({"sizes": None}, "sizes are needed"),
        ({"gust": 1.0}, "gust"),
    ],
)
def test_other_input_is_refused(options, message):
    with pytest.raises(InputError, match=message):
        largest_gust(*cubic(), **({"sizes": [0.2]} | options))
