"""A record as a file: whole and exact, or refused with the reason."""

import pickle

import numpy as np
import pytest

import symheli
from symheli.errors import InputError
from symheli.records import FlightRecord

META = {
    "aircraft": "T-REX",
    "masses": [4.1, 5],
    "limits": (1, 2.5, None, True),
    "trim": np.array([[1.0, np.nan], [2.0, 3e-300]]),
    "nested": {"a": ("x", {"b": np.arange(3)}), "": []},
    "battery": np.float64(0.1),
}


@pytest.fixture
def record():
    rng = np.random.default_rng(0)
    values = rng.standard_normal((50, 3)) * [1e-300, 1.0, 1e300]
    values[7, 1] = np.nan
    signals = (
        symheli.values.Signal("q", "rad/s"),
        symheli.values.Signal("log.θ", "rad"),
        "my, own",
    )
    return FlightRecord(
        np.cumsum(rng.uniform(0.01, 0.02, 50)),
        values,
        signals,
        note="flown by hand,\nin wind",
        meta=META,
        resampled="means of 4 samples",
    )


def same(a, b):
    """Equal in type and content, NaN equal to NaN."""
    if isinstance(a, np.ndarray):
        return type(a) is type(b) and a.dtype == b.dtype and np.array_equal(a, b, equal_nan=True)
    if isinstance(a, dict):
        return type(b) is dict and list(a) == list(b) and all(same(a[k], b[k]) for k in a)
    if isinstance(a, list | tuple):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    return a == b


def test_a_saved_record_comes_back_to_the_last_bit(record, tmp_path):
    path = record.save(tmp_path / "flight.npz")
    got = FlightRecord.load(path)
    np.testing.assert_array_equal(got.time, record.time)
    np.testing.assert_array_equal(got.values, record.values)
    assert [(str(s), s.unit) for s in got.signals] == [(str(s), s.unit) for s in record.signals]
    assert (got.note, got.resampled) == (record.note, record.resampled)
    assert same(META, dict(got.meta))


def test_what_a_file_cannot_hold_comes_back_as_its_text(tmp_path, record):
    plan = symheli.FlightPlan(symheli.AirspeedSchedule.transition(0.0, 5.0, acceleration=2.0))
    flown = FlightRecord(record.time, record.values, record.signals, meta={"plan": plan, "n": 3})
    got = FlightRecord.load(flown.save(tmp_path / "flight.npz"))
    assert got.meta == {"n": 3, "described": {"plan": repr(plan)}}
    again = FlightRecord.load(got.save(tmp_path / "again.npz"))
    assert again.meta == got.meta


def test_a_damaged_or_foreign_file_is_refused_with_what_to_do(record, tmp_path):
    whole = record.save(tmp_path / "flight.npz").read_bytes()
    bad = tmp_path / "bad.npz"
    for end in np.linspace(0, len(whole) - 1, 60).astype(int):
        bad.write_bytes(whole[:end])
        with pytest.raises(InputError, match=r"bad\.npz: not a whole file of FlightRecord\.save"):
            FlightRecord.load(bad)
    middle = bytearray(whole)
    middle[len(whole) // 2] ^= 0xFF
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    np.save(tmp_path / "array.npy", np.zeros(3))
    for content in (
        bytes(middle),
        b"t,q\n0,1\n",
        (tmp_path / "other.npz").read_bytes(),
        (tmp_path / "array.npy").read_bytes(),
    ):
        bad.write_bytes(content)
        with pytest.raises(InputError, match="take an older copy"):
            FlightRecord.load(bad)
    with pytest.raises(InputError, match="No such file"):
        FlightRecord.load(tmp_path / "nowhere.npz")


class Trap:
    """Says that it was unpickled."""

    sprung = False

    def __reduce__(self):
        return setattr, (Trap, "sprung", True)


def test_a_pickle_is_never_read(record, tmp_path):
    path = tmp_path / "trap.npz"
    path.write_bytes(pickle.dumps(Trap()))
    with pytest.raises(InputError, match="pickles are never read"):
        FlightRecord.load(path)
    with np.load(record.save(tmp_path / "flight.npz")) as archive:
        parts = dict(archive)
    np.savez(path, **{**parts, "values": np.array([Trap()], dtype=object)})
    with pytest.raises(InputError, match="pickles are never read"):
        FlightRecord.load(path)
    assert not Trap.sprung


def test_a_file_of_another_version_is_refused(record, tmp_path, monkeypatch):
    monkeypatch.setattr("symheli.records.record_file.VERSION", 2)
    path = record.save(tmp_path / "flight.npz")
    monkeypatch.undo()
    with pytest.raises(InputError, match="version 2 of the format, this program reads 1"):
        FlightRecord.load(path)


def test_a_table_with_units_in_its_header_comes_back_to_the_last_bit(record, tmp_path):
    path = record.to_csv(tmp_path / "flight.csv")
    assert path.read_text(encoding="utf-8").splitlines()[0] == (
        't [s],q [rad/s],log.θ [rad],"my, own [1]"'
    )
    got = FlightRecord.from_csv(path)
    np.testing.assert_array_equal(got.time, record.time)
    np.testing.assert_array_equal(got.values, record.values)
    assert [(str(s), s.unit) for s in got.signals] == [(str(s), s.unit) for s in record.signals]


@pytest.mark.parametrize(
    "lines",
    [
        ["t [ms],q [deg/s],n", "0,90,1", "500,45,1"],
        ["t (ms);q (deg/s);n", "0;90;1", "500;45;1"],
        ["t[ms]\tq[deg/s]\tn", "0\t90\t1", "500\t45\t1"],
    ],
)
def test_units_in_a_header_are_believed_unless_told_otherwise(tmp_path, lines):
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines))
    got = FlightRecord.from_csv(path)
    assert got.signals == ("q",)
    np.testing.assert_allclose(got.time, [0, 0.5])
    np.testing.assert_allclose(got["q"], [np.pi / 2, np.pi / 4])
    told = FlightRecord.from_csv(path, units={"q": "rad/s", "n": "1"}, time_unit="us")
    np.testing.assert_allclose(told["q"], [90, 45])
    np.testing.assert_allclose(told.time, [0, 5e-4])
    whole = lines[0].replace(";", "\t").replace(",", "\t").split("\t")[1]
    assert FlightRecord.from_csv(path, units={whole: "rad/s"})[whole][0] == 90


def test_brackets_that_hold_no_unit_belong_to_the_name(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,xyz[1],q (raw)\n0,1,2\n0.1,1,2\n")
    assert FlightRecord.from_csv(path, units={"xyz[1]": "1", "q (raw)": "1"})["q (raw)"][0] == 2
    path.write_text("t,gyro (left),q\n0,1,2\n0.1,1,2\n")
    with pytest.raises(InputError, match="no column has its unit in the header"):
        FlightRecord.from_csv(path)
