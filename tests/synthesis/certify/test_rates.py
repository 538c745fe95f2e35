"""The rate of a parameter, in every form a user writes it."""

import math

import pytest
from models import lag

from symheli import Scheduling
from symheli.errors import InputError, UnknownNameError
from synthesis import l2_gain, lower_bound, stability
from synthesis.certify.statement.rates import rates

SPEED, MASS = (
    Scheduling("airspeed", "m/s", 0.0, 13.0, 3.0),
    Scheduling("mass", "kg", 6.0, 10.0, 0.0),
)


def test_one_for_all_one_for_each_or_by_name():
    assert rates((SPEED, MASS), None) == (3.0, 0.0)
    assert rates((SPEED, MASS), 2) == (2.0, 2.0)
    assert rates((SPEED, MASS), [1.0, math.inf]) == (1.0, math.inf)
    assert rates((SPEED, MASS), {"airspeed": 1.0}) == (1.0, 0.0)
    for wrong in (-1.0, math.nan, [1.0], {"mass": -1.0}, {"mass": None}):
        with pytest.raises(
            InputError, match=r"rate must be >= 0 .* airspeed \(m/s/s\), mass \(kg/s\)"
        ):
            rates((SPEED, MASS), wrong)
    with pytest.raises(UnknownNameError, match="1 m/s"):  # a text is the name of a parameter
        rates((SPEED, MASS), "1 m/s")


@pytest.mark.slow
def test_the_rate_of_the_one_parameter_may_be_given_by_name():
    for question in (l2_gain, stability):
        named, plain = question(lag(), {"p": 0.3}, search=None), question(lag(), 0.3, search=None)
        assert named.rates == plain.rates == (0.3,)
        with pytest.raises(
            UnknownNameError, match="unknown scheduling parameter 'airspeed'; known: p"
        ):
            question(lag(), {"airspeed": 0.3})
    assert lower_bound(lag(), {"p": 0.0}).gain == lower_bound(lag(), 0.0).gain
