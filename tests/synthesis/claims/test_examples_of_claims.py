"""The examples in the docstrings of every public name of `synthesis.claims`."""

import doctest
import importlib

import pytest

import synthesis
from synthesis import claims


@pytest.mark.parametrize("name", claims.__all__)
def test_the_example_of_a_public_name_prints_what_it_says(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    thing = getattr(claims, name)
    module = importlib.import_module(thing.__module__)
    names = {**vars(module), "synthesis": synthesis}
    found = doctest.DocTestParser().get_doctest(thing.__doc__, names, name, None, None)
    assert found.examples, f"{name} has no example"
    assert doctest.DocTestRunner().run(found).failed == 0
