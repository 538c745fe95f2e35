"""The bracket of the lateral loop: quick forms of it, and the page's largest proof in the slow
tests.
"""

import pytest

import synthesis
from evidence.bracket.measured import FASTEST, Bracket, bracket, proves
from studies.loops.lateral import lateral_loop
from synthesis.analysis import LowerBoundSearch, Status
from synthesis.forms import LaggedParameter, Spline

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


@pytest.mark.slow
def test_the_lateral_loop_is_proven_at_seven_and_grows_at_seven_and_a_half(ideal):
    loop = lateral_loop(ideal)
    assert proves(loop, 7.0, FASTEST)
    assert not proves(loop, 5.0, Spline())
    assert (
        synthesis.stability(loop, 7.6, form=Spline(degree=2, segments=4)).status is Status.GROWING
    )


@pytest.mark.slow
def test_the_gain_at_three_is_known_within_a_tenth(ideal):
    found = bracket(
        lateral_loop(ideal),
        3.0,
        LaggedParameter(0.6, segments=12, grading=1.5, across_segments=4, across_degree=3),
    )
    assert found.exact
    assert found.gap < 1.1
    assert found.plain > 1.5 * found.memory
