"""The published log of a simulated helicopter: one flight in three formats, and its truth."""

import json

import numpy as np
import pytest

import symheli
from evidence import simulated_log
from evidence.tuning import parameters
from symheli import AirspeedSchedule, FlightRecord, Helicopter
from symheli.logs.format import contents_of
from symheli.logs.meaning import guesses
from symheli.logs.parameters import read_parameters

SHORT = AirspeedSchedule((2.0, 0.0), (2.0, 2.0), (1.0, 1.0), lead=0.5)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("simulated")
    files = simulated_log.written(folder, schedule=SHORT)
    assert all(file.is_file() for file in files)
    return folder


@pytest.fixture(scope="module")
def flown(folder):
    return FlightRecord.from_csv(folder / "flight.csv")


FORMATS = [("flight.bin", "dataflash.toml", "pymavlink"), ("flight.ulg", "ulog.toml", "pyulog")]


@pytest.mark.parametrize(("log", "columns", "needs"), FORMATS)
def test_a_log_is_read_back_to_its_rounding(folder, flown, log, columns, needs):
    """Four bytes a number; angles of a ULog out of a quaternion, 1 ulp of 1 each. The airspeed is
    interpolated between every fifth sample.
    """
    pytest.importorskip(needs)
    record = FlightRecord.from_map(folder / log, folder / columns)
    n = len(record)
    assert n > len(flown) - simulated_log.SLOWER
    assert record.time[0] == pytest.approx(simulated_log.START)
    for signal in simulated_log.LOGGED[:-1]:
        np.testing.assert_allclose(record[signal], flown[signal][:n], rtol=1e-6, atol=3e-7)
    every = slice(0, n, simulated_log.SLOWER)
    np.testing.assert_allclose(record["airspeed"][every], flown["airspeed"][every], rtol=1e-6)


@pytest.mark.parametrize(("log", "_", "needs"), FORMATS)
def test_what_a_survey_takes_its_columns_for_is_what_they_are(folder, flown, log, _, needs):
    pytest.importorskip(needs)
    contents = contents_of(folder / log)
    found = guesses(contents.columns, contents.format)
    for guess, signal in {"p": "p", "theta": "theta", "lon": "d_lon", "ped": "d_ped"}.items():
        values = contents.columns[found[guess].column].values
        assert np.corrcoef(values, flown[signal])[0, 1] > 0.999999
    assert {"q", "r", "phi", "airspeed", "lat", "col"} <= set(found)


def test_the_parameters_stand_in_the_log_and_beside_it(folder):
    assert read_parameters(folder / "heli.param") == parameters()
    pytest.importorskip("pymavlink")
    logged = read_parameters(folder / "flight.bin")
    assert logged == {k: pytest.approx(v, rel=1e-7) for k, v in parameters().items()}  # 4 bytes


def test_the_truth_is_that_of_the_vehicle_file_beside_it(folder):
    truth = json.loads((folder / "truth.json").read_text())
    heli = Helicopter.load(folder / truth["vehicle"], governor="ideal")
    assert truth["states"] == [str(s) for s in heli.states]
    assert [m["airspeed"] for m in truth["models"]] == list(simulated_log.AIRSPEEDS)
    for model in truth["models"]:
        exact = symheli.linearize(heli, symheli.trim(heli, airspeed=model["airspeed"]))
        # the file has the values of the packaged one: trims agree to their tolerance
        np.testing.assert_allclose(model["A"], exact.A, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(model["B"], exact.B, rtol=1e-7, atol=1e-9)


def test_wind_and_noise_are_in_the_log(folder, flown):
    """At hover in the air the wind carries it along; velocities differ from sample to sample by
    their noise.
    """
    assert flown["u"][:20].mean() == pytest.approx(simulated_log.WIND[0], abs=0.5)
    # a second difference leaves white noise; of 280 samples, 4 %, and what gusts add
    steps = np.diff(flown["u"], 2) / np.sqrt(6)
    assert steps.std() == pytest.approx(simulated_log.NOISE["u"], rel=0.3)
