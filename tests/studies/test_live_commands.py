"""symheli live and serve: from the command line to what is printed and written."""

import json

import numpy as np
import pytest

import symheli
from studies import cli
from symheli import FlightRecord


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A flight of half a minute with excitation, as a log of deflections."""
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    schedule = symheli.AirspeedSchedule((5.0, 1.0, 4.0), (2.0,) * 3, (6.0,) * 3, start=1.0)
    excitation = symheli.Excitation(dict.fromkeys(heli.inputs, 0.01), "multisine", (0.05, 4.0))
    record = symheli.fly(heli, schedule, excitation=excitation, noise_db=40.0)
    path = tmp_path_factory.mktemp("live") / "flight.csv"
    names = ("u", "v", "w", "p", "q", "r", "phi", "theta", "airspeed", *map(str, heli.inputs))
    record.select(names).to_csv(path)
    return path, len(record)


def test_a_record_that_comes_again_is_identified(log, tmp_path, capsys):
    path, samples = log
    words = ["live", str(path), "--speed", "1000", "--inputs", "d_lon,d_lat,d_col,d_ped"]
    words += ["--airspeeds", "0", "6", "--degree", "1", "--record", str(tmp_path / "again.csv")]
    words += ["--save", str(tmp_path / "model.json")]
    assert cli.main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["samples"] == samples
    assert found["states"] == {"GOOD": samples}
    assert found["learnt"] > 0.98 * samples
    powers = {p["output"]: p for p in found["control_power"]}
    assert set(powers) == {"p", "q", "r", "w"}
    again = FlightRecord.from_csv(tmp_path / "again.csv")
    np.testing.assert_array_equal(again["q"], FlightRecord.from_csv(path)["q"])
    from identification.model import KinematicModel

    assert KinematicModel.load(tmp_path / "model.json").dt == pytest.approx(0.02)


def test_a_reader_sees_tables(log, capsys):
    path, samples = log
    words = ["live", str(path), "--speed", "1000", "--inputs", "d_lon,d_lat,d_col,d_ped"]
    assert cli.main([*words, "--airspeeds", "0", "6", "--degree", "1"]) == 0
    out = capsys.readouterr().out
    assert f"{samples} samples from flight.csv: GOOD {samples}" in out
    assert "control power" in out
    assert "p by d_lat" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere.csv"], "sources are xplane, mavlink and a CSV file"),
        (["xplane:localhost:abc"], "expected xplane:HOST:PORT"),
        (["xplane", "--airspeeds", "5", "5"], "expected 0 <= LOW < HIGH"),
        (["xplane:127.0.0.1:9", "--duration", "0.2"], "nothing came from X-Plane at 127.0.0.1:9"),
    ],
)
def test_what_cannot_be_watched_is_said(words, message, capsys):
    assert cli.main(["live", *words]) == 1
    assert message in capsys.readouterr().err


def test_a_vehicle_serves_until_its_time_is_over(capsys):
    """At 50 times real time; nobody listens, which stops nothing."""
    words = ["serve", "--duration", "5", "--speed", "50", "--xplane", "0", "--noise"]
    assert cli.main([*words, "--airspeeds", "1", "3", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["flown"] >= 5.0
    assert found["samples"] == pytest.approx(found["flown"] / 0.02)
