"""Files of worst-case gains in the checker that stands alone: what it proves and refuses."""

import copy
import json
import random

import numpy as np
import pytest

from symheli import LFT, LinearModel, Scheduling
from symheli.errors import SymheliError
from symheli.lpv import connect
from synthesis.certify.statement.statement_file import read
from synthesis.checker import report
from synthesis.checker.levels import Loop
from synthesis.robust import DynamicBlock, worst_case_gain

pytestmark = pytest.mark.guard
PROVEN, NOT_PROVEN, UNKNOWN = 0, 1, 2


def two_parameters(dt=None):
    """One state, two parameters of which scalings alone leave ten percent."""
    model = LinearModel(
        [[-2.0 if dt is None else 0.3]],
        [[0.9, 0.7, -0.3]],
        [[0.2], [0.5], [0.7]],
        [[0.5, -0.4, 0.4], [-0.4, 0.0, -0.4], [0.2, 0.4, 0.2]],
        ["x"],
        ["p1", "p2", "w"],
        ["q1", "q2", "z"],
        dt,
    )
    deltas = [
        LFT.parameter(Scheduling(f"d{k}", "1", -0.4, 0.9), f"q{k}", f"p{k}", dt) for k in (1, 2)
    ]
    return connect(model, *deltas, inputs=["w"], outputs=["z"])


def two_blocks():
    return LFT.constant(
        LinearModel(
            [[-2.0, 0.3], [0.0, -1.0]],
            [[1, 0.2, 0.5], [0.3, 1, 0]],
            [[0.3, 0], [0.1, 0.5], [1, 1.0]],
            [[0, 0.1, 0], [0.2, 0, 0.1], [0, 0, 0.1]],
            ["a", "b"],
            ["d1", "d2", "w"],
            ["v1", "v2", "z"],
        )
    )


def repeated():
    """x' = -k x + w, z = k^2 x, k in [1, 3]."""
    k = Scheduling("k", "1", 1.0, 3.0)
    return LFT.from_expressions(
        [[-k.symbol]], [[1]], [[k.symbol**2]], [[0]], [k], inputs=["w"], outputs=["z"]
    )


MADE = {
    "cells": lambda: worst_case_gain(two_parameters(), cells=8),
    "one cell": lambda: worst_case_gain(two_parameters()),
    "sampled": lambda: worst_case_gain(two_parameters(0.5), cells=8),
    "repeated": lambda: worst_case_gain(repeated()),
    "blocks": lambda: worst_case_gain(
        two_blocks(), [DynamicBlock("d1", "v1", 0.7), DynamicBlock("d2", "v2", 0.5)]
    ),
    "a block of two channels": lambda: worst_case_gain(
        two_blocks(), [DynamicBlock(["d1", "d2"], ["v1", "v2"], 0.7)]
    ),
}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("levels")
    return {
        name: made().save(folder / f"{name.replace(' ', '-')}.json") for name, made in MADE.items()
    }


@pytest.mark.parametrize("name", MADE)
def test_a_saved_gain_is_proven(files, name, capsys):
    assert report.main([str(files[name])]) == PROVEN
    assert capsys.readouterr().out.splitlines()[-1] == "proven in exact arithmetic"


def test_copies_that_the_proof_does_not_have_are_told_and_the_advice_works(tmp_path, capsys):
    """The second copy is not driven."""
    model = LinearModel(
        [[-1.0, 0.2], [0.1, -2.0]],
        [[1.0, 0.0, 1.0], [0.5, 0.0, 0.3]],
        [[0.3, 0.1], [0.2, 0.4], [1.0, 1.0]],
        np.zeros((3, 3)),
        ["a", "b"],
        ["p1", "p2", "w"],
        ["q1", "q2", "z"],
    )
    k = Scheduling("k", "1", -0.2, 0.3)
    copies = [LFT.parameter(k, f"q{i}", f"p{i}") for i in (1, 2)]
    loop = connect(model, *copies, inputs=["w"], outputs=["z"])
    path = tmp_path / "gain.json"
    assert report.main([str(worst_case_gain(loop).save(path))]) == UNKNOWN
    assert "save the gain of model.reduce()" in capsys.readouterr().out
    path = tmp_path / "reduced.json"
    assert report.main([str(worst_case_gain(loop.reduce()).save(path))]) == PROVEN


def test_a_loop_that_is_not_well_posed_at_infinity_is_refused(files, tmp_path):
    """z = s/(s + 1) w of a parameter and of the performance: the inequality is 1 > 0 times 1 + v^2
    at every frequency v, and zero at infinity, where the parameter at 1 closes an algebraic loop.
    """
    content = json.loads(files["repeated"].read_text(encoding="utf-8"))
    lft, eye, zero = content["model"], array([[1.0, 0.0], [0.0, 1.0]]), array(np.zeros((2, 2)))
    lft["blocks"] = [
        {**lft["blocks"][0], "size": 1, "scheduling": {**lft["blocks"][0]["scheduling"]}}
    ]
    lft["blocks"][0]["scheduling"] |= {"low": -1.0, "high": 1.0}
    lft["states"] = [{"signal": name, "unit": "1"} for name in "ab"]
    lft |= {
        "M11": array([[1.0]]),
        "M12": array([[-1.0, 0.0, 0.0]]),
        "M21": array([[1.0], [0.0], [0.0]]),
        "M22": array([[-1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, -1.0, 1.0]]),
    }
    content |= {
        "bound": 1.0,
        "level": 1.0,
        "copies": array([1.0]),
        "rows": array([1.0, 1.0]),
        "columns": array([1.0, 1.0]),
        "parts": [[0, 1, 0, 1, True], [1, 2, 1, 2, False]],
        "intervals": [[0.0, {"float": "inf"}, [eye, zero], [eye, zero], [zero, zero]]],
    }
    assert status_of(content, tmp_path / "forged.json") == NOT_PROVEN
    content["intervals"][0][1] = 1e6
    high = [1e6, {"float": "inf"}, *content["intervals"][0][2:]]
    content["intervals"].append(high)
    assert status_of(content, tmp_path / "forged.json") == NOT_PROVEN


def array(values):
    own = np.asarray(values, float)
    return {"shape": list(own.shape), "array": own.ravel().tolist()}


def status_of(content, path):
    path.write_text(json.dumps(content), encoding="utf-8")
    return report.main([str(path)])


def forgeries(content):
    """Changes after which nothing is proven, by what was changed."""

    def changed(*path, by):
        own = copy.deepcopy(content)
        at = own
        for key in path[:-1]:
            at = at[key]
        at[path[-1]] = by(at[path[-1]])
        return own

    def first(values, by):
        return {**values, "array": [by(values["array"][0]), *values["array"][1:]]}

    yield "a lower bound", changed("bound", by=lambda v: 0.999 * v)
    yield "a cell less", changed("cells", by=lambda v: v[1:])
    yield "a cell twice", changed("cells", by=lambda v: [*v, v[0]])
    yield "a cell beyond", changed("cells", 0, "low", by=lambda v: [v[0] - 1, *v[1:]])
    yield "a smaller cell", changed("cells", 0, "low", by=lambda v: [v[0] + 0.1, *v[1:]])
    yield "an interval less", changed("cells", 0, "intervals", by=lambda v: v[1:])
    yield "no interval", changed("cells", 0, "intervals", by=lambda v: [])
    yield (
        "all intervals of the other cell",
        changed("cells", 0, "intervals", by=lambda v: content["cells"][1]["intervals"]),
    )
    yield "another loop", changed("model", "M22", by=lambda v: first(v, lambda a: -a))
    yield (
        "units of a parameter",
        changed("cells", 0, "rows", by=lambda v: first(v, lambda a: a / 2)),
    )
    yield (
        "negative D",
        changed("cells", 0, "intervals", 0, 2, 0, by=lambda v: first(v, lambda a: -a)),
    )
    yield "a full D", changed("cells", 0, "intervals", 0, 2, 0, by=lambda v: {
        **v, "array": [v["array"][0], 0.1, *v["array"][2:]]
    })  # fmt: skip
    yield (
        "D of one side",
        changed("cells", 0, "intervals", 0, 3, 0, by=lambda v: first(v, lambda a: 2 * a)),
    )
    yield (
        "a real part said to be a block",
        changed("cells", 0, "parts", by=lambda v: [[*v[0][:4], False], *v[1:]]),
    )
    yield "no performance", changed("cells", 0, "performance", by=lambda v: False)


def test_forged_files_are_refused(files, tmp_path):
    content = json.loads(files["cells"].read_text())
    assert len(content["cells"]) > 1
    believed = [
        name for name, own in forgeries(content) if status_of(own, tmp_path / "f.json") == PROVEN
    ]
    # scalings of another cell may happen to hold; the package then says so too
    for name in believed:
        path = tmp_path / "again.json"
        path.write_text(json.dumps(dict(forgeries(content))[name]))
        assert name == "all intervals of the other cell"
        assert read(path).verified


def numbers(value, path=()):
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items:
        if isinstance(item, dict | list):
            yield from numbers(item, (*path, key))
        elif isinstance(item, float) and key != "dt":
            yield (*path, key)


@pytest.mark.parametrize("count", [12, pytest.param(120, marks=pytest.mark.slow)])
def test_it_believes_no_changed_number_that_the_package_does_not(files, count, tmp_path):
    content, rng = json.loads(files["blocks"].read_text()), random.Random(count)
    places = [p for p in numbers(content) if "copies" not in p]
    path = tmp_path / "changed.json"
    for place in rng.sample(places, min(count, len(places))):
        own = copy.deepcopy(content)
        at = own
        for key in place[:-1]:
            at = at[key]
        at[place[-1]] = at[place[-1]] * rng.choice([0.5, -1.0, 1.3]) + rng.choice([0.0, 0.2])
        if status_of(own, path) == PROVEN:
            try:
                assert read(path).verified, place
            except SymheliError as error:  # pragma: no cover - a place that only the package reads
                raise AssertionError(place) from error


def test_stability_is_decided_as_by_eigenvalues():
    """Routh's array of random loops, continuous and sampled, against numpy."""
    from fractions import Fraction

    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(60):
        n, sampled = int(rng.integers(1, 5)), bool(rng.integers(2))
        A = rng.standard_normal((n, n)) * (0.7 if sampled else 1.0) - (
            0 if sampled else 1
        ) * np.eye(n)
        rows = [[Fraction(v) for v in row] for row in A.tolist()]
        one = [[Fraction(1)] for _ in range(n)]
        loop = Loop(rows, one, [[Fraction(1)] * n], [[Fraction(0)]], (), [(1, 1)], sampled)
        poles = np.linalg.eigvals(A)
        stable = bool(np.all(np.abs(poles) < 1) if sampled else np.all(poles.real < 0))
        assert loop.stable == stable
        seen.add((sampled, stable))
    assert len(seen) == 4


def test_a_weight_is_not_known_and_it_is_said(tmp_path, capsys):
    lag = LinearModel([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ["a"], ["i"], ["o"])
    found = worst_case_gain(two_blocks(), [DynamicBlock("d1", "v1", 0.1, lag)])
    assert report.main([str(found.save(tmp_path / "w.json"))]) == UNKNOWN
    assert "weight" in capsys.readouterr().out
