"""Blackbox logs, written frame by frame after the format's description
(betaflight.com/docs/development/Blackbox-Internals), every encoding of it among them.
"""

from __future__ import annotations

import json
import struct
import warnings

import numpy as np
import pytest

from studies import cli
from symheli.errors import DataWarning, InputError, UnknownNameError
from symheli.logs.blackbox import blackbox_columns
from symheli.logs.format import format_of
from symheli.records import FlightRecord

NAMES = [
    *("loopIteration", "time", "axisP[0]", "axisI[0]", "axisI[1]", "axisI[2]"),
    *("rcCommand[0]", "rcCommand[1]", "rcCommand[2]", "rcCommand[3]", "vbatLatest", "rssi"),
    *("gyroADC[0]", "gyroADC[1]", "gyroADC[2]", "motor[0]", "motor[1]"),
]
I_PREDICTOR = [0, 0, 0, 0, 0, 0, 0, 0, 0, 4, 9, 0, 0, 0, 0, 11, 5]
I_ENCODING = [1, 1, 0, 0, 0, 0, 0, 0, 0, 1, 3, 1, 0, 0, 0, 1, 0]
P_PREDICTOR = [6, 2, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 3, 3, 3, 3, 3]
P_ENCODING = [9, 0, 0, 7, 7, 7, 8, 8, 8, 8, 6, 6, 0, 0, 0, 0, 0]
CONSTANTS = {4: 1000, 9: 2500, 11: 158}


def unsigned(value):
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def signed(value):
    return unsigned(2 * value if value >= 0 else -2 * value - 1)


def three(values):
    """The smallest of the four forms that holds all, as the firmware chooses."""
    for form, bits in enumerate((2, 4, 6)):
        if all(-(1 << (bits - 1)) <= v < 1 << (bits - 1) for v in values):
            a, b, c = (v & (1 << bits) - 1 for v in values)
            forms = [a << 4 | b << 2 | c], [0x40 | a, b << 4 | c], [0x80 | a, b, c]
            return bytes(forms[form])

    def fits(v, n):
        return -(1 << (8 * n - 1)) <= v < 1 << (8 * n - 1)

    sizes = [next(n for n in (1, 2, 3, 4) if fits(v, n)) for v in values]
    lead = 0xC0 | sum((n - 1) << 2 * i for i, n in enumerate(sizes))
    parts = zip(values, sizes, strict=True)
    return bytes([lead]) + b"".join(v.to_bytes(n, "little", signed=True) for v, n in parts)


def four(values):
    tags, nibbles = 0, []
    for i, v in enumerate(values):
        tag, width = next(
            (t, w)
            for t, w in enumerate((0, 4, 8, 16))
            if (w == 0 and v == 0) or (w and -(1 << (w - 1)) <= v < 1 << (w - 1))
        )
        tags |= tag << 2 * i
        nibbles += [(v & (1 << width) - 1) >> s & 15 for s in range(width - 4, -1, -4)]
    nibbles += [0] * (len(nibbles) % 2)
    pairs = zip(nibbles[::2], nibbles[1::2], strict=True)
    return bytes([tags, *(a << 4 | b for a, b in pairs)])


def eight(values):
    tags = sum(1 << i for i, v in enumerate(values) if v)
    return bytes([tags]) + b"".join(signed(v) for v in values if v)


def frame(letter, values, last, earlier):
    predictors, encodings = (
        (I_PREDICTOR, I_ENCODING) if letter == "I" else (P_PREDICTOR, P_ENCODING)
    )
    left = []
    for i, (predictor, value) in enumerate(zip(predictors, values, strict=True)):
        if predictor == 1:
            value -= last[i]
        elif predictor == 2:
            value -= 2 * last[i] - earlier[i]
        elif predictor == 3:
            value -= int((last[i] + earlier[i]) / 2)
        elif predictor == 5:
            value -= values[NAMES.index("motor[0]")]
        elif predictor == 6:
            value -= last[i] + 1
        left.append(value - CONSTANTS.get(predictor, 0))
    out, i = [letter.encode()], 0
    while i < len(left):
        code = encodings[i]
        count = {7: 3, 8: 4, 6: 2}.get(code, 1)
        part = left[i : i + count]
        out.append(
            {
                0: lambda p: signed(p[0]),
                1: lambda p: unsigned(p[0]),
                3: lambda p: unsigned(-p[0] & 0x3FFF),
                6: eight,
                7: three,
                8: four,
                9: lambda p: b"",
            }[code](part)
        )
        i += count
    return b"".join(out)


def header(**other):
    lines = {
        "Product": "Blackbox flight data recorder by Nicholas Sherlock",
        "Data version": "2",
        "Field I name": ",".join(NAMES),
        "Field I predictor": ",".join(map(str, I_PREDICTOR)),
        "Field I encoding": ",".join(map(str, I_ENCODING)),
        "Field P predictor": ",".join(map(str, P_PREDICTOR)),
        "Field P encoding": ",".join(map(str, P_ENCODING)),
        "Field S name": "flightModeFlags,stateFlags",
        "Field S predictor": "0,0",
        "Field S encoding": "1,1",
        "minthrottle": "1000",
        "vbatref": "2500",
        "motorOutput": "158,2047",
        "gyro_scale": "0x3f800000",
    } | {name.replace("_version", " version"): value for name, value in other.items()}
    return "".join(f"H {name}:{value}\n" for name, value in lines.items()).encode()


def flown(n=1500, start=1_000_000, seed=0):
    """Rows of a flight at 500 Hz: whole numbers, small and large."""
    rng = np.random.default_rng(seed)
    u = np.convolve(rng.standard_normal(n + 50), np.ones(50) / 50, "valid")[:n] * 400
    q = np.zeros(n)
    for k in range(1, n):
        q[k] = 0.97 * q[k - 1] + 0.02 * u[k - 1] + rng.standard_normal()
    rows = np.zeros((n, len(NAMES)), int)
    rows[:, 0], rows[:, 1] = np.arange(n), start + 2000 * np.arange(n)
    rows[:, 2] = np.round(u)
    rows[:, 3:6] = rng.integers(-1, 2, (n, 3))
    rows[::7, 4] = rng.integers(-70_000, 70_000, len(rows[::7]))
    rows[:, 6:10] = rng.integers(-3, 4, (n, 4))
    rows[:, 9] += 1500
    rows[::5, 7] = rng.integers(-500, 500, len(rows[::5]))
    rows[:, 10], rows[:, 11] = 2400 - np.arange(n) // 100, 1000
    rows[:, 12] = np.round(q)
    rows[:, 13:15] = rng.integers(-30, 30, (n, 2))
    rows[:, 15:] = 300 + rng.integers(0, 100, (n, 2))
    return rows


def bbl(rows, interval=32, **options):
    out, last, earlier = [header(**options), b"S" + unsigned(1) + unsigned(0)], None, None
    for k, row in enumerate(rows.tolist()):
        letter = "I" if k % interval == 0 else "P"
        out.append(frame(letter, row, last, earlier))
        earlier, last = (row if letter == "I" else last), row
    return b"".join([*out, b"E\xffEnd of log\x00"])


def test_every_encoding_and_prediction_comes_back_to_the_last_count(tmp_path):
    rows, path = flown(), tmp_path / "log.bbl"
    path.write_bytes(bbl(rows))
    assert format_of(path) == "blackbox"
    found = blackbox_columns(path)
    for i, name in enumerate(NAMES[2:], 2):
        np.testing.assert_array_equal(found[name].values, rows[:, i], err_msg=name)
        np.testing.assert_allclose(found[name].time, 1e-6 * rows[:, 1], rtol=1e-12)
    np.testing.assert_array_equal(found["pidSum[0]"].values, rows[:, 2] + rows[:, 3])
    assert found["gyroADC[0]"].unit == "deg/s"
    assert found["flightModeFlags"].values.tolist() == [1.0]


def test_a_map_reads_it_and_contradicting_units_are_refused(tmp_path):
    rows, path, written = flown(), tmp_path / "log.bfl", tmp_path / "m.toml"
    path.write_bytes(bbl(rows))
    written.write_text('dt = 0.002\n[signals]\np = { column = "gyroADC[0]" }\n')
    record = FlightRecord.from_map(path, written)
    np.testing.assert_allclose(record["p"], np.radians(rows[:, 12]), atol=1e-9)
    direct = FlightRecord.from_blackbox(path, {"p": "gyroADC[0]", "lat": "axisP[0]"}, dt=0.002)
    np.testing.assert_array_equal(direct["p"], record["p"])
    assert [str(s.unit) for s in direct.signals] == ["rad/s", "1"]
    with pytest.raises(UnknownNameError, match="signal in units"):
        FlightRecord.from_blackbox(path, {"p": "gyroADC[0]"}, 0.002, units={"q": "deg/s"})
    with pytest.raises(InputError, match="expected at least one signal"):
        FlightRecord.from_blackbox(path, {}, dt=0.002)
    written.write_text('dt = 0.002\n[signals]\np = { column = "gyroADC[0]", unit = "rad/s" }\n')
    with pytest.raises(InputError, match=r"the log says that gyroADC\[0\] is in deg/s, not rad/s"):
        FlightRecord.from_map(path, written)
    written.write_text('dt = 0.002\n[signals]\np = { column = "gyroADC[3]" }\n')
    with pytest.raises(UnknownNameError, match=r"gyroADC\[2\]"):
        FlightRecord.from_map(path, written)


def test_a_file_of_logs_is_one_after_the_other_and_a_clock_that_begins_again_is_set_behind(
    tmp_path,
):
    path = tmp_path / "all.bbl"
    path.write_bytes(bbl(flown(600)) + bbl(flown(700, start=500_000)))
    found = blackbox_columns(path)
    gyro = found["gyroADC[0]"]
    assert len(gyro.values) == 1300
    assert gyro.time[600] - gyro.time[599] == pytest.approx(10.0)
    assert found["log"].values.tolist() == [1, 1, 2, 2]


def test_what_is_damaged_is_left_out_up_to_the_next_whole_frame(tmp_path):
    rows, path = flown(), tmp_path / "log.bbl"
    content = bytearray(bbl(rows))
    at = len(content) // 2
    content[at : at + 40] = b"\xa7" * 40
    path.write_bytes(content)
    with pytest.warns(DataWarning, match="parts of the log are damaged"):
        found = blackbox_columns(path)
    time = found["gyroADC[0]"].time
    kept = np.isin(rows[:, 1], np.round(1e6 * time).astype(int))
    assert len(rows) - 96 < len(time) == kept.sum() < len(rows)  # at most three I frames apart
    np.testing.assert_array_equal(found["gyroADC[0]"].values, rows[kept, 12])


def test_a_log_that_ends_anywhere_or_is_full_of_noise_is_read_so_far_or_refused(tmp_path):
    content, path, lengths = bbl(flown(200)), tmp_path / "log.bbl", []
    rng = np.random.default_rng(0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        for end in np.linspace(1, len(content), 60).astype(int):
            path.write_bytes(content[:end])
            try:
                lengths.append(len(blackbox_columns(path)["gyroADC[0]"].values))
            except InputError:
                continue
        assert lengths == sorted(lengths)
        assert lengths[-1] == 200
        for _ in range(30):
            noisy = bytearray(content)
            where = rng.integers(0, len(content) - 31)
            noisy[where : where + 31] = rng.bytes(31)
            path.write_bytes(noisy)
            try:
                assert len(blackbox_columns(path)["gyroADC[0]"].values) <= 200
            except InputError:
                continue


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"Data_version": "1"}, "version 1 of the Blackbox format is not read"),
        (
            {"Field I encoding": ",".join(["77"] * len(NAMES))},
            "encoding 77 of I frames is not known",
        ),
        ({"Field I encoding": "1,1"}, "17 names, 2 encodings"),
        ({"Field I name": ""}, "the header says nothing of the frames"),
    ],
)
def test_a_header_that_cannot_be_right_is_refused_in_words(tmp_path, options, message):
    path = tmp_path / "log.bbl"
    path.write_bytes(bbl(flown(10), **options))
    with pytest.raises(InputError, match=message):
        blackbox_columns(path)


@pytest.mark.slow
def test_the_survey_suggests_what_identifies(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.bbl").write_bytes(bbl(flown(6000)))
    assert cli.main(["identify", "log.bbl", "--json"]) == 0
    seen = json.loads(capsys.readouterr().out)
    assert 'lat = { column = "pidSum[0]", unit = "1" }' in seen["suggested_map"] or (
        'lon = { column = "pidSum[1]", unit = "1" }' in seen["suggested_map"]
    )
    (tmp_path / "aircraft.toml").write_text(seen["suggested_map"])
    assert cli.main([*seen["suggested_command"][1:], "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["read"]["format"] == "mapped"


def test_the_scale_of_older_gyros_is_in_radians_a_microsecond(tmp_path):
    scale = struct.unpack("<I", struct.pack("<f", np.radians(0.061) * 1e-6))[0]
    path = tmp_path / "log.bbl"
    path.write_bytes(bbl(flown(100), gyro_scale=hex(scale)))
    got = blackbox_columns(path)["gyroADC[0]"].values
    np.testing.assert_allclose(got, 0.061 * flown(100)[:, 12], rtol=1e-6)
