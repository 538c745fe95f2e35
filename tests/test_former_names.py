"""Names and module paths of the last release work for one release more, and say where they are."""

import importlib
import sys
import tomllib
import warnings
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
TABLES = sorted((*ROOT.glob("*/former.toml"), *ROOT.glob("symheli/*/former.toml")))
FORMER = [
    (".".join(table.parent.relative_to(ROOT).parts), old, new)
    for table in TABLES
    for old, new in tomllib.loads(table.read_text(encoding="utf-8"))["names"].items()
]

pytestmark = pytest.mark.guard


def named(path):
    """What a dotted path of a public name stands for, without a warning."""
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


def test_every_former_name_is_what_it_is_called_now_and_says_so():
    assert len(FORMER) > 150
    for package, old, new in FORMER:
        module = importlib.import_module(package)
        assert old not in module.__all__
        with pytest.warns(FutureWarning, match=f"{package}.{old} is {new} now"):
            assert getattr(module, old) is named(new)


def test_a_name_that_never_was_is_not_there():
    import synthesis

    with pytest.raises(AttributeError, match="no attribute 'no_such_name'"):
        synthesis.no_such_name  # noqa: B018


@pytest.mark.parametrize(
    ("old", "new", "name"),
    [
        ("synthesis.polynomial.exact", "synthesis.numerics.polynomial.exact", "positive_definite"),
        ("synthesis.program.cone_program", "synthesis.numerics.program.cone_program", "Solver"),
        ("symheli.enclosure", "synthesis.tubes.enclosure", "enclose"),
    ],
)
def test_a_module_that_moved_is_found_at_its_former_path(old, new, name, monkeypatch):
    for path in [path for path in sys.modules if old.startswith(path) or path.startswith(old)]:
        if path.count("."):
            monkeypatch.delitem(sys.modules, path)
    with pytest.warns(FutureWarning) as said:  # of its package too
        former = importlib.import_module(old)
    assert f"{old} is {new} now" in str(said[-1].message)
    assert getattr(former, name) is named(f"{new}.{name}")


def test_a_module_that_never_was_is_not_there():
    with pytest.raises(ModuleNotFoundError), warnings.catch_warnings(action="ignore"):
        importlib.import_module("synthesis.polynomial.no_such_module")


@pytest.mark.parametrize(
    ("module", "kind", "new"),
    [
        ("synthesis", "Certificate", "bound"),
        ("synthesis.certify.questions.gain_curve", "GainCurve", "bounds"),
        ("synthesis.design.loops.frozen_reading", "Largest", "bound"),
        ("synthesis.sets", "InvariantSet", "verified"),
        ("synthesis.sets", "LowComplexitySet", "verified"),
        ("synthesis.tubes", "Tube", "verified"),
    ],
)
def test_what_is_proven_is_a_bound_or_a_truth_and_the_old_name_warns(module, kind, new):
    class Found(getattr(importlib.import_module(module), kind)):
        """A result with one number."""

        def __new__(cls):
            return object.__new__(cls) if not issubclass(cls, tuple) else tuple.__new__(cls, (0,))

        def __init__(self):
            pass

    setattr(Found, new, 0.5)
    with pytest.warns(FutureWarning, match=rf"Found\.proven is \.{new} now"):
        assert Found().proven == 0.5
