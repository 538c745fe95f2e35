"""The examples in the documentation of what is exported and judged run and print what they say."""

import doctest
import importlib

import pytest

MODULES = (
    "symheli.export.c",
    "symheli.export.mat",
    "identification.export.estimator",
    "identification.export.model",
    "identification.judge.scores",
    "identification.judge.against_constant",
    "identification.judge.beside_baseline",
    "identification.judge.frozen_models",
    "symheli.lpv.uncertain_state_space",
)


@pytest.mark.slow(only=("symheli.export.mat", "symheli.lpv.uncertain_state_space"))
@pytest.mark.parametrize("name", MODULES)
def test_the_examples_run(name):
    found = doctest.testmod(importlib.import_module(name))
    assert found.attempted > 0
    assert found.failed == 0
