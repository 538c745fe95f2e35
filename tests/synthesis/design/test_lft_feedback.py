"""Controllers for parameters that jump, as linear fractional transformations."""

import math

import numpy as np
import pytest
from scheduled_plants import frozen, spring

from synthesis import hinf, lft_gain, output_feedback
from synthesis.designs import lft_feedback


@pytest.mark.slow
def test_the_lft_of_the_loop_proves_what_the_inequalities_promise():
    """Two analyses that share nothing: constant Lyapunov matrices over p, and multipliers of a
    block.
    """
    made = lft_feedback(spring())
    slack = 1 + 1e-3  # of functions fitted to the gains
    assert made.certify(math.inf, search=None).gamma <= made.promised * slack
    loop = made.closed().to_lft().reduce()
    assert lft_gain(loop).gamma <= made.promised * 1.02


@pytest.mark.slow
def test_jumps_cost_more_than_rates_and_no_less_than_standing_still():
    jumps = lft_feedback(spring())
    assert jumps.optimum == pytest.approx(output_feedback(spring(), math.inf).optimum, rel=1e-9)
    assert jumps.optimum >= output_feedback(spring(), 1.0, X=0, Y=2).optimum
    worst = max(hinf(*frozen(spring(), p)).optimum for p in np.linspace(0, 1, 5))
    assert jumps.optimum >= worst


@pytest.mark.slow
def test_the_controller_is_an_lft_in_p():
    made = lft_feedback(spring())
    lft = made.model.to_lft().reduce()
    for p in (0.0, 0.3, 1.0):
        np.testing.assert_allclose(lft.at(p).A, made.at(p).A, rtol=1e-8, atol=1e-8)
