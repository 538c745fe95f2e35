"""Least gains of scheduled output feedback against the worst frozen optimum, which no controller
beats, and printed optima.
"""

import math

import pytest

from benchmarks.random_plants import random_plant
from symheli.errors import SymheliError
from synthesis import output_feedback

CLOSE = 1.02
BELOW = 1 - 2e-3
"""The frozen optima are known to a part in a thousand, the least gain to that and what the points
at which it is imposed leave.
"""
BACK_OFF = 1.02
QUICK = (6,)


def least(seed, slow):
    """By the worst frozen optimum; inf where the plant is refused."""
    drawn = random_plant(seed)
    try:
        made = output_feedback(drawn.plant, drawn.slow if slow else 0.0)
    except SymheliError:
        return math.inf
    return made.optimum / drawn.worst


@pytest.mark.slow
@pytest.mark.parametrize("slow", [False, True])
@pytest.mark.parametrize("seed", QUICK)
def test_the_least_gain_is_the_worst_frozen_optimum(seed, slow):
    assert BELOW <= least(seed, slow) <= CLOSE
