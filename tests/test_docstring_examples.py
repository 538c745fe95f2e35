"""Every public name explains itself with an example that runs."""

import doctest
import importlib
import inspect
import sys
import warnings

import pytest

WITHOUT = {
    "synthesis": {
        # values that the functions return, and exceptions: shown in the examples of what makes them
        *("Attempt", "Bandwidth", "BoxGain", "FrozenGain", "LowerBound", "Margins", "Proof"),
        *("Seconds", "Trajectory", "Status", "Multiplier"),
        *("BoxLyapunov", "MemoryLyapunov", "SplineLyapunov"),
        # replaced by a model of several parameters in symheli
    },
}
"""Names without an example, by package."""

NAMES = [
    (package, name)
    for package, without in WITHOUT.items()
    for name in importlib.import_module(package).__all__
    if name not in without and callable(getattr(importlib.import_module(package), name))
]


@pytest.mark.parametrize(("package", "name"), NAMES)
def test_the_example_of_a_public_name_runs(package, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    thing = getattr(importlib.import_module(package), name)
    text = inspect.getdoc(thing) or ""
    assert ">>> " in text, f"{package}.{name} has no example"
    names = {**vars(sys.modules[thing.__module__]), **vars(importlib.import_module(package))}
    test = doctest.DocTestParser().get_doctest(text, names, f"{package}.{name}", None, 0)
    told: list[str] = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        failed = doctest.DocTestRunner(verbose=False).run(test, out=told.append).failed
    assert not failed, "".join(told)


@pytest.mark.parametrize(("package", "name"), [pair for pair in NAMES if pair[1].islower()])
def test_a_public_function_describes_what_it_takes_and_returns(package, name):
    thing = getattr(importlib.import_module(package), name)
    text = inspect.getdoc(thing) or ""
    assert "Returns\n-------" in text
    for parameter in inspect.signature(thing).parameters:
        assert parameter in text.split("Parameters\n----------", 1)[1], parameter
