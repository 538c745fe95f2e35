"""The bracket of the lateral loop: quick forms of it, and the page's largest proof in the slow
tests.
"""

import pytest

from evidence.bracket.measured import Bracket, bracket
from studies.loops.lateral import lateral_loop
from synthesis.analysis import LowerBoundSearch
from synthesis.forms import LaggedParameter

QUICK = LowerBoundSearch(levels=6, dwells=5, starts=1, nodes=40, evaluations=8, samples=5000)


@pytest.mark.slow
def test_a_bracket_is_ordered_and_its_proof_exact(ideal):
    loop = lateral_loop(ideal, 5.0, 9.0, points=9)
    found = bracket(
        loop, 3.0, LaggedParameter(0.6, segments=3, grading=1.0, across_segments=1), QUICK
    )
    assert found.exact
    assert found.lower <= min(found.memory, found.plain)
    assert found.gap < 1.2
    assert Bracket(1.0, 2.0, 5.0, 4.0, True).gap == 2.0
