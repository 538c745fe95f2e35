"""Candidate flights compared by what they would teach."""

import numpy as np

import symheli
from studies.campaigns.experiments import Candidate, design
from studies.transition.axes import LONGITUDINAL
from studies.transition.flights import autopilot_for

SMALL, LARGE = Candidate("prbs", (0.1, 5.0), 0.25, 3.0), Candidate("prbs", (0.1, 5.0), 0.75, 3.0)


def test_a_larger_excitation_teaches_in_proportion_until_it_exceeds_a_limit_or_is_lost():
    wild = Candidate("multisine", (0.1, 0.5), 40.0, 3.0)
    found = design("xcell60", LONGITUDINAL, 1, {"q": 2.0}, [SMALL, LARGE, wild])
    assert [e.name for e in found.plan.experiments] == [LARGE.name]
    assert "was lost" in found.lost[wild.name]
    small, large = (float(np.median(e.bounds)) for e in found.experiments)
    assert (
        2.0 < small / large < 9.0
    )  # three times the amplitude; products of two signals grow ninefold
    assert SMALL.name in found.table()
    strict = design("xcell60", LONGITUDINAL, 1, {"q": 0.8 * peak(LARGE)}, [SMALL, LARGE])
    assert [e.name for e in strict.plan.experiments] == [SMALL.name]


def peak(candidate):
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    return float(np.abs(candidate.fly(heli, LONGITUDINAL, autopilot_for(heli), 0)["q"]).max())
