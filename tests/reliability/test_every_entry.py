"""Every public callable is fuzzed or is exempt for a reason; what is asked of it comes back as a
result with every number said, or as an error of this project.
"""

import ast
import doctest
import importlib
import inspect

import entries
import fuzzed
import pytest
from valid_calls import INSIDE, PACKAGES, caught, exported

SOME = 8
"""Changed calls of an entry in the default run."""
QUICK = (
    *(
        "symheli.Scheduling",
        "symheli.Excitation",
        "symheli.AirspeedSchedule",
        "symheli.environment.Gust",
    ),
    *(
        "symheli.Wind",
        "symheli.environment.Dryden",
        "symheli.Servo",
        "symheli.Sensor",
        "symheli.trim",
    ),
    *(
        "symheli.LinearModel",
        "symheli.steady.FlightCondition",
        "symheli.environment.standard_atmosphere",
    ),
    *("identification.LPVARX", "identification.Polynomial", "symheli.lpv.BSpline"),
    *(
        "identification.methods.Ridge",
        "identification.structure.LaggedSignals",
        "identification.judge.theil",
    ),
    *("identification.judge.fit_percent", "identification.residual_analysis"),
    *(
        "synthesis.forms.Spline",
        "synthesis.analysis.LowerBoundSearch",
        "synthesis.objectives.PoleRegion",
        "synthesis.analysis.open_loop",
    ),
)


@pytest.fixture(autouse=True)
def _somewhere_else(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def _called(text):
    """Names of what examples call."""
    source = "\n".join(example.source for example in doctest.DocTestParser().get_examples(text))
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            function = node.func
            yield (
                function.attr
                if isinstance(function, ast.Attribute)
                else getattr(function, "id", "")
            )


def test_every_public_callable_is_in_an_example_or_exempt_for_a_reason():
    """Examples are where calls are caught."""
    names = {entry for entry, thing in exported() if not entry.endswith(".Forgetting")}
    assert set(entries.EXEMPT) <= names
    shown = set(INSIDE)
    for package in PACKAGES:
        texts = [importlib.import_module(package).__doc__]
        texts += [inspect.getdoc(thing) for entry, thing in exported()]
        called = {name for text in texts for name in _called(text or "")}
        shown |= {f"{package}.{name}" for name in called}
    assert sorted(names - shown - set(entries.EXEMPT)) == []


def _calls(accepted):
    found = {}
    for call in caught(accepted):
        if entries.asked(call.entry):
            found.setdefault(call.entry, []).append(call)
    return found


@pytest.mark.slow
def test_no_changed_argument_of_quick_entries_fails_silently():
    told, asked = [], 0
    for entry, calls in _calls(lambda name: name in QUICK).items():
        if entry.startswith(QUICK):
            tally = fuzzed.tally(calls, SOME)
            told += tally.faults
            asked += tally.outcomes.total()
    assert asked > 150
    assert not told, "\n".join(map(str, told))
