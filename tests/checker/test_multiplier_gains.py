"""The checker and gains by multipliers: what it proves, refuses, and that a lie is told."""

import copy
import json
import random

import numpy as np
import pytest

from symheli import LinearModel
from synthesis.checker import multipliers, report, signals
from synthesis.checker.demands import failure
from synthesis.checker.reading import DAMAGED, Unreadable
from synthesis.robust import (
    DelayBlock,
    DynamicBlock,
    OwnMultiplier,
    ParameterBlock,
    StaticBlock,
    multiplier_gain,
)

pytestmark = pytest.mark.guard

PROVEN, NOT_PROVEN, UNKNOWN = 0, 1, 2


def own():
    psi = LinearModel(
        [[-2.0]], [[1.0, 0.0]], [[0.1], [0.0]], [[0.5, 0.0], [0.0, 1.0]], ["s"], ["v", "d"], "ab"
    )
    return OwnMultiplier("d", "v", psi, [np.diag([1.0, -1.0])])


BLOCKS = {
    "static": lambda: StaticBlock("d", "v", slope=(-0.3, 0.4), odd=True),
    "sector": lambda: StaticBlock("d", "v", sector=(-0.3, 0.4), constant=False),
    "repeated": lambda: StaticBlock(["d", "e"], ["v", "z"], slope=(0.0, 0.3)),
    "parameter": lambda: ParameterBlock("d", "v", -0.3, 0.4),
    "copies": lambda: ParameterBlock(["d", "e"], ["v", "z"], -0.3, 0.2, np.inf),
    "dynamics": lambda: DynamicBlock(["d"], ["v", "z"], 0.3),
    "delay": lambda: DelayBlock("d", "v", 0.3),
    "window": lambda: DelayBlock("d", "v", 0.3, "window"),
    "own": own,
    "sampled": lambda: StaticBlock("d", "v", slope=(0.0, 0.3), odd=True),
}


def loop(block, dt=None):
    A = np.array([[-1.0, -1.0, 0.2], [1.0, -0.5, 0.0], [0.0, 0.3, -2.0]])
    A = A if dt is None else np.eye(3) + dt * A
    B = np.array([[1.0, 0.2, 1.0], [0.0, 1.0, 0.3], [0.5, 0.0, 0.0]]) * (dt or 1.0)
    C = np.array([[1.0, 0.0, 0.5], [0.0, 0.6, 0.0], [0.5, 0.5, 0.0]])
    names = ["d", "e", "f"], ["v", "z", "y"]
    model = LinearModel(A, B, C, np.zeros((3, 3)), ["a", "b", "c"], *names, dt)
    into = ["f"] if "e" in block.inputs else ["e", "f"]
    return multiplier_gain(model, block, into, ["y"], poles=[1.5])


@pytest.fixture(scope="module")
def contents():
    made = {}
    for name, block in BLOCKS.items():
        found = loop(block(), 0.2 if name == "sampled" else None)
        assert found.verified, name
        made[name] = json.loads(json.dumps(found.stored))
    return made


@pytest.mark.parametrize("name", BLOCKS)
def test_a_gain_is_proven_and_a_smaller_one_refused(name, contents):
    content = contents[name]
    assert failure(multipliers.claimed(content)) == ""
    smaller = {**content, "gain": 0.99 * content["gain"]}
    assert "the inequality of the gain" in failure(multipliers.claimed(smaller))


STRONGER = {
    "static": ("high", 1.3),
    "sector": ("low", 1.5),
    "repeated": ("high", 1.5),
    "parameter": ("low", 1.3),
    "copies": ("high", 1.5),
    "dynamics": ("bound", 1.2),
    "window": ("longest", 2.0),
    "sampled": ("high", 1.5),
}


@pytest.mark.parametrize("name", STRONGER)
def test_a_larger_block_is_refused(name, contents):
    content = copy.deepcopy(contents[name])
    field, factor = STRONGER[name]
    content["blocks"][0][field] *= factor
    assert failure(multipliers.claimed(content))


def not_below_zero(content):
    """The coefficients of a static function or of one's own forms: one is made negative."""
    values = content["blocks"][0]["coefficients"]["array"]
    k = int(np.argmax(values[:-1] if len(values) > 1 else values))
    values[k] = -values[k] or -1.0
    return content


@pytest.mark.parametrize("name", ["static", "repeated", "own", "sampled"])
def test_a_multiplier_that_is_none_of_its_class_is_refused(name, contents):
    assert failure(multipliers.claimed(not_below_zero(copy.deepcopy(contents[name]))))


def test_a_diagonal_that_does_not_dominate_is_refused(contents):
    content = copy.deepcopy(contents["repeated"])
    values = content["blocks"][0]["coefficients"]["array"]
    values[2] += 10 * max(map(abs, values))  # one entry beside the diagonal alone
    assert "below zero" in failure(multipliers.claimed(content))


def test_even_functions_have_no_kernels_of_both_signs(contents):
    content = copy.deepcopy(contents["static"])
    content["blocks"][0]["odd"] = False
    with pytest.raises(Unreadable, match="too many"):
        multipliers.claimed(content)


def test_a_loop_that_is_not_stable_is_refused_whatever_the_inequality(contents):
    content = copy.deepcopy(contents["sector"])
    n = content["A"]["shape"][0]
    for k in range(n):
        content["A"]["array"][k * (n + 1)] *= -1.0
    assert failure(multipliers.claimed(content)) == "the nominal loop is not stable"


def test_a_path_at_the_same_instant_is_refused(contents):
    content = copy.deepcopy(contents["delay"])
    content["D"]["array"][0] = 0.1
    assert "same instant" in failure(multipliers.claimed(content))


@pytest.mark.parametrize("name", BLOCKS)
def test_the_command_says_the_block_and_decides(name, contents, tmp_path, capsys):
    path = tmp_path / "gain.json"
    head = {"schema": "symheli statement", "version": 2, "statement": "multiplier-gain"}
    path.write_text(json.dumps({**head, **contents[name]}))
    assert report.main([str(path)]) == PROVEN
    said = capsys.readouterr().out
    assert repr(contents[name]["gain"]) in said
    assert "inputs 1" in said


def places(value, path=()):
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items:
        if isinstance(item, dict | list):
            yield from places(item, (*path, key))
        elif key != "dt":
            yield (*path, key)


def changed(content, rng, value):
    other = copy.deepcopy(content)
    *path, last = rng.choice(list(places(other)))
    own = other
    for key in path:
        own = own[key]
    own[last] = value(own[last])
    return other, (*path, last)


@pytest.mark.parametrize("name", BLOCKS)
def test_the_package_and_the_checker_decide_alike_about_changed_numbers(name, contents):
    """Two writings of one definition: one proven and the other not would be an error of one."""
    from synthesis.robust.multipliers.proof import GainProof

    rng = random.Random(name)
    for _ in range(12):
        factor = rng.choice([0.0, -1.0, 0.9, 0.999, 1.001, 1.1])
        other, place = changed(
            contents[name],
            rng,
            lambda v, f=factor: f * v if isinstance(v, float) else v,
        )
        try:
            checked = failure(multipliers.claimed(other)) == ""
        except (Unreadable, *DAMAGED):
            checked = False
        try:
            own = GainProof.restored(other).fault() == ""
        except Exception:
            own = False
        assert checked == own, (place, factor)


@pytest.mark.parametrize("name", BLOCKS)
@pytest.mark.parametrize("junk", [None, "P", -1, 1e300, [], {}, True])
def test_a_damaged_file_is_told_in_a_sentence(name, junk, contents, tmp_path, capsys):
    rng, path = random.Random(f"{name}{junk}"), tmp_path / "damaged.json"
    for _ in range(3):
        other, _ = changed(contents[name], rng, lambda _: junk)
        head = {"schema": "symheli statement", "version": 2}
        path.write_text(json.dumps({**head, **other}))
        status = report.main([str(path)])
        said = capsys.readouterr().out
        assert status in (PROVEN, NOT_PROVEN, UNKNOWN)
        assert said.splitlines()[-1].startswith(("proven", "not proven: ", "not checked: "))


@pytest.mark.parametrize("sampled", [False, True])
def test_stability_is_that_of_the_eigenvalues(sampled):
    rng = np.random.default_rng(0)
    for _ in range(60):
        A = np.round(rng.normal(size=(4, 4)) - (0 if sampled else 1.5 * np.eye(4)), 2)
        A = 0.6 * A if sampled else A
        values = np.linalg.eigvals(A)
        known = np.abs(values).max() < 1 if sampled else values.real.max() < 0
        rows = [[signals.Fraction(v) for v in row] for row in A.tolist()]
        assert signals.stable(rows, sampled) == known
