"""Logs in, SI out; what cannot be read says why."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from symheli.errors import DataWarning, InputError, UnknownNameError
from symheli.logs.xplane import body_velocity
from symheli.records import FlightRecord

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
HEADER = (
    "   Vtrue,_ktas |   ____Q,rad/s |   pitch,__deg |   _roll,__deg |   hding,_true |   ___vX,__m/s"
    " |   ___vY,__m/s |   ___vZ,__m/s | "
)


def real(name):
    """A real log beside the project; the test is skipped where it is not there."""
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{path} is not here")
    return path


def write(tmp_path, *lines, name="Data.txt"):
    path = tmp_path / name
    path.write_text("\n".join(lines))
    return path


def row(*values):
    return " | ".join(f"{v:12.5f}" for v in values) + " | "


# --- X-Plane -------------------------------------------------------------------------------------


def test_commas_that_a_spreadsheet_left_beside_the_bars_are_no_part_of_numbers(tmp_path):
    path = write(
        tmp_path,
        "Vtrue,_ktas ,|_elev,yoke1 ,|____Q,rad/s ,|pitch,__deg ,|,",
        *(f"{v:.5f},|0.10000,|-0.02,|-184.87347,|," for v in range(1, 9)),
        name="Forward.csv",
    )
    record = FlightRecord.from_xplane(path, dt=0.1)
    np.testing.assert_allclose(record["airspeed"], np.arange(1, 9) * 1852 / 3600)
    np.testing.assert_allclose(record["theta"], np.radians(-184.87347))


@pytest.mark.parametrize(("name", "lengths"), [("Forward.txt", [4, 935]), ("Data.txt", [602])])
def test_a_real_xplane_log_splits_at_its_headers_and_comes_out_in_si(name, lengths):
    path = real(f"xplane/{name}")
    record = FlightRecord.from_xplane(path, dt=0.1)
    assert [s.stop - s.start for s in record.segments()] == lengths
    assert {"u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "airspeed", "stick_lon"} <= set(
        record.signals
    )
    # attitudes in rad and speeds in m/s of a flying helicopter
    assert np.abs(record["theta"]).max() < 1.6
    assert 10 < record["airspeed"].max() < 40
    with pytest.raises(InputError, match=r"dX against vX.* suggest dt = 0\.(09[5-9]|10[0-3])"):
        FlightRecord.from_xplane(path)


def test_pitch_rate_and_pitch_of_a_real_log_agree_on_the_sample_period():
    record = FlightRecord.from_xplane(real("xplane/Forward.txt"), dt=0.1)
    inside = record.segments()[1]
    slope = np.polyfit(record.derivative("theta")[inside], record["q"][inside], 1)[0]
    assert slope == pytest.approx(
        1.0, abs=0.05
    )  # wings level on this flight; the step jitters by 10 % about 0.1 s


def test_body_velocity_is_the_published_rotation():
    rng = np.random.default_rng(0)
    earth, (phi, theta, psi) = rng.normal(size=3), rng.uniform(-1, 1, 3)
    expected = Rotation.from_euler("ZYX", [psi, theta, phi]).inv().apply(earth)
    np.testing.assert_allclose(body_velocity(*earth, phi, theta, psi), expected, atol=1e-14)


def test_nose_east_and_flying_east_is_forward_speed_in_metres_per_second(tmp_path):
    path = write(tmp_path, "", HEADER, *[row(10, 0.1, 0, 0, 90, 5, 0, 0)] * 3)
    record = FlightRecord.from_xplane(path, dt=0.1)
    np.testing.assert_allclose(record["u"], 5.0, atol=1e-12)
    np.testing.assert_allclose(record["v"], 0.0, atol=1e-12)
    np.testing.assert_allclose(record["airspeed"], 10 * 1852 / 3600)
    assert record.signals[record.signals.index("psi")].unit == "rad"


def test_sessions_with_other_columns_keep_their_own_and_the_cut_row_goes(tmp_path):
    other = "   ____Q,rad/s |   thro1,_part |   thro1,_part | "
    path = write(
        tmp_path,
        HEADER,
        *[row(10, 0.1, 0, 0, 90, 5, 0, 0)] * 4,
        "",
        HEADER,
        "",
        other,
        *[row(0.2, 0.5, 0.6)] * 5,
        row(0.2, 0.5)[:-3],
    )
    record = FlightRecord.from_xplane(path, dt=0.1)
    assert [s.stop - s.start for s in record.segments()] == [4, 5]
    assert np.isnan(record["u"][4:]).all()
    assert np.isnan(record["throttle"][:4]).all()
    np.testing.assert_allclose(record["throttle"][4:], 0.5)
    np.testing.assert_allclose(record["throttle_actual"][4:], 0.6)
    np.testing.assert_allclose(record["q"], [0.1] * 4 + [0.2] * 5)


def test_the_clock_of_a_log_is_used_where_it_has_one_and_degrees_a_second_are_converted(tmp_path):
    header = "   _totl,_time |   ____Q,deg/s | "
    path = write(tmp_path, header, *[row(t, 180.0) for t in (7.0, 7.1, 7.2, 7.2, 7.3)])
    record = FlightRecord.from_xplane(path)
    np.testing.assert_allclose(
        record.time, [0, 0.1, 0.2, 0.3], atol=1e-9
    )  # the repeated instant is dropped
    np.testing.assert_allclose(record["q"], np.pi)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"\x00\x01\x02|,", "binary"),
        (b"hello\nworld\n", "not an X-Plane log"),
        (row(1, 2).encode(), "not an X-Plane log"),
        (HEADER.encode(), "no complete row"),
        ((HEADER + "\n" + row(1, 2) + "\n" + row(*range(8))).encode(), "line 2: expected 8 fields"),
        (
            (HEADER + "\n" + row(*range(8)).replace("3.0", "x.0")).encode(),
            "line 2: expected numbers",
        ),
    ],
)
def test_a_spoilt_xplane_log_says_what_is_wrong(tmp_path, content, message):
    path = tmp_path / "Data.txt"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        FlightRecord.from_xplane(path, dt=0.1)


# --- CSV -----------------------------------------------------------------------------------------


def test_csv_columns_come_in_their_units_and_empty_cells_are_missing(tmp_path):
    path = write(tmp_path, "t_ms,theta,junk", "0,90,a", "10,,b", "20,45,c")
    record = FlightRecord.from_csv(path, time="t_ms", units={"theta": "deg"}, time_unit="ms")
    np.testing.assert_allclose(record.time, [0, 0.01, 0.02])
    np.testing.assert_allclose(record["theta"], [np.pi / 2, np.nan, np.pi / 4])


def test_the_real_trex_flight_is_read_without_a_time_column():
    path = real("trex550/trex550_flight_clean.csv")
    record = FlightRecord.from_csv(
        path, time=None, units={"q_radps": "rad/s", "theta_rad": "rad", "u_mps": "m/s"}, dt=0.0084
    )
    assert len(record) == 13622
    assert record.dt == pytest.approx(0.0084)
    assert np.isfinite(record.values).all()


SAME = {
    "commas": ["t,q,note", "0,1.5,a", "0.1,,b", "0.2,-2e-1,c"],
    "blanks about names": [" t , q\t,note  ", "0 , 1.5,a", " 0.1,,b", "0.2,  -2e-1 ,c"],
    "semicolons": ["t;q;note", "0;1.5;a", "0.1;;b", "0.2;-2e-1;c"],
    "decimal commas": ["t;q;note", "0;1,5;a", "0,1;;b", "0,2;-2e-1;c"],
    "tabs": ["t\tq\tnote", "0\t1.5\ta", "0.1\t\tb", "0.2\t-2e-1\tc"],
    "tabs, decimal commas": ["t\tq\tnote", "0\t1,5\ta", "0,1\tNaN\tb", "0,2\t-0,2\tc"],
    "blanks": ["  t   q  note", "  0  1.5  a", "0.1  nan b", "0.2 -0.2 c"],
    "comments": [
        "# logger 3.1, serial 7",
        "",
        "t,q,note",
        "# armed",
        "0,1.5,a",
        "0.1,null,b",
        "0.2,-0.2,c",
    ],
    "header in a comment": ["# logger 3.1", "# t q", "0 1.5", "0.1 nan", "0.2 -0.2"],
    "separator behind the last": ["t;q;", "0;1.5;", "0.1;;", "0.2;-0.2;"],
    "quotes": ['"t","q","note, by hand"', '0,1.5,"a, b"', "0.1,,b", "0.2,-2e-1,c"],
    "cut last row": ["t,q,note", "0,1.5,a", "0.1,,b", "0.2,-0.2"],
}


@pytest.mark.parametrize("kind", SAME)
def test_a_table_is_read_however_it_is_written_and_without_pandas(tmp_path, monkeypatch, kind):
    monkeypatch.setitem(sys.modules, "pandas", None)
    path = write(tmp_path, *SAME[kind], name="log.csv")
    for newline in ("\n", "\r\n"):
        path.write_bytes(newline.join(SAME[kind]).encode("utf-8-sig"))
        record = FlightRecord.from_csv(path, time="t", units={"q": "rad/s"})
        np.testing.assert_array_equal(record.time, [0, 0.1, 0.2])
        np.testing.assert_array_equal(record["q"], [1.5, np.nan, -0.2])


@pytest.mark.parametrize("numbers", [[0.0, -1.5, 3e-12], [1e300, -2.5e-300, 123456.789]])
@pytest.mark.parametrize(
    ("separator", "decimal"), [(",", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", ".")]
)
def test_what_pandas_writes_is_read_to_the_last_bit(pd, tmp_path, numbers, separator, decimal):
    frame = pd.DataFrame({"t": [0.0, 0.1, 0.2], "q": numbers})
    frame.to_csv(tmp_path / "log.csv", sep=separator, decimal=decimal, index=False)
    np.testing.assert_array_equal(
        FlightRecord.from_csv(tmp_path / "log.csv", "t", {"q": "1"})["q"], numbers
    )


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (
            ["t,q", "0,02,1,5", "0,04,1,6"],
            (
                "row 1 has 4 cells, the header 2 names .*a comma cannot be both separator and"
                " decimal sign"
            ),
        ),
        (
            ["t;q", "0;1,5", "0.1;2"],
            (
                "column 't', row 2: expected a number, got '0.1'; the decimal sign is a comma"
                " elsewhere"
            ),
        ),
        (["0.0,1", "0.1,2"], "the first line holds numbers"),
        (["# only", "# words"], "nothing but comments"),
        (["t,q", "0,1_000"], "got '1_000'"),
    ],
)
def test_a_table_that_can_be_read_in_two_ways_is_not_guessed_at(tmp_path, lines, message):
    with pytest.raises(InputError, match=message):
        FlightRecord.from_csv(
            write(tmp_path, *lines, name="log.csv"), time="t", units={"q": "rad/s"}
        )


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_a_clock_that_counts_in_another_unit_is_read_by_its_name_in_every_format(
    pd, tmp_path, unit
):
    ticks = 20 * np.arange(5.0) / {"ms": 1, "us": 1e-3, "ns": 1e-6}[unit]
    write(tmp_path, "t,q", *(f"{t:.0f},1" for t in ticks), name="log.csv")
    savemat(tmp_path / "log.mat", {"t": ticks, "q": np.ones(5)})
    for record in (
        FlightRecord.from_csv(tmp_path / "log.csv", "t", {"q": "1"}, time_unit=unit),
        FlightRecord.from_mat(tmp_path / "log.mat", "t", {"q": "1"}, time_unit=unit),
        FlightRecord.from_frame(
            pd.DataFrame({"t": ticks, "q": 1.0}), "t", {"q": "1"}, time_unit=unit
        ),
    ):
        assert record.dt == 0.02
    with pytest.warns(DataWarning, match="s apart; if the time is in"):
        FlightRecord.from_csv(tmp_path / "log.csv", "t", {"q": "1"})


@pytest.mark.parametrize(
    ("lines", "options", "message"),
    [
        (["t,q", "0,1", "1,fast"], dict(time="t"), "row 2: expected a number, got 'fast'"),
        (["t,q"], dict(time="t"), "no rows"),
        (["t,q", "0,1", ",2"], dict(time="t"), "the time is missing in row 2"),
        (["t,q", "0,1", "0,2"], dict(time="t"), "time must increase"),
        (["t,q", "0,1", "1,2"], dict(time=None), "one of the two"),
        (["t,q", "0,1", "1,2"], dict(time=None, dt=-1.0), "positive"),
        (["t,q", "0,1", "1,2"], dict(time="t", time_unit="m"), "time_unit"),
        (["t,q", "0,1", "1,2,3,4"], dict(time="t"), "not a table"),
        (["t,qq", "0,1"], dict(time="t"), "did you mean 'qq'"),
        (["t,q,q", "0,1,5", "1,2,6"], dict(time="t"), "2 columns are called 'q'"),
    ],
)
def test_a_spoilt_csv_says_what_is_wrong(tmp_path, lines, options, message):
    path = write(tmp_path, *lines, name="log.csv")
    with pytest.raises(InputError, match=message):
        FlightRecord.from_csv(path, units={"q": "rad/s"}, **options)


def test_a_frame_of_dates_or_words_is_refused_in_words(pd):
    """Dates as numbers are nano- or microseconds, by the version of pandas."""
    frame = pd.DataFrame(
        {
            "t": [0.0, 0.1, 0.2],
            "when": pd.date_range("2024-05-01", periods=3, freq="100ms"),
            "s": list("abc"),
            "q": 1.0,
        }
    )
    with pytest.raises(InputError, match="'when' holds dates; give numbers"):
        FlightRecord.from_frame(frame, "when", {"q": "rad/s"})
    with pytest.raises(InputError, match="column 's': expected numbers"):
        FlightRecord.from_frame(frame, "t", {"s": "1"})
    seconds = frame.assign(t=(frame["when"] - frame["when"].iloc[0]).dt.total_seconds())
    np.testing.assert_allclose(
        FlightRecord.from_frame(seconds, "t", {"q": "rad/s"}).time, [0.0, 0.1, 0.2], atol=1e-12
    )


def test_a_missing_file_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        FlightRecord.from_csv(tmp_path / "nowhere.csv", time="t", units={"q": "rad/s"})


# --- MATLAB -----------------------------------------------------------------------------


def test_mat_vectors_of_either_orientation_and_inside_structs(tmp_path):
    path = tmp_path / "log.mat"
    savemat(path, {"t": np.arange(4.0)[:, None], "log": {"theta": np.full((1, 4), 180.0)}})
    record = FlightRecord.from_mat(path, time="t", units={"log.theta": "deg"})
    np.testing.assert_allclose(record["log.theta"], np.pi)
    with pytest.raises(UnknownNameError, match=r"unknown variable 'log\.thta'"):
        FlightRecord.from_mat(path, time="t", units={"log.thta": "deg"})


def test_a_spoilt_mat_file_says_what_is_wrong(tmp_path):
    path = tmp_path / "log.mat"
    path.write_bytes(b"nonsense" * 40)
    with pytest.raises(InputError, match="not a MATLAB file"):
        FlightRecord.from_mat(path, time="t", units={"q": "rad/s"})
    savemat(path, {"t": np.arange(4.0), "q": np.arange(5.0), "M": np.eye(3)})
    with pytest.raises(InputError, match="has 5 samples, the time 't' has 4"):
        FlightRecord.from_mat(path, time="t", units={"q": "rad/s"})
    with pytest.raises(InputError, match="to be a vector"):
        FlightRecord.from_mat(path, time="t", units={"M": "1"})


def test_without_pyulog_the_message_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(InputError, match=r"symheli\[logs\]"):
        FlightRecord.from_ulog(
            write(tmp_path, "x", name="log.ulg"), {"q": ("rates", "xyz[1]", "rad/s")}, dt=0.02
        )


@pytest.mark.parametrize("end", ["", "|"])
def test_columns_may_be_separated_by_bars(tmp_path, end):
    lines = [f"{k / 10} | {k} | {k * k:.1f}{end}" for k in range(6)]
    path = write(tmp_path, f"t | q [rad/s] | u [m/s]{end}", *lines, name="log.csv")
    record = FlightRecord.from_csv(path, "t", {"q": "rad/s", "u": "m/s"})
    np.testing.assert_allclose(record["u"], np.arange(6.0) ** 2)
    # a comma is then the decimal sign
    comma = [line.replace(".", ",") for line in lines]
    path = write(tmp_path, f"t | q [rad/s] | u [m/s]{end}", *comma, name="comma.csv")
    np.testing.assert_array_equal(
        FlightRecord.from_csv(path, "t", {"u": "m/s"})["u"], np.arange(6.0) ** 2
    )


def test_an_xplane_table_that_went_through_a_spreadsheet_is_read(tmp_path):
    """Commas beside the bars, quoted names, and rows of nothing but commas."""
    log = tmp_path / "Forward.csv"
    rows = [f"{0.1 * k:.1f},|,{0.01 * k:.2f},|" for k in range(5)]
    log.write_text(
        "\n".join(
            ["totl,_time,|,____Q,rad/s,|".replace("totl,_time", "totl,time"), *rows, ",,,,|", ",,,"]
        )
    )
    assert len(FlightRecord.from_xplane(log)) == 5
