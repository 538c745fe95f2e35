"""The checker on claims with the P, K or V of somebody else: proofs, forged and damaged files."""

import json
import random
from fractions import Fraction

import numpy as np
import pytest

from symheli.errors import SymheliError
from synthesis.checker import report
from synthesis.checker.claims import nonnegative
from synthesis.claims import (
    GridPlant,
    LimitedPlant,
    LyapunovClaim,
    PolynomialPlant,
    ProvenClaim,
    RegionClaim,
    TerminalClaim,
    VertexPlant,
    check,
)
from synthesis.claims.plants import box_limits
from synthesis.numerics.polynomial.direction import not_positive

pytestmark = pytest.mark.guard

PROVEN, NOT_PROVEN, UNKNOWN = 0, 1, 2
GOLDEN = 0.6 * np.array([[[1.0, 1.0], [0.0, 1.0]], [[1.0, 0.0], [1.0, 1.0]]])
LAGS = {"B": [[1.0]], "C": [[1.0]]}
A, B = [[1.0, 1.0], [0.0, 1.0]], [[0.5], [1.0]]
K, P = [[-0.5, -1.0]], [[1.5, 1.0], [1.0, 2.0]]
LIMITED = LimitedPlant(A, B, **box_limits([5, 5], [1]))
SQUARE = {"H": np.vstack([np.eye(2), -np.eye(2)]), "h": np.ones(4)}
HALF = LimitedPlant(
    [0.5 * np.eye(2), 0.7 * np.eye(2)], np.zeros((2, 2, 1)), **box_limits([2, 2], 1)
)
CUBIC = PolynomialPlant(["x"], ["-x + x^3"])
REVERSED = PolynomialPlant(["x", "y"], ["-y", "x + (x^2 - 1)*y"])
MADE = {
    "vertices": (VertexPlant(GOLDEN, dt=1.0), LyapunovClaim("stability", np.eye(2))),
    "a P of each vertex": (
        VertexPlant(0.8 * GOLDEN, dt=1.0),
        LyapunovClaim("decay rate", [np.eye(2), 1.1 * np.eye(2)], 0.05),
    ),
    "feedback": (
        VertexPlant([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]]),
        LyapunovClaim("decay rate", [[2.0, 1.0], [1.0, 2.0]], 0.1, K=[[-1.0, -1.0]]),
    ),
    "gain of vertices": (
        VertexPlant([[[-1.0]], [[-2.0]]], **LAGS), LyapunovClaim("l2 gain", [[1.0]], 1.01)
    ),
    "grid": (
        GridPlant([0, 1], [[[-1.0]], [[-2.0]]], **LAGS, rate=0.4),
        LyapunovClaim("l2 gain", [[[1.0]], [[1.5]]], 1.3, K=[[[-0.1]], [[-0.3]]]),
    ),
    "sampled grid": (
        GridPlant([0, 1, 3], [[[0.5]], [[0.9]], [[0.2]]], **LAGS, rate=5.0, dt=0.1),
        LyapunovClaim("l2 gain", [[[10.0]], [[11.0]], [[10.0]]], 16.0),
    ),
    "ellipsoid": (
        LIMITED,
        TerminalClaim(K=K, P=P, level=0.5, Q=0.1 * np.eye(2), R=[[0.1]]),
    ),
    "polytope": (HALF, TerminalClaim(K=[[0.0, 0.0]], **SQUARE)),
    "one state": (CUBIC, RegionClaim("x^2", 0.95)),
    "limit cycle": (REVERSED, RegionClaim("1.5*x^2 - x*y + y^2", 1.5)),
}  # fmt: skip


def content_of(name):
    verdict = check(*MADE[name], refute=False)
    assert verdict.proven, verdict
    return json.loads(json.dumps({"schema": "symheli statement", "version": 2,
                                  "statement": "claim", **verdict.statement.stored}))  # fmt: skip


@pytest.fixture(scope="module")
def contents():
    return {name: content_of(name) for name in MADE}


def checked(content, tmp_path, capsys):
    path = tmp_path / "claim.json"
    path.write_text(json.dumps(content))
    return report.main([str(path)]), capsys.readouterr().out


@pytest.mark.parametrize("name", MADE)
def test_what_the_package_proves_the_checker_proves(name, contents, tmp_path, capsys):
    status, said = checked(contents[name], tmp_path, capsys)
    assert (status, said.splitlines()[-1]) == (PROVEN, "proven in exact arithmetic")


STRONGER = {
    "vertices": ("plant", "A", lambda v: [2 * a for a in v]),
    "a P of each vertex": ("claim", "bound", 0.6),
    "feedback": ("claim", "bound", 0.6),
    "gain of vertices": ("claim", "bound", 0.99),
    "grid": ("plant", "rate", 4.0),
    "sampled grid": ("claim", "bound", 9.0),
    "ellipsoid": ("claim", "level", 5.0),
    "polytope": ("claim", "h", lambda v: [1.0, 1.0, 1.0, 3.0]),
    "one state": ("claim", "rho", "101/100"),
    "limit cycle": ("claim", "rho", "5"),
}


@pytest.mark.parametrize("name", MADE)
def test_a_stronger_claim_is_refused_by_both(name, contents, tmp_path, capsys):
    content = json.loads(json.dumps(contents[name]))
    part, key, new = STRONGER[name]
    if callable(new):
        content[part][key]["array"] = new(content[part][key]["array"])
    else:
        content[part][key] = new
    assert checked(content, tmp_path, capsys)[0] == NOT_PROVEN
    assert not ProvenClaim.restored(content).verified


def test_a_p_that_is_not_positive_and_a_jump_of_p_are_refused(contents, tmp_path, capsys):
    content = json.loads(json.dumps(contents["gain of vertices"]))
    content["claim"]["P"]["array"] = [-1.0]
    assert checked(content, tmp_path, capsys)[0] == NOT_PROVEN
    content = json.loads(json.dumps(contents["grid"]))
    content["plant"]["rate"] = {"float": "inf"}
    assert checked(content, tmp_path, capsys)[0] == NOT_PROVEN


def test_multipliers_and_boxes_are_checked_not_believed(contents, tmp_path, capsys):
    content = json.loads(json.dumps(contents["polytope"]))
    # row 5: x1 after a step is x1/2, which is H'y of the third with y below zero too
    assert content["multipliers"][6][0] == "1/2"
    for k, forged in (
        (0, ["-1", "0", "0", "0"]),
        (0, ["0", "0", "0", "0"]),
        (6, ["-1/10", "0", "-6/10", "0"]),
    ):
        content = json.loads(json.dumps(contents["polytope"]))
        content["multipliers"][k] = forged
        assert checked(content, tmp_path, capsys)[0] == NOT_PROVEN
    content["multipliers"].pop()
    assert checked(content, tmp_path, capsys)[0] == UNKNOWN
    content = json.loads(json.dumps(contents["limit cycle"]))
    content["box"] = ["1/4", "1/4"]
    assert checked(content, tmp_path, capsys)[0] == NOT_PROVEN
    content["box"] = ["0", "1"]
    assert checked(content, tmp_path, capsys)[0] == UNKNOWN


def test_no_models_at_all_prove_nothing(contents, tmp_path, capsys):
    content = json.loads(json.dumps(contents["vertices"]))
    for name in "ABCD":
        content["plant"][name] = {"shape": [0, *content["plant"][name]["shape"][1:]], "array": []}
    assert checked(content, tmp_path, capsys)[0] == UNKNOWN


def numbers(value, path=()):
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items:
        if isinstance(item, dict | list):
            yield from numbers(item, (*path, key))
        elif isinstance(item, int | float) and not isinstance(item, bool):
            yield (*path, key)


def exchanged(content, path, change):
    own = other = json.loads(json.dumps(content))
    for key in path[:-1]:
        own = own[key]
    own[path[-1]] = change(own[path[-1]])
    return other


@pytest.mark.parametrize("name", MADE)
def test_a_changed_number_is_believed_only_where_the_package_believes_it(
    name, contents, tmp_path, capsys
):
    rng = random.Random(name)
    places = [p for p in numbers(contents[name]) if p[0] in ("plant", "claim")]
    for _ in range(4):
        factor = rng.choice([0.0, -1.0, 0.5, 0.999, 1.02, 2.0])
        content = exchanged(contents[name], rng.choice(places), lambda v, f=factor: type(v)(f * v))
        status, said = checked(content, tmp_path, capsys)
        if status == PROVEN:
            assert ProvenClaim.restored(content).verified, said


JUNK = (None, "P", -1, 1e300, 10**400, [], {}, True, {"float": "nan"}, "1/0", "9" * 20_000)


def everywhere(value, path=()):
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items:
        yield (*path, key)
        if isinstance(item, dict | list):
            yield from everywhere(item, (*path, key))


@pytest.mark.parametrize("name", MADE)
def test_a_damaged_file_is_told_in_a_sentence(name, contents, tmp_path, capsys):
    rng = random.Random(name)
    places = [p for p in everywhere(contents[name]) if p[0] != "statement"]
    for _ in range(12):
        junk = rng.choice(JUNK)
        content = exchanged(contents[name], rng.choice(places), lambda _, junk=junk: junk)
        status, said = checked(content, tmp_path, capsys)
        assert status in (PROVEN, NOT_PROVEN, UNKNOWN)
        assert said.splitlines()[-1].startswith(("proven", "not proven: ", "not checked: "))
        (tmp_path / "own.json").write_text(json.dumps(content))
        try:
            found = ProvenClaim.load(tmp_path / "own.json")
        except SymheliError:
            continue
        assert found.verified or found.why


def test_semidefinite_is_what_no_direction_contradicts():
    rng = np.random.default_rng(0)
    for n in (1, 2, 3, 5):
        for _ in range(30):
            L = rng.integers(-3, 4, (n, max(n - 1, 1)))
            M = (L @ L.T - int(rng.integers(0, 2)) * np.diag(rng.integers(0, 2, n))).tolist()
            found = not_positive(np.array([[Fraction(v) for v in row] for row in M]))
            assert nonnegative(M) == (found is None or found[0] == 0)
            assert nonnegative(M) == bool(np.linalg.eigvalsh(np.array(M, float))[0] > -1e-9)
