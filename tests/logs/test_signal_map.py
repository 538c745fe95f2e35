"""A log read by a map that says which column is which signal."""

import numpy as np
import pytest
from scipy.io import savemat

from symheli import FlightRecord
from symheli.errors import InputError, UnknownNameError

MAP = """
time = "stamp"
time_unit = "ms"
[signals]
q = { column = "gyro y", unit = "deg/s", scale = -1 }
airspeed = { column = "pitot", unit = "km/h", offset = 3.6 }
"""


def files(tmp_path, mapping=MAP):
    log, signal_map = tmp_path / "flight.csv", tmp_path / "aircraft.toml"
    log.write_text("stamp,gyro y,pitot\n" + "".join(f"{20 * k},{k},{36 + k}\n" for k in range(50)))
    signal_map.write_text(mapping)
    return log, signal_map


def test_signals_come_in_si_by_the_names_of_the_map(tmp_path):
    record = FlightRecord.from_map(*files(tmp_path))
    np.testing.assert_allclose(record.time, 0.02 * np.arange(50))
    np.testing.assert_allclose(record["q"], -np.radians(np.arange(50)), atol=1e-15)
    np.testing.assert_allclose(record["airspeed"], 10 + np.arange(50) / 3.6 + 1.0)
    assert [s.unit for s in record.signals] == ["rad/s", "m/s"]


def test_dt_resamples_and_a_table_without_time_takes_it_as_its_step(tmp_path):
    log, _ = files(tmp_path)
    for head, n in (('time = "stamp"\ntime_unit = "ms"\ndt = 0.1\n', 10), ("dt = 0.1\n", 50)):
        (tmp_path / "m.toml").write_text(
            head + '[signals]\nq = { column = "gyro y", unit = "deg/s" }\n'
        )
        record = FlightRecord.from_map(log, tmp_path / "m.toml")
        assert (len(record), record.dt) == (n, pytest.approx(0.1))


def test_matlab_structs_are_reached_into(tmp_path):
    savemat(tmp_path / "flight.mat", {"log": {"t": np.arange(5.0), "th": np.arange(5.0)}})
    (tmp_path / "m.toml").write_text(
        'time = "log.t"\n[signals]\ntheta = { column = "log.th", unit = "deg" }\n'
    )
    record = FlightRecord.from_map(tmp_path / "flight.mat", tmp_path / "m.toml")
    np.testing.assert_allclose(record["theta"], np.radians(np.arange(5.0)))


@pytest.mark.parametrize(
    ("mapping", "error", "message"),
    [
        ("[signals]\nq = 3\n", InputError, r"signals.q: expected \{ column"),
        ('sginals = 1\n[signals]\nq = { column = "a", unit = "1" }\n', UnknownNameError, "sginals"),
        ('[signals]\nq = { column = "a", unit = "degs" }\n', UnknownNameError, "degs"),
        ('[signals]\nq = { column = "a", unit = "1", scale = 0 }\n', InputError, "scale must be"),
        ('format = "hdf"\n[signals]\nq = { column = "a" }\n', UnknownNameError, "hdf"),
        ("time = 'stamp'\n", InputError, r"a \[signals\] table is needed"),
        ("= 3", InputError, "not valid TOML"),
        ('dt = -1\n[signals]\nq = { column = "a" }\n', InputError, "dt must be a positive"),
        (
            'time = "stamp"\n[signals]\nq = { column = "gyro_y", unit = "1" }\n',
            UnknownNameError,
            "gyro y",
        ),
    ],
)
def test_a_wrong_map_is_refused_with_the_reason(tmp_path, mapping, error, message):
    log, signal_map = files(tmp_path, mapping)
    with pytest.raises(error, match=message):
        FlightRecord.from_map(log, signal_map)


def test_a_ulog_needs_a_step_and_topics(tmp_path):
    (tmp_path / "flight.ulg").write_bytes(b"ULog")
    (tmp_path / "m.toml").write_text('[signals]\nq = { column = "rates", unit = "rad/s" }\n')
    with pytest.raises(InputError, match="give dt"):
        FlightRecord.from_map(tmp_path / "flight.ulg", tmp_path / "m.toml")
    (tmp_path / "m.toml").write_text(
        'dt = 0.02\n[signals]\nq = { column = "rates", unit = "rad/s" }\n'
    )
    with pytest.raises(InputError, match=r"topic\.field"):
        FlightRecord.from_map(tmp_path / "flight.ulg", tmp_path / "m.toml")
