"""The library for ArduPilot compiles against declarations as ArduPilot has them, and flies the
exported controller by a clock of its own.
"""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from export.test_exported_controller import TABLES

from evidence import on_board
from symheli.export import write_controller, write_monitor
from symheli.flight import HypothesisEvents, HypothesisMonitor, StepEvents

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "ardupilot"
STRICT = ("-O2", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off")
COUNT = 300
JITTER = 0.15
"""Of a period: a loop of 400 Hz is up to 2.6 ms late for a sample of 20 ms."""

FLIGHT = """
#include <stdio.h>
#include <AP_AHRS/AP_AHRS.h>
#include <AP_HAL/AP_HAL.h>
#include "AP_LPVControl.h"
static uint32_t now;
static int sample;
static Vector3f gyro;
static Matrix3f turn;
uint32_t AP_HAL::micros() { return now; }
void Matrix3f::to_euler(float *roll, float *pitch, float *yaw) const
{
    *roll = 0.0001f * sample;
    *pitch = -0.002f;
    *yaw = 3;
}
Vector3f Matrix3f::mul_transpose(const Vector3f &v) const { return Vector3f(v.z, v.x, v.y); }
const Vector3f &AP_AHRS::get_gyro() const { return gyro; }
const Matrix3f &AP_AHRS::get_rotation_body_to_ned() const { return turn; }
bool AP_AHRS::get_velocity_NED(Vector3f &vec) const
{
    vec = Vector3f(0.02f, 0.03f, 0.01f);
    return sample != 7;
}
bool AP_AHRS::airspeed_TAS(float &speed) const 
{
    // stuck in the end
    speed = sample < 200 ? 5 + 0.01f * sample : 7;
    return sample != 12;
}
AP_AHRS &AP::ahrs() { static AP_AHRS own; return own; }
int main()
{
    AP_LPVControl own;
    float reference[CONTROLLER_NU] = {0}, trim[CONTROLLER_NY] = {0};
    now = 4294967296u - 1000000u; // micros overflow on the way
    for (int k = 0; sample < COUNT; k++) {
        now += k % 3 ? 2400 : 2600; // a loop of 400 Hz, 2467 us in the mean
        gyro = Vector3f(0.0001f * sample, 0.01f, -0.01f);
        if (!own.update(reference, trim)) continue;
        for (int i = 0; i < CONTROLLER_NY; i++) printf("%a ", (double)own.command()[i]);
        printf("%d %d %d %u\\n", own.certified(), own.status(), own.hypotheses(), (unsigned)now);
        sample++;
    }
}
"""


@pytest.fixture
def library(tmp_path):
    """The folder of the library, with a controller and its monitor in it."""
    folder = tmp_path / "AP_LPVControl"
    shutil.copytree(EXAMPLE / "AP_LPVControl", folder)
    table = TABLES["position"]()
    write_controller(table, folder)
    write_monitor(HypothesisMonitor.of(table, jitter=JITTER), folder)
    for check in folder.glob("*_check.c"):
        check.unlink()
    return folder


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler")
def test_it_flies_the_controller_by_its_own_clock(library):
    (library / "flight.cpp").write_text(FLIGHT.replace("COUNT", str(COUNT)))
    for name in ("controller.c", "monitor.c"):
        command = ["gcc", "-std=c99", *STRICT, "-c", name]
        subprocess.run(command, cwd=library, check=True)
    command = ["g++", "-std=c++11", *STRICT, "-I", str(EXAMPLE / "stub"), "-I", "."]
    sources = ["flight.cpp", "AP_LPVControl.cpp", "controller.o", "monitor.o", "-o", "flight"]
    subprocess.run([*command, *sources], cwd=library, check=True)
    done = subprocess.run([str(library / "flight")], capture_output=True, text=True, check=True)
    rows = [line.split() for line in done.stdout.splitlines()]
    said = np.array([[float.fromhex(x) for x in row[:-4]] for row in rows], np.float32)
    events = [HypothesisEvents(int(row[-2])) for row in rows]
    times = np.array([int(row[-1]) for row in rows], np.uint32)

    table = TABLES["position"]()
    monitor = HypothesisMonitor.of(table, jitter=JITTER)
    state, watched, expected, hypotheses = table.init(), monitor.init(), [], []
    certified = []
    before = np.concatenate([[0], times[:-1]]).astype(np.uint32)
    elapsed = (times - before).astype(np.float32) * np.float32(1e-6)
    one = np.float32(1e-4)
    for k in range(COUNT):
        where = dict(u=0.01, v=0.02, w=0.03, q=0.01, r=-0.01, theta=-0.002)
        where |= dict(p=one * np.float32(k), phi=one * np.float32(k))
        if k == 7:
            where |= dict.fromkeys("uvw", np.nan)
        measured = np.array([where[str(s)] for s in table.inputs], np.float32)
        V = np.float32(7) if k >= 200 else np.float32(5) + np.float32(0.01) * np.float32(k)
        u, state = table.update(state, measured, np.zeros(8), np.zeros(4), V, valid=k != 12)
        valid = StepEvents.PARAMETER not in state.status
        event, watched = monitor.update(watched, V, elapsed[k], u, valid=valid)
        certified.append(event == HypothesisEvents.MET and not state.status)
        expected.append(u)
        hypotheses.append(event)
    np.testing.assert_array_equal(said, np.array(expected))
    assert events == hypotheses
    assert [int(row[-4]) for row in rows] == certified
    assert 100 < sum(certified) < 230  # not of a sensor that is stuck
    periods = np.diff(times).astype(np.int64)  # of 32 bits: the overflow is none
    assert abs(periods.mean() - 20000) < 20
    assert periods.min() >= 20000 - 2600
    assert HypothesisEvents.MISSING in events[12]
    assert not any(HypothesisEvents.PERIOD in event for event in events)
    assert HypothesisEvents.MET in events


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("arm-none-eabi-g++") is None, reason="no arm-none-eabi-g++")
@pytest.mark.parametrize("core", on_board.CORES)
def test_it_compiles_for_the_board_as_a_library(library, core):
    flags = [*on_board.CORES[core], "-mthumb", "-mfloat-abi=hard", *STRICT, "-I"]
    plain = ["-std=gnu++11", "-fno-exceptions", "-fno-rtti", *flags, str(EXAMPLE / "stub")]
    command = ["arm-none-eabi-g++", *plain, "-fstack-usage", "-c", "AP_LPVControl.cpp"]
    subprocess.run(command, cwd=library, check=True)
    listing = subprocess.run(
        ["arm-none-eabi-nm", "-u", "AP_LPVControl.o"],
        cwd=library,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    taken = set(re.findall(r"U (\S+)", listing))
    assert not {s for s in taken if "malloc" in s or "Znw" in s}
    usage = (library / "AP_LPVControl.su").read_text().split()
    assert "dynamic" not in usage
