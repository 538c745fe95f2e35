"""What a record says of the vehicle and the air it was flown in."""

from dataclasses import replace

import pytest

import symheli
from identification.model.flown_in import flown_in, sentence
from symheli import FlightRecord, Helicopter
from symheli.flight import XCELL_SERVOS

SLOW = symheli.AirspeedSchedule.transition(4.0, 4.5, acceleration=1.0, hold=0.2)


@pytest.fixture(scope="module")
def record():
    heli = Helicopter.load("xcell60").with_parameters({"body.mass": 9.0})
    return symheli.fly(
        heli, SLOW, wind=(-2.0, 0.0, 0.0), servos=XCELL_SERVOS, delay=0.02, noise_db=40.0
    )


def test_a_flight_says_wind_mass_governor_and_servos(record, tmp_path):
    said = record.meta["flown"]
    assert said["wind"] == "(-2, 0, 0) m/s north east down"
    assert (said["mass"], said["governor"]) == ("9 kg", "pi")
    assert "d_lat 36 rad/s" in said["servos"]
    assert said["servos"].endswith("20 ms late")
    record.save(tmp_path / "flight.npz")
    assert FlightRecord.load(tmp_path / "flight.npz").meta["flown"] == said


def test_what_nobody_said_is_unknown_and_what_differs_is_listed(record):
    silent = replace(record, meta={})
    assert set(flown_in([silent]).values()) == {"unknown"}
    other = replace(record, meta={"flown": {**record.meta["flown"], "mass": "8.2 kg"}})
    both = flown_in([record, other, record])
    assert both["mass"] == "9 kg; 8.2 kg"
    assert both["governor"] == "pi"
    details = {"flown_in": both, "wind": {"north": (-1.9, 0.1), "east": (0.2, 0.1)}}
    assert "estimated: north -1.9 +- 0.1" in sentence([details])
