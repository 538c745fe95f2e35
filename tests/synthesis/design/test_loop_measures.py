"""Numbers read off a frozen loop, and how a table prints them."""

import math
from dataclasses import replace

import pytest

from symheli import LinearModel
from synthesis import margins
from synthesis.analysis import attitude_bandwidth, open_loop
from synthesis.design.loops.loop_measures import LARGEST, MEASURES, LoopMeasures
from synthesis.design.loops.responses import Responses

INTEGRATOR = LinearModel([[0.0]], [[1.0]], [[1.0]], [[0.0]], ["y"], ["u"], ["y"])


def test_an_integrating_loop_has_its_closed_form():
    """2/s: any gain, 90 deg, pi/4 s at 2 rad/s, any disk."""
    found = LoopMeasures.of(margins(open_loop(INTEGRATOR, {("u", "y"): -2.0}, "u")))
    assert found.stable
    assert found["gain"] == found["disk_gain"] == LARGEST  # any
    assert found["phase"] == pytest.approx(90.0)
    assert found["delay"] == pytest.approx(1e3 * math.pi / 4)
    assert found["disk_phase"] == pytest.approx(90.0)
    assert found["crossover"] == pytest.approx(2.0)
    assert [found.cell(name) for name in ("gain", "phase", "delay")] == ["40.0", "90.0", "785"]


def test_a_disk_that_was_not_asked_for_has_no_number():
    found = LoopMeasures.of(margins(open_loop(INTEGRATOR, {("u", "y"): -2.0}, "u"), disk=False))
    assert set(found.values) == {"gain", "phase", "delay", "crossover"}


def test_the_gain_margin_is_the_nearer_of_both_directions():
    """k (s + 2)/(s (s - 1)): stable for k > 1, so k = 1.5 may fall by 3.52 dB, and rise freely."""
    plant = LinearModel(
        [[0.0, 0.0], [2.0, 1.0]], [[1.0], [1.0]], [[0.0, 1.0]], [[0.0]], ["a", "b"], ["u"], ["y"]
    )
    found = margins(open_loop(plant, {("u", "y"): -1.5}, "u"))
    assert found.decibels[1] == math.inf
    assert found.gain_margin == pytest.approx(20 * math.log10(1.5))


def test_a_loop_that_is_not_stable_is_a_word():
    unstable = LoopMeasures.of(margins(open_loop(INTEGRATOR, {("u", "y"): 1.0}, "u")))
    assert unstable.cell("gain") == "unstable"
    doubtful = replace(unstable, stable=None, values={"gain": 3.0, "peak": math.nan}, bands={})
    assert (doubtful.cell("gain"), doubtful.cell("peak")) == ("3.0", "not known")


def test_bands_are_printed_with_the_digits_of_their_number():
    found = LoopMeasures(True, {"gain": 6.04, "phase": 45.0}, {"gain": 0.26})
    assert (found.cell("gain"), found.cell("phase")) == ("6.0 +-0.3", "45.0")
    assert found.banded("phase") == (45.0, 0.0)


def test_the_two_bandwidths_have_two_names():
    A, B = [[-4.0, 0.0], [1.0, 0.0]], [[1.0], [0.0]]  # 1/(s (s + 4)): 45 deg left at 4 rad/s
    roll = LinearModel(A, B, [[0.0, 1.0]], [[0.0]], ["p", "phi"], ["d_lat"], ["phi"])
    responses = Responses(3.0, *[0.0] * 6)
    found = LoopMeasures.of(responses=responses, attitude=attitude_bandwidth(roll))
    assert found["bandwidth_3db"] == 3.0
    assert found["bandwidth_ads33"] == pytest.approx(4.0)
    assert {name for name in MEASURES if name.startswith("bandwidth")} <= set(found.values)


def test_every_response_has_a_name_and_a_unit():
    assert set(Responses._fields) < set(MEASURES)
