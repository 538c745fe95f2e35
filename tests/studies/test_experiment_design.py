"""Candidate flights compared by what they would teach, written for the field, and flown."""

import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest

import symheli
from studies import cli
from studies.campaigns import flyable
from studies.campaigns.experiments import Candidate, design
from studies.commands import experiment
from studies.setup.axes import CHOICES, LONGITUDINAL
from studies.setup.flights import autopilot_for
from symheli.errors import InputError

SMALL, LARGE = Candidate("prbs", (0.1, 5.0), 0.25, 3.0), Candidate("prbs", (0.1, 5.0), 0.75, 3.0)


def test_the_command_offers_every_axis():
    """The command line lists the axes without loading them."""
    (axis,) = (one for one in experiment.ARGUMENTS if one.name == "--axis")
    assert axis.settings["choices"] == tuple(CHOICES)


@pytest.mark.slow
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


@pytest.fixture(scope="module")
def field(tmp_path_factory):
    """The folder of a plan of one flight, and that flight's record."""
    folder, limits = tmp_path_factory.mktemp("field"), {"q": 2.5, "theta": 0.6}
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    found = design("xcell60", LONGITUDINAL, 1, limits, [LARGE])
    flyable.write(folder, "xcell60", LONGITUDINAL, found, limits, [LARGE])
    return folder, LARGE.fly(heli, LONGITUDINAL, autopilot_for(heli), 0)


def parameters(path):
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return {name: float(value) for name, value in (line.split(",") for line in lines)}


def test_parameters_are_those_of_the_sweep_in_the_table_beside_them(field):
    """Where the mode would refuse or clip a value, the file must not hold it: the ranges are those
    of ArduPilot's documentation.
    """
    folder, _ = field
    paths = sorted(folder.glob("sweep-*.param"))
    assert len(paths) == 6  # two inputs at three airspeeds
    for path in paths:
        given = parameters(path)
        assert given["SID_AXIS"] == {"lon": 11, "col": 13}[path.stem[-3:]]
        assert 0 < given["SID_MAGNITUDE"] <= 1
        assert 0 <= given["SID_T_FADE_IN"] <= 20
        assert 0 <= given["SID_T_FADE_OUT"] <= 5
        assert 2 / given["SID_F_START_HZ"] < given["SID_T_REC"] <= 255
        (table,) = folder.glob(f"{path.stem.rpartition('-')[0]}.csv")
        record = symheli.FlightRecord.from_csv(table)
        name = f"e_d_{path.stem[-3:]}_of_travel"
        # the table has the sweep of the first input first: its largest value is the magnitude
        assert np.abs(record[name]).max() == pytest.approx(given["SID_MAGNITUDE"], rel=0.01)


def test_a_sweep_begins_with_two_cycles_and_ends_at_the_high_frequency():
    """By its zero crossings; between, each period is shorter than the last."""
    time = np.arange(0.0, 80.0, 0.001)
    made = symheli.Excitation({"d_lon": 1.0, "d_lat": 1.0}, "sweep", (0.2, 5.0), period=40.0)(time)
    lon, lat = made["d_lon"], made["d_lat"]
    np.testing.assert_allclose(lat[40_000:], lon[:40_000], atol=1e-9)  # one after the other
    assert not lat[:40_000].any()
    up = time[1:][(lon[:-1] < 0) & (lon[1:] >= 0) & (time[1:] < 39.9)]
    assert up[:2] == pytest.approx([5.0, 10.0], abs=0.01)
    lengths = np.diff(up[1:])
    assert all(b < a + 2e-3 for a, b in pairwise(lengths))  # of 1 ms steps
    # the last whole cycle ends at most one cycle before the end, a little below 5 Hz
    assert lengths[-1] == pytest.approx(1 / 5.0, abs=0.01)
    assert np.abs(lon[4_000:38_000]).max() == pytest.approx(1.0, abs=1e-3)
    with pytest.raises(InputError, match="two cycles, 10 s, and must be longer"):
        symheli.Excitation({"d_lon": 1.0}, "sweep", (0.2, 5.0), period=10.0)


def test_the_table_of_a_flight_is_what_was_flown(field):
    folder, record = field
    (table,) = folder.glob("1-prbs*.csv")
    planned = symheli.FlightRecord.from_csv(table)
    n = min(len(planned), len(record))
    for name in ("e_d_lon", "e_d_col", "airspeed_command"):
        # six digits are written
        np.testing.assert_allclose(planned[name][:n], record[name][:n], rtol=1e-5, atol=1e-6)


def test_the_flight_as_planned_is_enough_and_a_part_of_it_is_not(field, tmp_path, capsys):
    folder, record = field
    whole, plan = record.save(tmp_path / "whole.npz"), folder / "plan.json"
    assert cli.main(["experiment", "--plan", str(plan), "--flown", str(whole)]) == 0
    told = capsys.readouterr().out
    assert told.startswith("this is enough\nstandard errors 1.00 times those planned")
    found = flyable.flown(plan, [record.split(0.4)[0]])
    assert not found.enough
    assert "s more of the same kind" in str(found)
    # the same twice: errors smaller by the root of two
    twice = flyable.flown(plan, [record, record])
    assert twice.median == pytest.approx(1 / np.sqrt(2), rel=1e-6)


def test_a_flight_that_stays_slow_is_not_enough_however_long(field):
    folder, record = field
    slow = record.rows(record["airspeed_command"] < 5.0)
    found = flyable.flown(folder / "plan.json", [slow] * 20)
    assert not found.enough
    assert found.part < 0.5
    assert "fly the airspeeds that are missing" in str(found)


def test_records_and_plans_that_do_not_fit_are_refused_in_words(field, tmp_path):
    folder, record = field
    plan = folder / "plan.json"
    with pytest.raises(InputError, match=r"the record lacks d_col; name the columns"):
        flyable.flown(plan, [record.select([s for s in record.signals if s != "d_col"])])
    with pytest.raises(InputError, match=r"steps of 0\.04 s, the plan of 0\.02 s"):
        flyable.flown(plan, [record.decimate(2)])
    for content in ("{}", "no json", plan.read_text().replace('"version": 1', '"version": 9')):
        (tmp_path / "bad.json").write_text(content)
        with pytest.raises(InputError, match=r"expected the plan\.json that symheli experiment"):
            flyable.flown(tmp_path / "bad.json", [record])


def test_the_player_writes_the_rows_of_a_table(field):
    folder, _ = field
    (table,) = folder.glob("1-prbs*.csv")
    short = folder / "short.csv"
    short.write_text("".join(f"{line}\n" for line in table.read_text().splitlines()[:20]))
    command = [sys.executable, str(folder / "play.py"), str(short), "1000"]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert said == short.read_text()
