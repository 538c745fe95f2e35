"""The rule by which sizes of a first design are changed."""

from pathlib import Path

import pytest

from evidence.sizes import COMMAND, DEVIATION, SLOWER, Trial, changed, missed, picture
from studies.controllers.design_choices import DesignChoices
from studies.controllers.judged import travel_of

FLYBARLESS = Path(__file__).resolve().parents[3] / "shared/data/vehicles/flybarless700.toml"


def test_an_axis_with_little_margin_gets_a_smaller_command():
    before = DesignChoices()
    after, said = changed(before, {("yaw", "gain margin"): -50.0, ("yaw", "bandwidth"): -10.0})
    assert after.sizes == {**before.sizes, "d_ped": pytest.approx(before.sizes["d_ped"] / SLOWER)}
    assert said == "yaw slower (gain margin)"


def test_a_slow_axis_gets_a_larger_command_and_a_smaller_deviation():
    before = DesignChoices()
    after, _ = changed(before, {("roll", "bandwidth"): -50.0})
    assert after.sizes["d_lat"] == pytest.approx(COMMAND * before.sizes["d_lat"])
    assert after.sizes["v"] == pytest.approx(DEVIATION * before.sizes["v"])
    assert after.noise == before.noise


def test_a_command_stays_within_its_travel():
    choices = DesignChoices()
    for _ in range(8):
        choices, _ = changed(choices, {("roll", "bandwidth"): -50.0})
    assert choices.sizes["d_lat"] == travel_of(choices)["d_lat"]


def test_what_no_size_decides_changes_nothing():
    before = DesignChoices()
    assert changed(before, {("roll", "phase delay"): -50.0}) == (before, "")


@pytest.mark.slow
def test_the_first_sizes_of_the_xcell_miss_the_rejection_bandwidth_in_pitch():
    """As the first row of the table on the page says."""
    trial = Trial.of("xcell60")
    off = missed(trial.scheduled(trial.choices))
    assert any(entry == ("pitch", "disturbance rejection bandwidth") for entry, _ in off)


@pytest.mark.slow
def test_the_picture_is_drawn(tmp_path):
    picture(tmp_path / "sizes.png")
    assert (tmp_path / "sizes.png").stat().st_size > 10_000


@pytest.mark.skipif(not FLYBARLESS.is_file(), reason="the file of this vehicle is not here")
def test_a_vehicle_of_a_file_has_first_sizes():
    assert Trial.of(str(FLYBARLESS)).choices.sizes["d_lat"] > 0
