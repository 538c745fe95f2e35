"""The checker and gains by multipliers: what it proves, refuses, and that a lie is told."""

import copy
import json
import random
from functools import cache

import numpy as np
import pytest

from symheli import LinearModel
from symheli.errors import SymheliError
from synthesis.checker import multipliers, peaks, report, signals
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
from synthesis.robust.multipliers.gain import MultiplierGain

pytestmark = pytest.mark.guard

PROVEN, NOT_PROVEN, UNKNOWN = 0, 1, 2


ENERGY, PEAK = "energy to peak", "peak to peak"


def own(dt=None):
    """|d|_2 below .5 times |v|_2 and a lag of it."""
    A, C, D = -2.0 if dt is None else 0.6, [[0.1], [0.0]], [[0.5, 0.0], [0.0, 1.0]]
    psi = LinearModel([[A]], [[1.0, 0.0]], C, D, ["s"], ["v", "d"], "ab", dt)
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
PEAKS = {
    "peak, box": (lambda: [ParameterBlock(*c, -0.3, 0.2, np.inf) for c in ("dv", "ez")], PEAK, 0.2),
    "peak, sector": (lambda: [StaticBlock("d", "v", sector=(-0.1, 0.3))], PEAK, None),
    "energy, box": (lambda: [ParameterBlock("d", "v", -0.3, 0.2, np.inf)], ENERGY, None),
    "energy, own": (lambda: [own(0.2)], ENERGY, 0.2),
    "energy, dynamics": (lambda: [DynamicBlock(["d"], ["v"], 0.3)], ENERGY, 0.2),
}


def peak(blocks, kind, dt):
    A, C = np.array([[-1.0, -1.0], [1.0, -0.5]]), np.array([[1.0, 0.0], [0.0, 0.6], [0.5, 0.5]])
    A = A if dt is None else np.eye(2) + dt * A
    B = np.array([[1.0, 0.2, 1.0], [0.0, 1.0, 0.3]]) * (dt or 1.0)
    names = ["d", "e", "f"], ["v", "z", "y"]
    model = LinearModel(A, B, C, np.zeros((3, 3)), ["a", "b"], *names, dt)
    into = ["f"] if len(blocks) > 1 else ["e", "f"]
    decay = 0.1 if kind == PEAK else None
    return multiplier_gain(model, blocks, into, ["y"], kind=kind, decay=decay)


def loop(block, dt=None):
    A = np.array([[-1.0, -1.0, 0.2], [1.0, -0.5, 0.0], [0.0, 0.3, -2.0]])
    A = A if dt is None else np.eye(3) + dt * A
    B = np.array([[1.0, 0.2, 1.0], [0.0, 1.0, 0.3], [0.5, 0.0, 0.0]]) * (dt or 1.0)
    C = np.array([[1.0, 0.0, 0.5], [0.0, 0.6, 0.0], [0.5, 0.5, 0.0]])
    names = ["d", "e", "f"], ["v", "z", "y"]
    model = LinearModel(A, B, C, np.zeros((3, 3)), ["a", "b", "c"], *names, dt)
    into = ["f"] if "e" in block.inputs else ["e", "f"]
    return multiplier_gain(model, block, into, ["y"], poles=[1.5])


@cache
def stored(name):
    if name in PEAKS:
        blocks, kind, dt = PEAKS[name]
        found = peak(blocks(), kind, dt)
    else:
        found = loop(BLOCKS[name](), 0.2 if name == "sampled" else None)
    assert found.verified, name
    return json.dumps(found.stored)


class Contents:
    """The files of all gains, made when one is first asked for."""

    def __getitem__(self, name):
        return json.loads(stored(name))


@pytest.fixture
def contents():
    return Contents()


def claimed(content):
    return (peaks if "measure" in content else multipliers).claimed(content)


LATER = {
    "sector",
    "copies",
    "parameter",
    "dynamics",
    "window",
    "delay",
    "peak, sector",
    "energy, box",
}
"""Made in the slow set alone."""


def names(given):
    return [pytest.param(n, marks=pytest.mark.slow) if n in LATER else n for n in given]


EVERY = [*BLOCKS, *PEAKS]


@pytest.mark.parametrize("name", names(BLOCKS))
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


@pytest.mark.parametrize("name", names(PEAKS))
def test_a_gain_to_a_peak_is_proven_and_smaller_ones_refused(name, contents):
    content = contents[name]
    assert failure(claimed(content)) == ""
    content["gain"] *= 0.99
    assert "do not give this gain" in failure(claimed(content))
    content["shares"] = [0.98 * v for v in content["shares"]]
    assert "the inequality of" in failure(claimed(content))


def test_a_gain_of_energies_is_none_of_peaks(contents):
    content = {**contents["peak, box"], "measure": ENERGY}
    assert "do not give this gain" in failure(claimed(content))
    content = {**contents["energy, dynamics"], "measure": PEAK, "decay": 0.1}
    assert "says nothing of an instant" in failure(claimed(content))


def test_multipliers_at_the_peak_are_no_larger_than_those_before(contents):
    content = contents["energy, own"]
    content["at_peak"][0]["array"] = [2 * v for v in content["blocks"][0]["coefficients"]["array"]]
    assert "below zero" in failure(claimed(content))


@pytest.mark.parametrize("name", names(STRONGER))
def test_a_larger_block_is_refused(name, contents):
    content = contents[name]
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
    assert failure(multipliers.claimed(not_below_zero(contents[name])))


def test_a_diagonal_that_does_not_dominate_is_refused(contents):
    content = contents["repeated"]
    values = content["blocks"][0]["coefficients"]["array"]
    values[2] += 10 * max(map(abs, values))  # one entry beside the diagonal alone
    assert "below zero" in failure(multipliers.claimed(content))


def test_even_functions_have_no_kernels_of_both_signs(contents):
    content = contents["static"]
    content["blocks"][0]["odd"] = False
    with pytest.raises(Unreadable, match="too many"):
        multipliers.claimed(content)


def test_a_loop_that_is_not_stable_is_refused_whatever_the_inequality(contents):
    content = contents["static"]
    n = content["A"]["shape"][0]
    for k in range(n):
        content["A"]["array"][k * (n + 1)] *= -1.0
    assert failure(multipliers.claimed(content)) == "the nominal loop is not stable"


def test_a_path_at_the_same_instant_is_refused(contents):
    content = contents["static"]
    content["D"]["array"][0] = 0.1
    assert "same instant" in failure(multipliers.claimed(content))


@pytest.mark.parametrize("name", names(EVERY))
def test_the_command_says_the_block_and_decides(name, contents, tmp_path, capsys):
    path = tmp_path / "gain.json"
    head = {"schema": "symheli statement", "version": 2, "statement": "multiplier-gain"}
    path.write_text(json.dumps({**head, **contents[name]}))
    assert report.main([str(path)]) == PROVEN
    said = capsys.readouterr().out
    assert repr(contents[name]["gain"]) in said
    assert "inputs 1" in said


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("repeated", "zero at zero"),  # not so of a sector, which says it by itself
        ("dynamics", "time-invariant"),  # lags of multipliers commute with nothing else
        ("own", "multiple"),  # without the path from zero to the block nothing follows
        ("own", "causal block of bounded gain"),
        ("energy, own", "over every finite time"),
    ],
)
def test_what_the_proof_needs_of_a_block_is_said(name, said, contents):
    content = contents[name]
    assert any(said in sentence for sentence in claimed(content).hypotheses)
    assert any(said in sentence for sentence in MultiplierGain.restored(content).conditions)


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


@pytest.mark.parametrize("name", names(EVERY))
def test_the_package_and_the_checker_decide_alike_about_changed_numbers(name, contents):
    """Two writings of one definition: one proven and the other not would be an error of one."""
    rng = random.Random(name)
    for _ in range(12):
        factor = rng.choice([0.0, -1.0, 0.9, 0.999, 1.001, 1.1])
        other, place = changed(
            contents[name],
            rng,
            lambda v, f=factor: f * v if isinstance(v, float) else v,
        )
        try:
            checked = failure(claimed(other)) == ""
        except (Unreadable, *DAMAGED):
            checked = False
        try:
            own = MultiplierGain.restored(other).verified
        except (SymheliError, *DAMAGED):
            own = False
        assert checked == own, (place, factor)


@pytest.mark.parametrize("name", names(EVERY))
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
