"""symheli circle through sockets and processes: from the command line to what is written."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from circle_in_process import AtOnce, quick

import symheli
from studies import cli
from studies.circle import circle
from studies.circle.circle import Circle, Phase
from studies.circle.vehicle import PERIOD, Vehicle, VehicleProcess
from studies.live.identifier import LiveIdentifier
from studies.live.sample import STICKS
from studies.live.stream import Stream, StreamState
from studies.live.watch import Watch
from studies.live.xplane import XPlaneSource
from symheli import FlightRecord


def children(session):
    """Processes of a session that are left."""
    found = subprocess.run(["ps", "-o", "pid=", "-s", str(session)], capture_output=True, text=True)
    return found.stdout.split()


@pytest.mark.slow
def test_on_the_wire_the_controls_change_hands(monkeypatch):
    """In real time, with a design that is made before."""
    monkeypatch.setattr(circle, "LEARN", 12.0)
    vehicle = Vehicle(duration=120.0, noise=False)
    heli = vehicle.helicopter
    design = quick(symheli.fly(heli, vehicle.plan(heli)).between(0.0, 110.0), "xcell60")
    said, identifier = [], LiveIdentifier(STICKS, 0.0, 13.0, PERIOD)
    with VehicleProcess(replace(vehicle, duration=30.0), 1.0) as process:
        source = XPlaneSource(port=process.port)
        pilot = Circle(vehicle, source, AtOnce(), said.append, lambda record, name: design)
        watch = Watch(source, identifier, Stream(identifier.signals, PERIOD), None, pilot)
        watch.run(60.0, said.append, over=lambda: process.over)
    assert process.error is None
    assert "has the sticks: gain" in pilot.events[1].what
    (switch,) = pilot.switches[:1]
    assert switch.at <= max(0.02, 1.5 * switch.before)
    assert watch.stream.counts[StreamState.GOOD] > 0.95 * watch.received
    if pilot.phase is not Phase.CONTROLLING:
        pytest.skip("the machine was too busy for 50 commands a second")
    last = pilot.record(5.0)
    assert np.nanmax(np.abs(last["airspeed"] - last["airspeed_command"])) < 1.5
    assert not pilot.reasons()
    assert watch.data()["lamp"]["green"] == (not watch.lamp.reasons)


@pytest.mark.slow
def test_a_short_flight_ends_without_a_controller(tmp_path, capsys):
    """Status 1 and the reason; the record is whole; the vehicle's process is gone."""
    out = tmp_path / "flown"
    status = cli.main(["circle", "--duration", "12", "--speed", "4", "--out", str(out), "--json"])
    data = json.loads(capsys.readouterr().out)
    assert status == 1
    assert not data["lamp"]["green"]
    assert any("no controller flies yet" in reason for reason in data["lamp"]["reasons"])
    assert data["pilot"]["phase"] == "IDENTIFYING"
    record = FlightRecord.from_csv(out / "flight.csv")
    assert len(record) > 400
    assert np.ptp(record["airspeed"]) > 1.0
    assert cli.main(["circle", "--duration", "12", "--out", str(out)]) == 1
    assert "has a flight already" in capsys.readouterr().err


@pytest.mark.slow
def test_ctrl_c_ends_the_vehicle_too(tmp_path):
    """Within seconds; what came is kept."""
    words = [sys.executable, "-m", "studies.cli", "circle", "--duration", "300"]
    running = subprocess.Popen(
        [*words, "--out", str(tmp_path / "out")],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )
    try:
        for line in running.stderr:
            if "samples learnt" in line and " 0 samples" not in line:
                break
        begin = time.monotonic()
        os.kill(running.pid, signal.SIGINT)
        running.stderr.read()
        running.wait(timeout=30)
        assert time.monotonic() - begin < 10.0
    finally:
        running.kill()
        running.stderr.close()
    assert (tmp_path / "out" / "flight.csv").stat().st_size > 1000
    time.sleep(0.5)
    assert children(running.pid) == []


def test_a_vehicle_that_is_not_there_is_refused_before_it_flies(capsys):
    """In one sentence."""
    assert cli.main(["circle", "--vehicle", "no_such"]) == 1
    assert "no_such" in capsys.readouterr().err


def test_a_process_that_cannot_fly_says_why():
    """Its error is kept."""
    with VehicleProcess(Vehicle(duration=5.0), port=70000) as process:
        end = time.monotonic() + 60.0
        while not process.over and time.monotonic() < end:
            time.sleep(0.05)
    assert "port 70000" in str(process.error)


def test_a_change_after_the_flight_is_refused(tmp_path, capsys):
    """Nothing would change; no folder is made."""
    words = ["circle", "--duration", "20", "--change", "60", "--out", str(tmp_path / "out")]
    assert cli.main(words) == 1
    assert "--change: the flight ends at" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
