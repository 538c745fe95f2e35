"""ULog, DataFlash and MATLAB 7.3 logs: written here from their specifications, real ones where
they lie beside the project.
"""

import warnings
from pathlib import Path

import numpy as np
import pytest
from autopilot_logs import BEFORE_2015, SDLOG2, dataflash, quaternions, ulog
from scipy.spatial.transform import Rotation

from symheli.errors import DataWarning, InputError, UnknownNameError
from symheli.logs.column import Column, on_one_axis
from symheli.logs.dataflash import dataflash_columns
from symheli.logs.format import format_of
from symheli.logs.mat import mat_columns
from symheli.logs.meaning import guesses
from symheli.logs.ulog import ulog_columns
from symheli.records import FlightRecord

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"


# --- one axis ------------------------------------------------------------------------------------


def test_columns_of_different_rates_meet_on_one_axis_and_silence_is_missing():
    fast = np.arange(0, 3, 0.004)
    slow = np.delete(np.arange(0, 3, 0.1), slice(12, 20)) + 0.04  # silent from 1.14 to 2.04 s
    time, got = on_one_axis({"a": Column(fast, fast), "b": Column(slow, 2 * slow)}, 0.02, "log")
    instants = time
    assert time[0] == 0.04  # the first common instant, on the log's clock
    np.testing.assert_allclose(got["a"], instants, atol=1e-12)
    silent = (instants > 1.141) & (instants < 2.039)
    np.testing.assert_allclose(got["b"][~silent], 2 * instants[~silent], atol=1e-12)
    assert np.isnan(got["b"][silent]).all()


def test_repeated_instants_and_steps_back_are_dropped():
    stamps = np.array([0.0, 0.1, 0.1, 0.05, 0.2, 0.3])
    _, got = on_one_axis({"a": Column(stamps, np.arange(6.0))}, 0.1, "log")
    np.testing.assert_allclose(got["a"], [0, 1, 4, 5])


def test_columns_that_never_overlap_are_named():
    early, late = (Column(start + np.arange(5.0), np.zeros(5)) for start in (0.0, 10.0))
    with pytest.raises(InputError, match=r"'late' starts at 10.000 s, 'early' ends at 4.000 s"):
        on_one_axis({"early": early, "late": late}, 0.5, "log")


def test_an_instant_far_away_is_behind_a_hole_in_which_no_samples_are_made():
    """A damaged clock must not cost memory: what lies between is never made."""
    wild = Column(np.array([0.0, 0.1, 0.2, 0.3, 1e12]), np.zeros(5))
    time, _ = on_one_axis({"a": wild}, 0.1, "log")
    assert time.tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3, 1e12])


def test_a_step_far_finer_than_the_log_is_refused_before_memory_runs_out():
    slow = Column(np.arange(0.0, 100.0, 4.0), np.zeros(25))
    with pytest.raises(InputError, match="dt is in seconds, or a clock of the log is damaged"):
        on_one_axis({"a": slow}, 1e-5, "log")


# --- PX4 -----------------------------------------------------------------------------------------

STAMPS = np.arange(0, 2_000_000, 10_000)
"""us."""


@pytest.fixture
def px4(tmp_path):
    """A flight of known attitude, two barometers."""
    pytest.importorskip("pyulog", reason="needs pyulog: pip install 'symheli[logs]'")
    t = 1e-6 * STAMPS
    angles = np.stack([0.3 * np.sin(t), 0.2 * np.cos(t), 2.5 + t], axis=1)  # psi passes pi
    xyzw = Rotation.from_euler("ZYX", angles[:, ::-1]).as_quat()
    attitude = quaternions({"q": xyzw[:, [3, 0, 1, 2]]})
    path = tmp_path / "flight.ulg"
    path.write_bytes(
        ulog(
            {
                ("vehicle_attitude", 0): {"timestamp": STAMPS, **attitude},
                ("sensor_baro", 0): {"timestamp": STAMPS[::5], "pressure": 1.0 + 0 * STAMPS[::5]},
                ("sensor_baro", 3): {"timestamp": STAMPS[::5], "pressure": 2.0 + 0 * STAMPS[::5]},
            }
        )
    )
    return path, angles


def test_a_quaternion_gives_euler_angles_and_the_heading_goes_on_past_pi(px4):
    path, angles = px4
    topics = {n: ("vehicle_attitude", n, "rad") for n in ("phi", "theta", "psi")}
    record = FlightRecord.from_ulog(path, topics, dt=0.01)
    np.testing.assert_allclose(  # the log has single precision
        record.columns(["phi", "theta", "psi"]), angles[: len(record)], atol=1e-6
    )


def test_every_instance_of_a_topic_is_reached_by_its_number(px4):
    path, _ = px4
    topics = {
        "first": ("sensor_baro", "pressure", "Pa"),
        "zero": ("sensor_baro.0", "pressure", "Pa"),
        "other": ("sensor_baro.3", "pressure", "Pa"),
    }
    record = FlightRecord.from_ulog(path, topics, dt=0.05)
    assert [float(record[name][0]) for name in topics] == [1.0, 1.0, 2.0]
    with pytest.raises(UnknownNameError, match=r"instance of sensor_baro '1'.*known: 0, 3"):
        FlightRecord.from_ulog(path, {"p": ("sensor_baro.1", "pressure", "Pa")}, dt=0.05)
    assert {"sensor_baro.pressure", "sensor_baro.3.pressure", "vehicle_attitude.theta"} <= set(
        ulog_columns(path)
    )


def test_a_signal_map_reads_an_instance_and_says_that_samples_are_interpolated(px4, tmp_path):
    path, _ = px4
    signal_map = tmp_path / "m.toml"
    signal_map.write_text(
        'dt = 0.05\n[signals]\nstatic = { column = "sensor_baro.3.pressure", unit = "Pa" }\n'
    )
    record = FlightRecord.from_map(path, signal_map)
    assert (record["static"] == 2.0).all()
    assert record.resampled == "columns interpolated to 0.05 s"


def cut(path, tmp_path, read, pieces=40):
    """Read what is left of a log that ends anywhere: the lengths of the records that came out."""
    whole, lengths = path.read_bytes(), []
    for end in np.linspace(1, len(whole) - 1, pieces).astype(int):
        part = tmp_path / f"cut{path.suffix}"
        part.write_bytes(whole[:end])
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DataWarning)
                lengths.append(len(read(part)))
        except InputError:
            continue
    return lengths


def test_a_ulog_that_ends_anywhere_is_read_so_far_or_refused(px4, tmp_path):
    path, _ = px4

    def read(log):
        return FlightRecord.from_ulog(log, {"t": ("vehicle_attitude", "theta", "rad")}, dt=0.05)

    lengths = cut(path, tmp_path, read)
    assert lengths == sorted(lengths)
    assert 0 < lengths[-1] <= len(read(path))
    for content in (b"ULog\x01\x12\x35\x01" + bytes(8), b"ULog", b"no log at all"):
        (tmp_path / "bad.ulg").write_bytes(content)
        with pytest.raises(InputError, match=r"bad\.ulg"):
            read(tmp_path / "bad.ulg")


# --- ArduPilot -----------------------------------------------------------------------------------


@pytest.fixture(params=["binary", "text"])
def ardupilot(request, tmp_path):
    """Two gyros at 50 Hz, attitude at 10 Hz, a heading that passes north."""
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    rows = [("GPS", (1_000_000, 3, 1000, 2000))]  # by which readers set their clock
    for k in range(200):
        stamp = 1_000_000 + 20_000 * k
        rows += [("IMU", (stamp, 0, 0.001 * k, 20.0)), ("IMU", (stamp, 1, 1.0, 20.0))]
        if k % 5 == 0:
            rows += [("ATT", (stamp, 10 * k, (35000 + 20 * k) % 36000)), ("RATE", (stamp, 150))]

    def write(name="flight", **options):
        text = request.param == "text"
        path = tmp_path / f"{name}.{'log' if text else 'bin'}"
        path.write_bytes(dataflash(rows, text=text, **options))
        return path

    return write


def test_units_are_those_of_the_log_and_headings_go_on_past_north(ardupilot):
    log = ardupilot()
    assert format_of(log) == "dataflash"
    fields = {"q": "IMU.GyrY", "q2": "IMU[1].GyrY", "theta": "ATT.Pitch", "psi": "ATT.Yaw"}
    record = FlightRecord.from_dataflash(log, {**fields, "v": "RATE.POut"}, dt=0.02)
    assert [s.unit for s in record.signals] == ["rad/s", "rad/s", "rad", "rad", "m/s"]
    assert record.resampled == "messages interpolated to 0.02 s"
    k = (record.time - 1.0) / 0.02
    np.testing.assert_allclose(record["q"], 0.001 * k, atol=1e-7)
    np.testing.assert_array_equal(record["q2"], 1.0)
    np.testing.assert_allclose(record["theta"], np.radians(0.1 * k), atol=1e-9)
    np.testing.assert_allclose(record["psi"], np.radians(350 + 0.2 * k), atol=1e-9)
    np.testing.assert_allclose(record["v"], 1.5)  # 150 of 1/100 m/s: the log's multiplier


def test_a_unit_the_log_does_not_say_is_asked_for_and_one_it_says_cannot_be_contradicted(ardupilot):
    log = ardupilot(units=False)
    with pytest.raises(InputError, match=r"does not declare the unit of ATT\.Pitch; give it"):
        FlightRecord.from_dataflash(log, {"theta": "ATT.Pitch"}, dt=0.1)
    record = FlightRecord.from_dataflash(log, {"theta": "ATT.Pitch"}, 0.1, {"theta": "deg"})
    assert record["theta"][1] == pytest.approx(np.radians(0.5))
    with pytest.raises(InputError, match=r"the log says that ATT\.Pitch is in deg, not rad"):
        FlightRecord.from_dataflash(ardupilot(), {"theta": "ATT.Pitch"}, 0.1, {"theta": "rad"})


@pytest.mark.parametrize(
    ("field", "message"),
    [
        ("ATT.Ptch", "unknown field of ATT that holds numbers 'Ptch'; did you mean 'Pitch'"),
        ("ATTI.Pitch", r"unknown message .* 'ATTI'; did you mean 'ATT'"),
        ("IMU[7].GyrY", "unknown instance of IMU '7'"),
        ("Pitch", '"message.field"'),
    ],
)
def test_a_misspelt_field_gets_the_nearest(ardupilot, field, message):
    with pytest.raises(InputError, match=message):
        FlightRecord.from_dataflash(ardupilot(), {"theta": field}, dt=0.1)


@pytest.mark.slow(but="binary")
def test_a_signal_map_names_messages_and_needs_no_units(ardupilot, tmp_path):
    signal_map = tmp_path / "m.toml"
    signal_map.write_text(
        'dt = 0.1\n[signals]\ntheta = { column = "ATT.Pitch", scale = -1 }\n'
        'q2 = { column = "IMU[1].GyrY", unit = "rad/s" }\n'
    )
    record = FlightRecord.from_map(ardupilot(), signal_map)
    np.testing.assert_allclose(record["theta"], -np.radians(5 * (record.time - 1.0)), atol=1e-9)
    np.testing.assert_array_equal(record["q2"], 1.0)


@pytest.mark.slow(but="binary")
def test_an_ardupilot_log_that_ends_anywhere_is_read_so_far_or_refused(ardupilot, tmp_path):
    path = ardupilot()

    def read(log):
        return FlightRecord.from_dataflash(log, {"q": "IMU.GyrY"}, dt=0.02)

    lengths = cut(path, tmp_path, read)
    assert lengths == sorted(lengths)
    assert 0 < lengths[-1] <= len(read(path))


@pytest.mark.parametrize("ardupilot", ["binary"], indirect=True)
def test_damage_in_the_middle_is_said_and_what_is_around_it_is_read(ardupilot, capfd):
    path = ardupilot()
    content = bytearray(path.read_bytes())
    content[4000:4200] = bytes(200)
    path.write_bytes(content)
    with pytest.warns(DataWarning, match="parts of the log are damaged"):
        record = FlightRecord.from_dataflash(path, {"q": "IMU.GyrY"}, dt=0.02)
    np.testing.assert_allclose(record["q"][-1], 0.001 * 199, atol=1e-6)
    assert capfd.readouterr() == ("", "")


def test_messages_without_time_cannot_be_placed(tmp_path):
    """As logs were before 2014."""
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    path = tmp_path / "old.log"
    head = "ArduCopter V3.0.1\nFMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format\n"
    formats = "FMT, 130, 35, GPS, BIc, Status,Time,Alt\nFMT, 1, 17, ATT, cc, Roll,Pitch\n"
    path.write_text(head + formats + "GPS, 3, 308900200, 9.48\nATT, 0.23, 0.75\n" * 50)
    with pytest.raises(InputError, match=r"ATT carries no time \(logs from before 2014\)"):
        FlightRecord.from_dataflash(path, {"theta": "ATT.Pitch"}, 0.1, {"theta": "deg"})


def test_what_is_no_ardupilot_log_is_refused(tmp_path):
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    path = tmp_path / "bad.bin"
    for content in (b"\xa3\x95", b"\xa3\x95\x80", b"\xa3\x95" + bytes(600), b"hello\n" * 50):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"bad\.bin"):
            FlightRecord.from_dataflash(path, {"q": "IMU.GyrY"}, dt=0.02)


# --- MATLAB 7.3 ----------------------------------------------------------------------------------


@pytest.fixture
def mat73(tmp_path):
    """As save -v7.3 writes it: 512 bytes of MATLAB's before HDF5, columns first, classes as
    attributes.
    """
    h5py = pytest.importorskip("h5py", reason="needs h5py: pip install 'symheli[logs]'")
    path = tmp_path / "log.mat"
    with h5py.File(path, "w", userblock_size=512) as file:

        def put(group, name, values, kind="double"):
            group.create_dataset(name, data=np.atleast_2d(values)).attrs["MATLAB_class"] = (
                np.bytes_(kind)
            )

        put(file, "t", np.arange(4.0))
        struct = file.create_group("log")
        struct.attrs["MATLAB_class"] = np.bytes_("struct")
        put(struct, "theta", np.full((1, 4), 180.0))
        put(struct, "name", np.frombuffer("T-REX".encode("utf-16-le"), np.uint16), "char")
        put(struct, "M", np.eye(3))
        put(struct, "on", np.ones(4, np.uint8), "logical")
        file.create_group("#refs#")
    content = bytearray(path.read_bytes())
    content[:116] = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116)
    path.write_bytes(content)
    return path


def test_a_mat_file_of_either_kind_is_read_by_one_name(mat73):
    record = FlightRecord.from_mat(mat73, time="t", units={"log.theta": "deg", "log.on": "1"})
    np.testing.assert_allclose(record["log.theta"], np.pi)
    np.testing.assert_array_equal(record["log.on"], 1.0)
    assert set(mat_columns(mat73)) == {"t", "log.theta", "log.on"}
    with pytest.raises(UnknownNameError, match=r"unknown variable 'log\.thta'"):
        FlightRecord.from_mat(mat73, time="t", units={"log.thta": "deg"})
    for name, message in (("log.name", "does not hold numbers"), ("log.M", "to be a vector")):
        with pytest.raises(InputError, match=message):
            FlightRecord.from_mat(mat73, time="t", units={name: "1"})


def test_a_mat_file_that_ends_anywhere_is_refused(mat73, tmp_path):
    def read(log):
        return FlightRecord.from_mat(log, time="t", units={"log.theta": "deg"})

    assert cut(mat73, tmp_path, read, 60) == []


def test_without_h5py_the_message_names_the_extra(mat73, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(InputError, match=r"needs h5py: pip install 'symheli\[logs\]'"):
        FlightRecord.from_mat(mat73, time="t", units={"log.theta": "deg"})


# --- real logs -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "read"),
    [
        (
            "px4/sample.ulg",  # of github.com/PX4/pyulog, BSD licence
            lambda log: FlightRecord.from_ulog(
                log,
                {
                    "p": ("vehicle_attitude", "rollspeed", "rad/s"),
                    "phi": ("vehicle_attitude", "phi", "rad"),
                },
                dt=0.02,
            ),
        ),
        (
            "ardupilot/sample.bin",  # of github.com/BeastAyyG/ardupilot-log-diagnosis
            lambda log: FlightRecord.from_dataflash(
                log, {"p": "IMU.GyrX", "phi": "ATT.Roll"}, dt=0.1
            ),
        ),
    ],
)
def test_in_a_real_log_the_roll_angle_follows_the_roll_rate(name, read):
    """Units, clocks and quaternions at once: with level wings d(phi)/dt is p."""
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{path} is not here")
    record = read(path)
    slope = record.derivative("phi")
    known = np.isfinite(slope) & np.isfinite(record["p"])
    assert np.corrcoef(slope[known], record["p"][known])[0, 1] > 0.9
    # the attitude of ArduPilot is logged at 10 Hz: differences over 0.2 s are somewhat low
    assert np.polyfit(slope[known], record["p"][known], 1)[0] == pytest.approx(1.0, abs=0.1)


# --- what a file is ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("head", "kind"),
    [
        (b"MATLAB 5.0 MAT-file", "mat"),
        (bytes(512) + b"\x89HDF\r\n\x1a\n", "mat"),
        (b"ULog\x01\x12\x35", "ulog"),
        (b"\xa3\x95\x80\x80", "dataflash"),
        (b"58\n\nArduCopter V3.0.1\nFMT, 128, 89, FMT, BBnNZ, Type\n", "dataflash"),
        (b"\n ____Q,rad/s | pitch,__deg | \n", "xplane"),
        (b"t,q\n0,1\n", "csv"),
    ],
)
def test_the_first_bytes_say_what_a_log_is(tmp_path, head, kind):
    path = tmp_path / "any.name"
    path.write_bytes(head)
    assert format_of(path) == kind


def test_dataflash_columns_are_named_with_the_instance_where_there_are_two(ardupilot):
    columns = dataflash_columns(ardupilot())
    assert {"IMU.GyrY", "IMU[1].GyrY", "ATT.Pitch"} <= set(columns)
    assert (columns["IMU.T"].unit, columns["ATT.Yaw"].unit) == (None, "deg")


@pytest.mark.parametrize("text", [False, True])
def test_the_time_of_a_batch_is_that_of_the_message_before_it(tmp_path, text):
    """sdlog2: no message has a time but TIME, which stands before those of its instant."""
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    t = 3.0 + 0.02 * np.arange(200)
    rows = [("ATTC", (9.0, 9.0, 9.0, 9.0))]  # before any time: of no use
    for now in t:
        rows += [
            ("TIME", (round(1e6 * now),)),
            ("ATT", (0.1 * now, 0.2 * now, 0.3 * now, 0.1, 0.2, 0.3)),
            ("ATTC", (now, 2 * now, 3 * now, 4 * now)),
        ]
    path = tmp_path / "flight.px4log"
    path.write_bytes(dataflash(rows, text=text, formats=SDLOG2))
    columns = dataflash_columns(path)
    np.testing.assert_allclose(columns["ATT.Pitch"].time, t, atol=1e-6)
    np.testing.assert_allclose(columns["ATTC.Pitch"].values, 2 * t, rtol=1e-6)
    assert not [name for name in columns if name.startswith("TIME.")]
    record = FlightRecord.from_dataflash(
        path,
        {"theta": "ATT.Pitch", "lon": "ATTC.Pitch"},
        0.02,
        {"theta": "rad", "lon": "1"},
    )
    np.testing.assert_allclose(record["theta"], 0.1 * record["lon"], rtol=1e-5)
    found = guesses(columns, "dataflash")
    assert (found["q"].column, found["q"].unit) == ("ATT.PitchRate", "rad/s")
    assert (found["theta"].unit, found["lon"].column) == ("rad", "ATTC.Pitch")


def old_arducopter(path, n=400):
    """Airspeed from a GPS whose TimeMS counts from the beginning of the week; yaw through north."""
    rows = []
    for k in range(n):
        now = 60_000 + 20 * k
        yaw = (350.0 + 0.1 * k) % 360.0
        rows.append(("IMU", (now, 0.0, 0.3 * np.sin(0.1 * k), 0.0)))
        if k % 5 == 0:
            rows.append(("ATT", (now, round(100 * np.sin(0.03 * k)), round(100 * yaw))))
            rows.append(("RATE", (now, float(np.cos(0.2 * k)))))
            rows.append(("GPS", (3, 604_091_000 + 20 * k, 5.0 + 0.01 * k, now)))
    path.write_bytes(dataflash(rows, formats=BEFORE_2015))
    return path


def test_the_clock_of_an_old_gps_is_the_autopilots_not_that_of_the_week(tmp_path):
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    path = old_arducopter(tmp_path / "log171.bin")
    columns = dataflash_columns(path)
    assert columns["GPS.Spd"].time[0] == columns["IMU.GyrY"].time[0] == 60.0
    assert "GPS.T" not in columns
    record = FlightRecord.from_dataflash(
        path,
        {"q": "IMU.GyrY", "airspeed": "GPS.Spd", "psi": "ATT.Yaw"},
        0.02,
        {"q": "rad/s", "airspeed": "m/s", "psi": "deg"},
    )
    np.testing.assert_allclose(record["airspeed"], 5.0 + 0.01 * np.arange(len(record)), atol=1e-5)
    # through north the heading goes on: nothing is interpolated between 359 and 1 degrees
    np.testing.assert_allclose(np.degrees(np.diff(record["psi"])), 0.1, atol=1e-9)


def test_the_gyro_of_a_sensor_is_guessed_where_nothing_better_is_logged(tmp_path):
    pytest.importorskip("pyulog", reason="needs pyulog: pip install 'symheli[logs]'")
    t = 1e-6 * STAMPS
    gyro = {axis: np.sin(t + i) for i, axis in enumerate("xyz")}
    path = tmp_path / "log1.ulg"
    path.write_bytes(ulog({("sensor_gyro", 0): {"timestamp": STAMPS, **gyro}}))
    found = guesses(ulog_columns(path), "ulog")
    assert [found[s].column for s in "pqr"] == [f"sensor_gyro.{axis}" for axis in "xyz"]
    assert {found[s].unit for s in "pqr"} == {"rad/s"}
