"""Instruments on the study's noisy flight: the command is an excitation too."""

import pytest

import symheli
from identification import fit
from identification.methods import InstrumentalVariables
from studies.setup.axes import LONGITUDINAL
from studies.setup.flights import TransitionPlan, autopilot_for
from symheli.errors import DataWarning

ADDED = ("e_d_lon", "e_d_col")


@pytest.mark.slow
def test_instruments_beat_least_squares_in_flight_once_the_command_is_among_them():
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    autopilot, plan = autopilot_for(heli), TransitionPlan(noise_db=30.0)
    training, test = plan.training(heli, autopilot), plan.test(heli, autopilot)
    arx = LONGITUDINAL.structure(order=2)
    biased = fit(arx, training)
    with pytest.warns(DataWarning, match="the instruments are weak"):
        added, commanded = (
            fit(arx, training, InstrumentalVariables(names))
            for names in (ADDED, (*ADDED, "airspeed_command"))
        )
    # measured 1 s ahead: q 78 by least squares, 93 by instruments; free run of u 93, 89 and without
    # the command -44.
    assert commanded.score(test, 50)["q"] > biased.score(test, 50)["q"] + 8
    assert commanded.score(test)["u"] > 75
    assert added.score(test)["u"] < 50
