"""What the examples of the studies' docstrings show is so."""

import doctest
import importlib
from pathlib import Path

import numpy as np
import pytest

import studies
from studies.campaigns.campaign import Campaign
from studies.campaigns.runners import Here
from studies.campaigns.trial import Trial

ROOT = Path(studies.__file__).parent
MODULES = sorted(
    ".".join(("studies", *file.relative_to(ROOT).with_suffix("").parts)).removesuffix(".__init__")
    for file in ROOT.rglob("*.py")
    if "\n    >>> " in file.read_text(encoding="utf-8")
)
NAMES = {"np": np, "Here": Here, "Trial": Trial, "Campaign": Campaign}
"""What the examples of campaigns do not import again."""


@pytest.mark.parametrize("module", MODULES)
def test_what_the_examples_of_a_module_show_is_so(module):
    found = doctest.testmod(importlib.import_module(module), extraglobs=NAMES)
    assert found.attempted
    assert not found.failed
