"""Gains of many states over several parameters: inequalities at single p, a proof of the box."""

import pytest

from benchmarks.loops_over_decades import loop
from symheli import LPVStateSpace, Scheduling
from synthesis import l2_gain

CLOSE = 1.01
MANY = (4, 6, 16, 21, 37)
"""Seeds of loops of 10 states and more, with units of many decades."""


def over_two(own, rate):
    """A loop over two parameters that change nothing of it."""
    parameters = [Scheduling(name, "1", 0.0, 1.0, rate=rate) for name in ("p", "q")]
    return LPVStateSpace.polynomial(*({(0, 0): M} for M in own.model), parameters)


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed", [MANY[1], *(pytest.param(s, marks=pytest.mark.slow) for s in MANY if s != MANY[1])]
)
def test_the_gain_of_a_constant_loop_over_two_parameters_is_its_norm(seed):
    own = loop(seed)
    assert len(own.model.A) > 9
    certificate = l2_gain(over_two(own, float("inf")), search=None)
    assert own.norm * (1 - 1e-12) <= certificate.gamma <= CLOSE * own.norm
    assert certificate.verify()
