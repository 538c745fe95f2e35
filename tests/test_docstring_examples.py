"""Every exported callable shows how it is used, and what it shows is so.

The examples of a package start from the names that its own docstring makes.
"""

import doctest
import importlib
import inspect

import pytest

PACKAGES = ("symheli", "identification")
FUNCTIONS_OF = ("symheli.lpv", "symheli.records")
"""Rooms whose classes are values of other rooms, or results: here the functions are shown."""

UNWRITTEN = {
    f"symheli.{name}"
    for name in ("LPVStateSpace", "LinearFamily", "LinearGrid", "Scheduling", "sweep_grid")
}
"""Exported names whose examples are not written yet; one that gets them leaves this list."""

FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def exported():
    for package in (*PACKAGES, *FUNCTIONS_OF):
        module = importlib.import_module(package)
        for name in module.__all__:
            thing = getattr(module, name)
            error = isinstance(thing, type) and issubclass(thing, Exception)
            shown = callable(thing) and not error
            if shown and (package in PACKAGES or not isinstance(thing, type)):
                yield package, name


def run(text, where, names):
    """The names after the examples of a docstring; fails with the first that prints otherwise."""
    examples = doctest.DocTestParser().get_doctest(text, names, where, None, None)
    assert examples.examples, f"{where} has no example"
    runner, report = doctest.DocTestRunner(optionflags=FLAGS, verbose=False), []
    runner.run(examples, out=report.append, clear_globs=False)
    assert not runner.failures, "".join(report)
    return examples.globs


@pytest.fixture(scope="module")
def start():
    """What the docstring of each package makes."""
    made = {}

    def of(package):
        if package not in made:
            made[package] = run(importlib.import_module(package).__doc__, package, {})
        return dict(made[package])

    return of


@pytest.mark.parametrize(("package", "name"), exported())
def test_the_examples_of_an_exported_name_print_what_they_say(package, name, start):
    text = inspect.getdoc(getattr(importlib.import_module(package), name)) or ""
    where = f"{package}.{name}"
    if where in UNWRITTEN:
        assert "\nExamples\n---" not in text, f"take {where} off UNWRITTEN"
        return
    assert "\nExamples\n--------\n" in text, f"{where} has no section Examples"
    run(text, where, start(package))
