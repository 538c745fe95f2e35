"""A log alone: what it holds is said, nothing is used, and what is suggested works."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from autopilot_logs import BEFORE_2015, SDLOG2, dataflash, ulog
from scipy.io import savemat

from identification.judge.scores import percent
from studies import cli
from symheli.logs.column import Column
from symheli.logs.dataflash import dataflash_columns
from symheli.logs.meaning import guesses
from symheli.records import FlightRecord

DATA = Path(__file__).parents[1] / "data"
STEP = 0.02


def flight(n=900, seed=0):
    """Pitch, driven by a stick, slower the faster it flies; rad, rad/s, m/s."""
    rng = np.random.default_rng(seed)
    airspeed = 8 + 5 * np.sin(2 * np.pi * np.arange(n) / 600)
    lon = 0.3 * np.repeat(rng.choice([-1.0, 1.0], n // 10), 10)
    q, theta = np.zeros(n), np.zeros(n)
    for k in range(1, n):
        q[k] = (0.96 - 0.01 * airspeed[k - 1]) * q[k - 1] - 0.02 * theta[k - 1] + 0.1 * lon[k - 1]
        theta[k] = theta[k - 1] + STEP * 0.5 * (q[k] + q[k - 1])
    return {
        "t": STEP * np.arange(n),
        "q": q + 1e-3 * rng.standard_normal(n),
        "theta": theta,
        "lon": lon,
        "airspeed": airspeed,
    }


def table(path, columns):
    np.savetxt(
        path,
        np.stack(list(columns.values()), 1),
        delimiter=",",
        header=",".join(columns),
        comments="",
    )
    return path


@pytest.fixture
def answer(capsys):
    """What `symheli identify` answers to a program."""

    def call(*options):
        assert cli.main(["identify", *map(str, options), "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return call


@pytest.fixture
def look(answer, capsys):
    """What it answers where it only looks: as data, and as text."""

    def call(*options):
        seen = answer(*options)
        assert not seen["identified"]
        assert cli.main(["identify", *map(str, options)]) == 0
        return seen, capsys.readouterr().out

    return call


def csv_log(tmp_path):
    f = flight()
    columns = {
        "stamp_us": 1e6 * f["t"],
        "gyro_y (deg/s)": np.degrees(f["q"]),
        "pitch_deg": np.degrees(f["theta"]),
        "elevator": f["lon"],
        "TAS_kt": f["airspeed"] * 3600 / 1852,
        "battery": 12.0 + 0 * f["t"],
    }
    return table(tmp_path / "log.csv", columns)


def timeless_csv(tmp_path):
    f = flight()
    return table(tmp_path / "log.csv", {n: v for n, v in f.items() if n != "t"})


def mat_log(tmp_path):
    f = flight()
    log = {"log": {**f, "time": f["t"], "short": np.arange(5.0)}}
    savemat(tmp_path / "log.mat", log)
    return tmp_path / "log.mat"


def ulog_log(tmp_path):
    pytest.importorskip("pyulog", reason="needs pyulog: pip install 'symheli[logs]'")
    f = flight()
    stamps = np.round(1e6 * f["t"]).astype(int)
    half = f["theta"] / 2
    zero = 0 * half
    path = tmp_path / "log.ulg"
    path.write_bytes(
        ulog(
            {
                ("vehicle_angular_velocity", 0): {"timestamp": stamps, "xyz[1]": f["q"]},
                ("vehicle_attitude", 0): {
                    "timestamp": stamps,
                    **{"q[0]": np.cos(half), "q[1]": zero, "q[2]": np.sin(half), "q[3]": zero},
                },
                ("vehicle_torque_setpoint", 0): {"timestamp": stamps, "xyz[1]": f["lon"]},
                ("airspeed", 0): {
                    "timestamp": stamps[::10],
                    "true_airspeed_m_s": f["airspeed"][::10],
                },
            }
        )
    )
    return path


LOGS = {"csv": csv_log, "csv without time": timeless_csv, "mat": mat_log, "ulog": ulog_log}


@pytest.mark.slow(but="mat")
@pytest.mark.parametrize("kind", LOGS)
def test_the_suggested_command_identifies_what_was_flown(look, answer, tmp_path, monkeypatch, kind):
    monkeypatch.chdir(tmp_path)
    seen, _ = look(LOGS[kind](tmp_path))
    if seen["suggested_map"]:
        Path("aircraft.toml").write_text(seen["suggested_map"])
    program, verb, *rest = seen["suggested_command"]
    assert (program, verb) == ("symheli", "identify")
    found = answer(*rest)
    assert found["read"]["dt"] == pytest.approx(STEP, rel=0.02)
    assert found["scheduling_verdict"] is not None
    assert list(found["read"]["signals"].values()) == ["rad/s", "rad", "1", "m/s"]
    low, high = found["read"]["scheduling_range"]
    assert (low, high) == (pytest.approx(3.0, abs=0.1), pytest.approx(13.0, abs=0.1))
    best = next(iter(found["models"].values()))
    assert best["fit_percent"]["held_out"]["1 s"][next(iter(found["read"]["signals"]))] > 80


def test_the_text_ends_in_the_command_for_a_shell(look, tmp_path):
    log = ulog_log(tmp_path)
    seen, text = look(log)
    *_, last = text.splitlines()
    assert shlex.split(last) == seen["suggested_command"]
    block = text[text.index("cat > aircraft.toml <<'END'\n") :].splitlines()
    assert "\n".join(block[1 : block.index("END")]) == seen["suggested_map"]


def test_motion_is_counted_column_by_column(look, tmp_path):
    f = flight()
    q = np.degrees(f["q"])
    q[100:130] = np.nan
    time = np.delete(f["t"], slice(200, 400))
    columns = {n: np.delete(v, slice(200, 400)) for n, v in {**f, "gyro_y (deg/s)": q}.items()}
    columns.pop("q")
    columns |= {"t": time, "rotor": np.full(len(time), 150.0)}
    seen, text = look(table(tmp_path / "log.csv", columns))
    rows = {row["name"]: row for row in seen["columns"]}
    kept = columns["gyro_y (deg/s)"]
    gyro = rows["gyro_y"]
    assert (gyro["samples"], gyro["missing"], gyro["unit"]) == (len(kept), 30, "deg/s")
    assert gyro["deviation"] == pytest.approx(np.nanstd(kept), rel=1e-9)
    assert (gyro["low"], gyro["high"]) == (
        pytest.approx(np.nanmin(kept)),
        pytest.approx(np.nanmax(kept)),
    )
    assert gyro["guess"] == {"signal": "q", "column": "gyro_y", "unit": "deg/s", "why": "the log"}
    assert not rows["rotor"]["moves"]
    assert "columns that stay where they are: rotor" in text
    assert seen["time"]["gaps"] == 1
    assert seen["time"]["longest"] == pytest.approx(201 * STEP)
    assert "1 gap, the longest 4.02 s" in text
    assert "airspeed covers 3 to 13 m/s" in text


@pytest.mark.parametrize(
    ("without", "sentence", "command"),
    [
        ("airspeed", "without it the model is LTI", True),
        ("lon", "an input that moves", False),
        ("t", "a clock: give the time between rows", True),
        ("q", "angular rates p, q, r", True),
    ],
)
def test_what_is_missing_is_said(look, tmp_path, without, sentence, command):
    columns = {n: v for n, v in flight().items() if n != without}
    seen, text = look(table(tmp_path / "log.csv", columns))
    assert sentence in text
    assert (seen["suggested_command"] is not None) is command
    if without == "airspeed":
        assert seen["suggested_command"][-2:] == ["--degree", "0"]


def test_without_angles_and_rates_nothing_says_how_far_apart_rows_are(look, tmp_path):
    columns = {n: v for n, v in flight().items() if n not in ("t", "theta")}
    seen, _ = look(table(tmp_path / "log.csv", columns))
    assert (seen["time"], seen["suggested_step"], seen["suggested_command"]) == (None, None, None)
    seen, _ = look(tmp_path / "log.csv", "--dt", STEP)
    assert seen["suggested_command"][3:5] == ["--dt", f"{STEP:g}"]


def test_a_step_is_found_in_noise_from_an_angle_and_its_rate(look, tmp_path):
    f = flight()
    noise = np.random.default_rng(1).standard_normal(len(f["t"]))
    columns = {"q": f["q"] + 0.3 * f["q"].std() * noise, "theta": f["theta"], "lon": f["lon"]}
    seen, _ = look(table(tmp_path / "log.csv", columns))
    assert seen["suggested_step"] == pytest.approx(STEP, rel=0.03)


def test_an_xplane_log_without_a_clock_is_looked_at_and_with_dt_identified(look, answer):
    log = DATA / "xplane" / "Forward.txt"
    seen, text = look(log)
    assert seen["suggested_command"] is not None
    assert "a clock: give the time between rows" in text
    assert 0.09 < seen["suggested_step"] < 0.11  # nominal 10 Hz
    found = answer(log, "--dt", 0.1)
    assert "models" in found


@pytest.mark.parametrize("option", [("--plot", "fits.png"), ("--orders",), ("--save", "m.json")])
def test_who_asks_for_a_fit_is_told_that_outputs_are_missing(tmp_path, capsys, option):
    assert cli.main(["identify", str(csv_log(tmp_path)), *option]) == 1
    assert "give the signals to predict" in capsys.readouterr().err


def test_a_map_alone_shows_its_signals(look, tmp_path):
    log, signal_map = csv_log(tmp_path), tmp_path / "m.toml"
    signal_map.write_text(
        'time = "stamp_us"\ntime_unit = "us"\n[signals]\nq = { column = "gyro_y" }\n'
        'd_lon = { column = "elevator", unit = "1" }\n'
    )
    seen, _ = look(log, "--map", signal_map)
    assert {row["name"]: row["unit"] for row in seen["columns"]} == {"q": "rad/s", "d_lon": "1"}
    assert seen["suggested_command"][3:] == [
        *("--map", str(signal_map), "--outputs", "q", "--inputs", "d_lon", "--degree", "0"),
    ]


def test_ardupilot_columns_are_guessed_with_the_units_of_the_log(look, tmp_path):
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    f, rows = flight(), []
    for k, t in enumerate(f["t"]):
        stamp = round(1e6 * t)
        rows.append(("IMU", (stamp, 0, f["q"][k], 20.0)))
        if k % 5 == 0:
            pitch = round(100 * np.degrees(f["theta"][k]))
            rows += [("ATT", (stamp, pitch, 0)), ("RATE", (stamp, round(100 * f["lon"][k])))]
    (tmp_path / "log.bin").write_bytes(dataflash(rows))
    seen, _ = look(tmp_path / "log.bin")
    # read at the rate of the gyro, then means over the steps of the input
    assert seen["suggested_command"][-2:] == ["--decimate", "5"]
    assert seen["suggested_map"].splitlines() == [
        "dt = 0.02",
        "[signals]",
        'q = { column = "IMU.GyrY" }',
        'theta = { column = "ATT.Pitch" }',
        'lon = { column = "RATE.POut" }',
    ]


def test_a_latitude_is_no_stick_and_large_numbers_are_degrees():
    wave = np.sin(np.arange(50.0))
    columns = {
        "lat": Column(None, 52 + wave),
        "lon": Column(None, 13 + wave),
        "Roll Rate": Column(None, 80 * wave),
        "pitch": Column(None, 20 * wave),
        "rudder": Column(None, 1500 + 300 * wave),
        "q_dps": Column(None, 2 * wave),
    }
    found = guesses(columns, "csv")
    assert {g.signal: (g.column, g.unit) for g in found.values()} == {
        "p": ("Roll Rate", "deg/s"),
        "q": ("q_dps", "deg/s"),
        "theta": ("pitch", "deg"),
        "ped": ("rudder", "us"),
    }


def before_2015(path, crash=False):
    """20 s on the ground, 18 s of flight, the ground again; the airspeed from a GPS that counts the
    week, the heading without a declared unit.
    """
    f, rows, none = flight(), [], np.zeros(1000)
    q, theta, lon = (np.concatenate([none, f[n], none]) for n in ("q", "theta", "lon"))
    if crash:
        q[1600:1610] = -20.0
    for k in range(2900):
        now = 60_000 + 20 * k
        rows.append(("IMU", (now, 0.0, q[k], 0.0)))
        rows += [("EV", (now, event))] if (event := {950: 10, 1000: 28, 1900: 18}.get(k)) else []
        if k % 5 == 0:
            rows.append(("ATT", (now, round(100 * np.degrees(theta[k])), 100 * (k % 360))))
            rows.append(("RATE", (now, lon[k])))
            speed = 8 + 5 * np.sin(2 * np.pi * k / 600)
            rows.append(("GPS", (3, 604_091_000 + 20 * k, speed, now)))
    path.write_bytes(dataflash(rows, formats=BEFORE_2015))
    return path


def runs(seen, answer):
    """What the suggested command answers."""
    Path("aircraft.toml").write_text(seen["suggested_map"])
    return answer(*seen["suggested_command"][2:])


def test_ground_and_flight_of_an_old_log_are_told_apart_and_the_flight_is_suggested(
    look, answer, tmp_path, monkeypatch
):
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    monkeypatch.chdir(tmp_path)
    seen, text = look(before_2015(tmp_path / "log171.bin"))
    words = [one["what"] for one in seen["segments"]]
    assert words == [
        "disarmed, on the ground, at rest",
        "armed, on the ground, at rest",
        "armed, airborne",
        "armed, on the ground, at rest",
    ]
    flown = seen["segments"][2]
    assert (flown["start"], flown["stop"]) == (pytest.approx(80, abs=2), pytest.approx(98, abs=2))
    assert [one["serves"] for one in seen["segments"]] == [False, False, True, False]
    assert re.search(r"\n  3 +80\.?\d* +98\.?\d* +armed, airborne +landed +yes\n", text)
    assert [one["ends"] for one in seen["segments"]] == [
        "armed",
        "took off",
        "landed",
        "the log ends",
    ]
    assert "--start" not in seen["suggested_command"]  # what serves is taken without a word
    found = runs(seen, answer)
    assert 16 < found["read"]["stop"] - found["read"]["start"] < 19
    assert found["read"]["scheduling_range"] == [
        pytest.approx(3, abs=0.1),
        pytest.approx(13, abs=0.1),
    ]


def test_what_is_behind_a_crash_is_no_flight(look, answer, tmp_path, monkeypatch):
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    monkeypatch.chdir(tmp_path)
    seen, text = look(before_2015(tmp_path / "log.bin", crash=True))
    assert "crashed" in text
    (flown,) = (one for one in seen["segments"] if one["flown"])
    assert (flown["start"], flown["stop"]) == (80.0, pytest.approx(60 + 0.02 * 1600))
    assert flown["ends"] == "crash"
    assert runs(seen, answer)["read"]["stop"] <= 60 + 0.02 * 1600


def test_a_log_without_a_flight_is_refused_unless_it_is_asked_for_as_it_is(
    look, tmp_path, monkeypatch, capsys
):
    """On the ground, moved by hand; --segments all takes it."""
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    monkeypatch.chdir(tmp_path)
    f, rows = flight(), [("EV", (0, 11))]
    for k in range(900):
        now = 20 * k
        rows.append(("IMU", (now, 0.0, f["q"][k], 0.0)))
        rows.append(("RATE", (now, f["lon"][k])))
    log = tmp_path / "bench.bin"
    log.write_bytes(dataflash(rows, formats=BEFORE_2015))
    seen, text = look(log)
    assert seen["suggested_command"] is None
    assert "no segment of 5 s in the air" in text
    Path("m.toml").write_text(
        'dt = 0.02\n[signals]\nq = { column = "IMU.GyrY", unit = "rad/s" }\n'
        'lon = { column = "RATE.POut", unit = "1" }\n'
    )
    command = ["identify", str(log), "--map", "m.toml", "--outputs", "q", "--inputs", "lon"]
    command += ["--degree", "0"]
    assert cli.main(command) == 1
    assert (
        "no segment is flight of at least 5 s: 0.00 to 17.98 s disarmed" in capsys.readouterr().err
    )
    assert cli.main([*command, "--segments", "7"]) == 1
    assert "expected serving, all or numbers from 1 to 1" in capsys.readouterr().err
    assert cli.main([*command, "--segments", "all"]) == 0
    assert cli.main([*command, "--segments", "1"]) == 0


def test_flights_of_one_file_are_told_apart_by_the_hole_between_them_and_both_are_used(
    look, answer, tmp_path, monkeypatch
):
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    monkeypatch.chdir(tmp_path)
    f, rows = flight(), []
    for k in range(900):
        now = 20 * k + (600_000 if k >= 450 else 0)
        rows.append(("IMU", (now, 0.0, f["q"][k], 0.0)))
        rows.append(("RATE", (now, f["lon"][k])))
    log = tmp_path / "two.bin"
    log.write_bytes(dataflash(rows, formats=BEFORE_2015))
    seen, _ = look(log)
    assert [(one["serves"], one["ends"]) for one in seen["segments"]] == [
        (True, "a hole of 600 s"),
        (True, "the log ends"),
    ]
    found = runs(seen, answer)["read"]
    # all samples, none between; the last 0.3 of the time flown are held out, not of the clock
    assert found["rows_read"] == 900
    assert found["held_out_samples"] == pytest.approx(0.3 * found["samples"], abs=2)


def test_a_dataflash_clock_that_begins_again_begins_another_segment_that_serves(
    look, tmp_path, monkeypatch
):
    """Two flights of one file, the second on a clock from power on again; an instant far ahead of
    its neighbours is damage, and no new beginning.
    """
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    monkeypatch.chdir(tmp_path)
    rows, flown = [], flight(1500)
    for k in range(1500):
        again = k >= 700
        us = int(1e6 * (20.0 + STEP * (k - 700 * again)))
        q, theta, lon = (flown[name][k] for name in ("q", "theta", "lon"))
        rows.append(("IMU", (us, 0, q, 20.0)))
        rows.append(("ATT", (us, round(100 * np.degrees(theta)), 0)))
        rows.append(("RATE", (us, round(1000 * lon))))
    Path("log.bin").write_bytes(dataflash(rows))
    seen, _ = look("log.bin")
    first, second = seen["segments"]
    assert (first["serves"], first["ends"]) == (True, "a hole of 10 s")
    assert (second["serves"], second["ends"]) == (True, "the log ends")
    # the second log is set 10 s behind the first
    assert second["start"] - first["stop"] == pytest.approx(10.0, abs=2 * STEP)
    record = FlightRecord.from_dataflash("log.bin", {"q": "IMU.GyrY"}, dt=STEP)
    late = record.between(second["start"], None)
    # the first of the others of the second log, before a RATE of it, are left out
    expected = np.interp(late.time - second["start"], STEP * np.arange(800), flown["q"][700:])
    # half a sample of the clock, in which q moves by less than this
    assert np.max(np.abs(late["q"] - expected)) < np.abs(np.diff(flown["q"])).max()
    assert len(late) == pytest.approx(800, abs=2)
    rows[300] = ("IMU", (10**10, 0, 0.0, 20.0))
    Path("wild.bin").write_bytes(dataflash(rows))
    assert dataflash_columns("wild.bin")["log"].values.tolist() == [1.0, 2.0]


def test_a_rate_that_is_exceeded_in_flight_is_no_crash(look, tmp_path):
    """A flip: 13 rad/s a minute before the log ends."""
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    q = np.tile(flight()["q"], 4)[:3600]
    q[500:510] = 13.0
    rows = [("IMU", (20 * k, 0.0, value, 0.0)) for k, value in enumerate(q)]
    (tmp_path / "flip.bin").write_bytes(dataflash(rows, formats=BEFORE_2015))
    seen, text = look(tmp_path / "flip.bin")
    assert "crash" not in text
    assert all(one["flown"] for one in seen["segments"])


def test_an_input_faster_than_its_rate_sets_the_step_and_a_finer_one_is_refused(
    look, tmp_path, monkeypatch, capsys
):
    """Input drawn anew at 10 Hz, gyro at 50 Hz: between its samples nothing is known."""
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    monkeypatch.chdir(tmp_path)
    f, rows, rng = flight(), [], np.random.default_rng(0)
    for k in range(900):
        rows.append(("IMU", (20 * k, 0.0, f["q"][k], 0.0)))
        rows += [("RATE", (20 * k, rng.standard_normal()))] if k % 5 == 0 else []
    log = tmp_path / "log.bin"
    log.write_bytes(dataflash(rows, formats=BEFORE_2015))
    seen, text = look(log)
    assert "lon more often: it moves faster than its 10 Hz resolve" in text
    assert seen["suggested_command"][-2:] == ["--decimate", "5"]
    Path("aircraft.toml").write_text(seen["suggested_map"])
    assert cli.main(seen["suggested_command"][1:-2]) == 1  # at 50 Hz
    assert "lon was logged every 0.1 s" in capsys.readouterr().err


def test_an_input_slower_than_its_rate_is_interpolated_and_named(
    look, answer, tmp_path, monkeypatch
):
    """An input of 0.5 Hz at 10 Hz: the model gets the steps of the gyro's means."""
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    monkeypatch.chdir(tmp_path)
    f, rows = flight(), []
    for k in range(900):
        rows.append(("IMU", (20 * k, 0.0, f["q"][k], 0.0)))
        rows += [("RATE", (20 * k, np.sin(np.pi * 0.02 * k)))] if k % 5 == 0 else []
    log = tmp_path / "log.bin"
    log.write_bytes(dataflash(rows, formats=BEFORE_2015))
    seen, _ = look(log)
    found = runs(seen, answer)["read"]
    assert found["dt"] == pytest.approx(0.02)
    assert found["logged_every"] == {"lon": pytest.approx(0.1)}


def test_armed_and_modes_of_px4(look, tmp_path):
    pytest.importorskip("pyulog", reason="needs pyulog: pip install 'symheli[logs]'")
    f = flight()
    stamps = np.round(1e6 * f["t"]).astype(int)
    gyro = {"timestamp": stamps, "x": f["q"], "y": f["q"], "z": f["q"]}
    status = {
        "timestamp": stamps[::100],
        "arming_state": np.array([1, 2, 2, 2, 2, 2, 2, 2, 1]),
        "nav_state": np.array([0, 0, 0, 2, 2, 2, 2, 2, 2]),
    }
    path = tmp_path / "log.ulg"
    path.write_bytes(ulog({("sensor_gyro", 0): gyro, ("vehicle_status", 0): status}))
    seen, _ = look(path)
    assert [(one["what"], one["flown"]) for one in seen["segments"]] == [
        ("disarmed, mode 0", False),
        ("armed, mode 0", True),
        ("armed, mode 2", True),
        ("disarmed, mode 2", False),
    ]


def test_sdlog2_is_looked_at_and_identified(look, answer, tmp_path, monkeypatch):
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    monkeypatch.chdir(tmp_path)
    f, rows = flight(), []
    for k, t in enumerate(f["t"]):
        rows.append(("TIME", (round(1e6 * t),)))
        rows.append(("ATT", (0.0, f["theta"][k], 0.0, 0.0, f["q"][k], 0.0)))
        rows.append(("ATTC", (0.0, f["lon"][k], 0.0, 0.5)))
    path = tmp_path / "sess001.px4log"
    path.write_bytes(dataflash(rows, formats=SDLOG2))
    seen, _ = look(path)
    found = runs(seen, answer)
    assert list(found["models"]) == ["LTI"]
    assert found["read"]["rows_read"] == len(f["t"])
    assert found["models"]["LTI"]["fit_percent"]["held_out"]["one step"]["q"] > 80


def test_a_command_that_would_fail_is_not_printed_but_why_it_would(look, tmp_path):
    """Three seconds: not enough for the model that is suggested."""
    f = {name: values[:40] for name, values in flight().items()}
    seen, text = look(table(tmp_path / "log.csv", f))
    assert seen["suggested_command"] is None
    (why,) = (sentence for sentence in seen["missing"] if "the obvious command" in sentence)
    assert "usable samples cannot determine" in why
    assert why in text


def test_a_fit_beyond_all_measure_is_called_by_its_word():
    assert [percent(v) for v in (-1.3e29, -np.inf, -250.0, 98.76, np.nan)] == [
        *("diverges", "diverges", "-250.0", "98.8", "no data")
    ]


def test_columns_named_by_axis_and_unit_are_suggested(look, answer, tmp_path):
    f = flight()
    pulses = 1500 + 400 * f["lon"] / np.abs(f["lon"]).max()
    log = table(
        tmp_path / "log.csv",
        {
            "TimeMS": np.round(1e3 * f["t"]) + 12345,
            "GyroPitch_dps": np.degrees(f["q"]),
            "PitchAngle_deg": np.degrees(f["theta"]),
            "RCOU_elev": pulses,
            "Airspeed": f["airspeed"],
        },
    )
    seen, _ = look(log)
    guessed = {one["guess"]["signal"]: one for one in seen["columns"] if one["guess"]}
    assert guessed["q"]["name"] == "GyroPitch_dps"
    assert guessed["q"]["guess"]["unit"] == "deg/s"
    assert guessed["lon"]["guess"]["unit"] == "us"
    command = seen["suggested_command"]
    assert {"GyroPitch_dps=deg/s", "RCOU_elev=us"} <= set(command)
    assert answer(*command[2:])["read"]["units_contradict"] == []
