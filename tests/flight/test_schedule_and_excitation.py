"""What is commanded: ramps of a known peak acceleration, excitation of a known size."""

import numpy as np
import pytest

from symheli import AirspeedSchedule, Excitation
from symheli.errors import InputError, UnknownNameError

INPUTS = {"d_lon": 0.012, "d_lat": 0.02, "d_col": 0.01}
TIME = 0.02 * np.arange(3000)


def test_each_ramp_peaks_at_its_acceleration_and_reaches_its_target():
    schedule = AirspeedSchedule((13.0, 4.0), (3.0, 1.5), (2.0, 2.0))
    t = np.linspace(0, schedule.duration, 40001)
    speed, rate = schedule(t)
    assert rate.max() == pytest.approx(
        3.0, rel=1e-6
    )  # a node lies within 1e-3 of the middle of the ramp
    assert rate.min() == pytest.approx(-1.5, rel=1e-6)
    assert speed.max() == pytest.approx(13.0)
    assert speed[-1] == pytest.approx(4.0)
    np.testing.assert_allclose(np.gradient(speed, t), rate, atol=2e-3)


def test_transition_returns_to_where_it_began():
    schedule = AirspeedSchedule.transition(2.0, 10.0, laps=2)
    assert len(schedule.targets) == 4
    speed, rate = schedule([0.0, schedule.duration])
    np.testing.assert_allclose(speed, 2.0)
    np.testing.assert_allclose(rate, 0.0)


def test_varied_schedules_follow_their_seed_and_cover_the_range():
    one, again = (
        AirspeedSchedule.varied(0.0, 13.0, (1.5, 3.0, 4.0, 2.0), 1.0, seed=3) for _ in range(2)
    )
    assert one == again
    assert one != AirspeedSchedule.varied(0.0, 13.0, (1.5, 3.0, 4.0, 2.0), 1.0, seed=4)
    assert {0.0, 13.0} <= set(one.targets)
    assert all(0 <= v <= 13 for v in one.targets)


def test_a_schedule_that_cannot_be_flown_is_refused():
    with pytest.raises(InputError, match="as many accelerations"):
        AirspeedSchedule((1.0,), (1.0, 2.0), (1.0,))
    with pytest.raises(InputError, match="accelerations > 0"):
        AirspeedSchedule((1.0,), (0.0,), (1.0,))


def test_multisines_of_different_inputs_are_orthogonal_and_of_their_amplitude():
    signals = Excitation(INPUTS)(TIME)
    stacked = np.column_stack(list(signals.values()))
    gram = stacked.T @ stacked / len(TIME)
    size = np.array(list(INPUTS.values()))
    np.testing.assert_allclose(np.diag(gram), size**2 / 2, rtol=1e-9)
    np.testing.assert_allclose(gram - np.diag(np.diag(gram)), 0, atol=1e-15)


def test_multisines_stay_inside_their_band():
    signal = Excitation({"d_lon": 1.0}, band=(0.5, 2.0))(TIME)["d_lon"]
    power = np.abs(np.fft.rfft(signal)) ** 2
    frequency = np.fft.rfftfreq(len(TIME), 0.02)
    inside = (frequency >= 0.5 - 1e-9) & (frequency <= 2.0 + 1e-9)
    assert power[~inside].sum() < 1e-20 * power.sum()


@pytest.mark.parametrize("kind", ["multisine", "prbs", "chirp"])
def test_excitation_is_determined_by_its_seed(kind):
    first, again, other = (Excitation(INPUTS, kind, seed=s)(TIME) for s in (1, 1, 2))
    for name in INPUTS:
        np.testing.assert_array_equal(first[name], again[name])
    assert kind == "chirp" or not np.array_equal(first["d_lon"], other["d_lon"])


@pytest.mark.parametrize("kind", ["prbs", "chirp"])
def test_switched_and_swept_excitation_reaches_its_amplitude_and_no_more(kind):
    for name, signal in Excitation(INPUTS, kind)(TIME).items():
        assert np.abs(signal).max() == pytest.approx(INPUTS[name], rel=1e-3)


def test_an_excitation_that_cannot_be_made_is_refused():
    with pytest.raises(UnknownNameError, match="did you mean 'multisine'"):
        Excitation(INPUTS, "multisin")
    with pytest.raises(InputError, match="0 < low < high"):
        Excitation(INPUTS, band=(2.0, 1.0))
    with pytest.raises(InputError, match="amplitudes must be >= 0"):
        Excitation({"d_lon": -1.0})
    with pytest.raises(InputError, match=r"carry at most 2\.5 Hz"):
        Excitation(INPUTS)(0.2 * np.arange(100))
