"""Flights kept on disk: whole chunks, going on after a stop, read by others."""

import errno
import json
import os
import signal
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest
from flight.flown import SHORT, STIRRED

import symheli
from symheli.errors import InputError, SymheliError
from symheli.flight import XCELL_SERVOS, FlightDataset, fly_batch, fly_campaign, gain_scheduled_lqr
from symheli.flight.batch import CHUNK

COUNT = 2 * CHUNK + 5


@pytest.fixture(scope="module")
def pilot():
    return gain_scheduled_lqr(symheli.Helicopter.load("xcell60", governor="ideal"), 0.0, 13.0, 0.02)


@pytest.fixture
def campaign(ideal, pilot):
    def run(path, **options):
        given = {"seeds": range(COUNT), "controller": pilot, "excitation": STIRRED, **options}
        return fly_campaign(ideal, SHORT, path, **given)

    return run


def test_a_campaign_keeps_what_a_batch_flies(ideal, pilot, campaign, tmp_path):
    flights = fly_batch(ideal, SHORT, seeds=range(COUNT), controller=pilot, excitation=STIRRED)
    kept = campaign(tmp_path / "flights.zarr")
    assert len(kept) == COUNT
    assert kept.finished.all()
    assert not kept.lost.any()
    for name in ("phi", "e_d_lon", "theta_reference"):
        np.testing.assert_array_equal(kept[name], flights.column(name))
    record = kept.record(COUNT - 1)
    np.testing.assert_array_equal(record.values, flights[-1].values)
    assert record.signals == flights[-1].signals
    assert [s.unit for s in record.signals] == [s.unit for s in flights[-1].signals]


def test_a_stopped_campaign_goes_on_where_it_was(campaign, tmp_path):
    whole = campaign(tmp_path / "whole.zarr", signals=["q"])

    class EnoughError(Exception):
        pass

    def give_up(done, count):
        if done >= CHUNK:
            raise EnoughError

    path = tmp_path / "stopped.zarr"
    with pytest.raises(EnoughError):
        campaign(path, signals=["q"], workers=1, progress=give_up)
    stopped = FlightDataset(path)
    there = stopped.finished
    assert CHUNK <= there.sum() < COUNT
    np.testing.assert_array_equal(stopped["q"][there], whole["q"][there])
    assert np.isnan(stopped["q"][~there]).all()
    before = {p: p.stat().st_mtime_ns for p in (path / "values").glob("[0-9]*")}
    seen = []
    again = campaign(path, signals=["q"], progress=lambda done, count: seen.append(done))
    assert seen[0] == there.sum()
    assert seen[-1] == COUNT
    np.testing.assert_array_equal(again["q"], whole["q"])
    assert all(p.stat().st_mtime_ns == stamp for p, stamp in before.items())  # not flown twice


@pytest.mark.slow
def test_a_killed_campaign_loses_nothing_finished(campaign, tmp_path):
    path = tmp_path / "killed.zarr"
    script = textwrap.dedent(f"""
        import time, symheli
        from flight.flown import SHORT, STIRRED
        heli = symheli.Helicopter.load("xcell60", governor="ideal")
        pilot = symheli.flight.gain_scheduled_lqr(heli, 0.0, 13.0, 0.02)
        symheli.flight.fly_campaign(heli, SHORT, {str(path)!r}, seeds=range({COUNT}), signals=["q"],
                             controller=pilot, excitation=STIRRED, workers=1,
                             progress=lambda done, count: time.sleep(done and 60))
    """)
    here = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    environment = {**os.environ, "PYTHONPATH": here}
    process = subprocess.Popen([sys.executable, "-c", script], env=environment)
    try:
        deadline = time.monotonic() + 60
        while not (path / "duration" / "0").is_file():
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.05)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert FlightDataset(path).finished.sum() >= CHUNK
    whole = campaign(tmp_path / "whole.zarr", signals=["q"])
    np.testing.assert_array_equal(campaign(path, signals=["q"])["q"], whole["q"])


def test_other_flights_are_not_mixed_in(campaign, tmp_path):
    path = tmp_path / "flights.zarr"
    campaign(path, signals=["q"], seeds=range(3))
    for other in (
        {"seeds": range(4)},
        {"signals": ["p"]},
        {"servos": XCELL_SERVOS},
        {"wind": (1.0, 0.0, 0.0)},
        {"controller": None},
    ):
        with pytest.raises(InputError, match="holds flights of another vehicle, other plans"):
            campaign(path, **{"signals": ["q"], "seeds": range(3), **other})
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match="exists and does not hold flights"):
        campaign(mine)
    assert [p.name for p in mine.iterdir()] == ["thesis.tex"]


def test_a_full_disk_leaves_what_is_finished(campaign, tmp_path, monkeypatch):
    path = tmp_path / "flights.zarr"
    first = campaign(tmp_path / "whole.zarr", signals=["q"])
    fsync, calls = os.fsync, []

    def full(handle):
        calls.append(handle)
        if len(calls) > 24:
            raise OSError(errno.ENOSPC, "No space left on device")
        fsync(handle)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(SymheliError, match="the disk is full"):
        campaign(path, signals=["q"], workers=1)
    monkeypatch.undo()
    there = FlightDataset(path).finished
    np.testing.assert_array_equal(FlightDataset(path)["q"][there], first["q"][there])
    np.testing.assert_array_equal(campaign(path, signals=["q"])["q"], first["q"])


def test_a_lost_flight_is_marked_and_kept_until_it_was(ideal, pilot, tmp_path):
    wild = symheli.Excitation({"d_lon": 0.5, "d_lat": 0.5}, band=(0.1, 0.5))
    plans = [
        symheli.FlightPlan(SHORT, controller=pilot),
        symheli.FlightPlan(SHORT, controller=pilot, excitation=wild),
    ]
    kept = fly_campaign(ideal, plans, tmp_path / "flights.zarr")
    assert kept.lost.tolist() == [False, True]
    flights = fly_batch(ideal, plans)
    np.testing.assert_array_equal(kept.record(1).values, flights[1].values)
    assert kept.duration[1] == pytest.approx(flights[1].time[-1])


def test_damaged_datasets_say_so(campaign, tmp_path):
    path = tmp_path / "flights.zarr"
    kept = campaign(path, signals=["q"], seeds=range(3))
    chunk = path / "values" / "0.0.0"
    chunk.write_bytes(chunk.read_bytes()[:-8])
    with pytest.raises(InputError, match=r"0\.0\.0: .* bytes, expected .*; remove it and resume"):
        kept["q"]
    (path / "values" / ".zarray").write_text("{")
    with pytest.raises(InputError, match="no dataset of flights"):
        FlightDataset(path)
    with pytest.raises(InputError, match="no dataset of flights"):
        FlightDataset(tmp_path / "nowhere")
    with pytest.raises(InputError, match="flight 7 of 3 does not exist"):
        campaign(tmp_path / "other.zarr", seeds=range(3)).record(7)


def test_the_folder_is_zarr(campaign, tmp_path):
    """Version 2: metadata by its specification, chunks of raw little-endian numbers."""
    path = tmp_path / "flights.zarr"
    kept = campaign(path, signals=["q", "phi"], seeds=range(3))
    about = json.loads((path / "values" / ".zarray").read_text())
    assert about["shape"] == [3, len(kept.time), 2]
    assert about["chunks"] == [CHUNK, len(kept.time), 2]
    raw = np.fromfile(path / "values" / "0.0.0", "<f8").reshape(about["chunks"])
    np.testing.assert_array_equal(raw[:3, :, 1], kept["phi"])
    assert json.loads((path / ".zgroup").read_text()) == {"zarr_format": 2}
    assert json.loads((path / "values" / ".zattrs").read_text()) == {
        "_ARRAY_DIMENSIONS": ["flight", "time", "signal"]
    }
    zarr = pytest.importorskip("zarr", reason="zarr itself reads it where it is installed")
    group = zarr.open_group(path, mode="r")
    np.testing.assert_array_equal(group["values"][:, :, 1], kept["phi"])
    assert group["signal"][:].tolist() == ["q", "phi"]
