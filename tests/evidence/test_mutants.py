"""Every error of `evidence.mutants` can be put into today's code, and its tests are there."""

import pytest

from evidence.mutants import MUTANTS, ROOT

pytestmark = pytest.mark.guard


def test_there_are_enough_and_each_is_another():
    assert len({mutant.error for mutant in MUTANTS}) == len(MUTANTS) >= 60


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.error)
def test_the_code_to_be_changed_stands_once_and_the_tests_are_there(mutant):
    assert (ROOT / mutant.file).read_text(encoding="utf-8").count(mutant.right) == 1
    for test in mutant.tests.split():
        file, _, name = test.partition("::")
        assert name.partition("[")[0] in (ROOT / file).read_text(encoding="utf-8")
