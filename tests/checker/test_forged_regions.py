"""Forged files of regions of attraction and of terminal sets, which package and checker refuse."""

import json
import math

import numpy as np
import pytest
import sympy

from symheli.errors import InputError
from synthesis.checker import report
from synthesis.regions import RegionOfAttraction, TerminalSet, region_of_attraction, terminal
from synthesis.regions.equations import equations, function_of
from synthesis.regions.proof import Gram, RegionProof

pytestmark = pytest.mark.guard

PROVEN = 0
HEAD = {"schema": "symheli statement", "version": 2, "statement": "region-of-attraction"}
x, y = sympy.symbols("x y")
VAN_DER_POL = {x: -y, y: x - (1 - x**2) * y}


def changed(content, path, value):
    own = json.loads(json.dumps(content))
    *place, last = path
    at = own
    for step in place:
        at = at[step]
    at[last] = value(at[last])
    return own


FORGED = {
    "a higher level": (("level",), lambda v: 1.0001 * v),
    "all levels": (("level",), lambda v: {"float": "inf"}),
    "no level": (("level",), lambda v: -v),
    "another V": (("V", 0, 1), lambda v: "-" + v),
    "another f": (("f", 0, 0, 1), lambda v: v.strip("-")),
    "a negative multiplier": (("sum_s", "Q", "array", 0), lambda v: -v),
    "a negative sigma": (("sum_sigma", "Q", "array", 0), lambda v: -v),
    "flat coordinates": (("T", "array"), lambda v: [0.0] * len(v)),
    "no monomials": (
        ("sum_rest",),
        lambda v: {"monomials": [], "Q": {"shape": [0, 0], "array": []}},
    ),
    "a constant": (("sum_rest", "monomials", 0), lambda v: [0] * len(v)),
    "one twice": (("sum_rest", "monomials", 0), lambda v: [1, 1]),
    "a direction left out": (("sum_V", "monomials", 0), lambda v: [1, 1]),
}


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    found = region_of_attraction(VAN_DER_POL)
    return found.save(tmp_path_factory.mktemp("region") / "region.json")


def proven_by_the_package(file):
    try:
        return RegionOfAttraction.load(file).verified
    except InputError:
        return False


def test_the_file_as_it_is_is_proven(file, capsys):
    assert proven_by_the_package(file)
    assert report.main([str(file)]) == PROVEN
    assert "every start with V(x) <= 2.304" in capsys.readouterr().out


@pytest.mark.parametrize("forged", FORGED)
def test_a_forged_file_is_refused_by_package_and_checker(forged, file, tmp_path, capsys):
    own = changed(json.loads(file.read_text()), *FORGED[forged])
    (tmp_path / "forged.json").write_text(json.dumps(own))
    assert not proven_by_the_package(tmp_path / "forged.json")
    assert report.main([str(tmp_path / "forged.json")]) != PROVEN
    said = capsys.readouterr().out
    assert "not proven" in said or "not checked" in said


def forged_proof(f, V, sigma, s, rest, level):
    """A region about x and y whose sums of squares have these Q over these monomials."""
    own = [function_of(each, equations({x: -x, y: -y})) for each in (*f, V)]
    squares = [
        Gram(tuple(basis), np.diag(np.array(Q, dtype=float))) for basis, Q in (sigma, s, rest)
    ]
    both = Gram(((1, 0), (0, 1)), np.eye(2)) if V.has(y) else Gram(((1, 0),), np.eye(1))
    proof = RegionProof(np.eye(2), both, *squares)
    return RegionOfAttraction(("x", "y"), tuple(own[:2]), own[2], level, None, proof, True)


ONE, BOTH, NONE = [(0, 0)], [(1, 0), (0, 1)], ([], [])
FALSE = {
    # V = x^2 says nothing of y, which grows
    "a direction left out": ((-x, y), x**2, (ONE, [1]), NONE, ([(1, 0)], [2]), math.inf),
    # dV/dt = 2 |x|^2 times -1 is negative
    "a negative sigma": ((x, y), x**2 + y**2, (ONE, [-1]), NONE, (BOTH, [2, 2]), math.inf),
    # -dV/dt + x^2 (4 - V) is positive, but 0 is unstable
    "a negative multiplier": (
        (x - x**3, -4 * y - 2 * x**2 * y),
        x**2 + y**2,
        (ONE, [1]),
        ([(1, 0)], [-1]),
        ([(1, 0), (0, 1), (2, 0), (1, 1)], [2, 8, 1, 3]),
        4.0,
    ),
}


@pytest.mark.parametrize("false", FALSE)
def test_sums_of_squares_that_prove_nothing_are_refused(false, tmp_path):
    """Their identities hold: what fails is what they would have to mean."""
    found = forged_proof(*FALSE[false])
    assert not found.verify()
    (tmp_path / "false.json").write_text(json.dumps(HEAD | found.stored))
    assert not proven_by_the_package(tmp_path / "false.json")
    assert report.main([str(tmp_path / "false.json")]) == 1


OF_A_TERMINAL_SET = {
    "a higher level": (("alpha",), lambda v: 1.0001 * v),
    "no level": (("alpha",), lambda v: -v),
    "a narrower limit": (("bounds", 0, 1), lambda v: 0.9999 * v),
    "a limit of nothing": (("bounds", 0, 0), lambda v: "w"),
    "a larger cost of states": (("Q", "array"), lambda v: [1.5 * each for each in v]),
    "a larger cost of controls": (("R", "array", 0), lambda v: 1.5 * v),
    "another feedback": (("K", "array", 0), lambda v: -v),
    "a smaller terminal cost": (("P", "array"), lambda v: [0.9 * each for each in v]),
    "samples": (("dt",), lambda v: 0.1),
    "another f": (("f", 0, 0, 1), lambda v: v.strip("-") if "-" in v else "-" + v),
    "a name twice": (("states", 0), lambda v: "y"),
}


@pytest.fixture(scope="module")
def terminal_file(tmp_path_factory):
    u = sympy.Symbol("u")
    f = {x: y, y: u - x**3}
    found = terminal(
        f, [[1.0, 0.0], [0.0, 1.0]], [[1.0]], controls=[u], input_bounds={"u": 0.5}, share=0.3
    )
    return found.save(tmp_path_factory.mktemp("terminal") / "terminal.json")


def test_the_terminal_set_as_it_is_is_proven(terminal_file, capsys):
    assert TerminalSet.load(terminal_file).verified
    assert report.main([str(terminal_file)]) == PROVEN
    assert "|u| <= 0.5" in capsys.readouterr().out


@pytest.mark.parametrize("forged", OF_A_TERMINAL_SET)
def test_a_forged_terminal_set_is_refused(forged, terminal_file, tmp_path, capsys):
    own = changed(json.loads(terminal_file.read_text()), *OF_A_TERMINAL_SET[forged])
    (tmp_path / "forged.json").write_text(json.dumps(own))
    try:
        assert not TerminalSet.load(tmp_path / "forged.json").verified
    except InputError:
        pass
    assert report.main([str(tmp_path / "forged.json")]) != PROVEN
    capsys.readouterr()


def test_a_cost_below_zero_does_not_let_a_set_be_left(tmp_path, capsys):
    """x' = 1.5 x leaves every set, but of V = x^2 with Q = -10 dV/dt - 10 x^2 = -7 x^2."""
    one = {"shape": [1, 1], "array": [1.0]}
    content = {
        "schema": "symheli statement", "version": 2, "statement": "terminal-set",
        "kind": "terminal set", "states": ["x"], "controls": ["u"],
        "f": [[[[1, 0], "3/2"], [[0, 1], "1"]]], "dt": None, "bounds": [["u", 1.0]],
        "Q": {"shape": [1, 1], "array": [-10.0]}, "R": one, "P": one, "alpha": 1.0,
        "K": {"shape": [1, 1], "array": [0.0]}, "T": one,
        "sum_V": {"monomials": [[1]], "Q": one}, "sum_sigma": {"monomials": [[0]], "Q": one},
        "sum_s": {"monomials": [[1]], "Q": one},
        "sum_rest": {"monomials": [[1], [2]], "Q": {"shape": [2, 2], "array": [6.0, 0, 0, 1.0]}},
    }  # fmt: skip
    (tmp_path / "forged.json").write_text(json.dumps(content))
    found = TerminalSet.load(tmp_path / "forged.json")
    assert not found.verified
    assert "multiple of the identity to Q" in found.why
    assert report.main([str(tmp_path / "forged.json")]) != PROVEN
    assert "cost below zero" in capsys.readouterr().out
