"""The search from below ends after the time it was given, says so, and tells where it is."""

import math
import time

import pytest
from models import lateral, spring

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from synthesis import l2_gain, lft_gain, lower_bound
from synthesis.analysis import LowerBoundSearch, energy_to_peak
from synthesis.forms import Spline


def mass_spring():
    stiffness, damping = (Scheduling(name, "1", -1, 1, rate=0.3) for name in "kd")
    return LPVStateSpace.polynomial(
        A={(0, 0): [[0, 1], [-1, -0.6]], (1, 0): [[0, 0], [-0.3, 0]], (0, 1): [[0, 0], [0, -0.2]]},
        B={(0, 0): [[0], [1]]},
        C={(0, 0): [[1, 0]]},
        D={(0, 0): [[0]]},
        scheduling=[stiffness, damping],
    )


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.3, 1.0])
def test_a_search_over_a_box_keeps_to_its_budget_and_says_so(seconds):
    began = time.process_time()
    cert = l2_gain(mass_spring(), form=Spline(degree=1), search=LowerBoundSearch(seconds=seconds))
    spent = time.process_time() - began
    # every line ends with what it has begun: the steps of one cycle, and the response to its
    # explicit input
    assert cert.seconds.bounds < 4 * seconds + 5, spent
    assert f"for at most {seconds:g} s" in cert.details
    assert "which ended the search" in cert.details
    assert cert.frozen <= cert.lower <= cert.gamma


@pytest.mark.slow
def test_a_search_that_was_not_made_is_not_claimed():
    assert "no trajectory was searched" in l2_gain(spring(damping=0.4), 0.1, search=None).details
    quick = LowerBoundSearch(
        levels=3, dwells=2, starts=1, nodes=10, evaluations=2, steps=20, samples=100, seconds=60.0
    )
    for cert in (
        energy_to_peak(spring(damping=0.4), 0.1, search=quick),
        lft_gain(spring(damping=0.4).to_lft().reduce(), search=quick),
    ):
        assert "at most 60 s: a longer" in cert.details


@pytest.mark.slow
def test_more_time_is_never_worse_and_no_time_still_a_bound():
    bounds = [
        lower_bound(
            lateral(), 0.3, search=LowerBoundSearch(seconds=s, evaluations=10, starts=1)
        ).gain
        for s in (1e-9, math.inf)
    ]
    assert l2_gain(lateral(), 0.0, search=None).frozen <= bounds[0] * (1 + 1e-9)
    assert bounds[0] <= bounds[1]


def test_a_budget_of_nothing_is_refused():
    with pytest.raises(InputError, match="seconds > 0"):
        LowerBoundSearch(seconds=0.0)
