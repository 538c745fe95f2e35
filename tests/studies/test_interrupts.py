"""Ctrl-C is answered within two seconds, in the middle of whatever takes long."""

import signal
import subprocess
import sys
import time

import pytest

BEGIN = "print('begins', flush=True)\n"
LIMIT = 2.0
OTHERS = 1.5
"""Seconds for other work on the machine."""

HELI = """
import numpy as np
import symheli
heli = symheli.Helicopter.load("xcell60", governor="ideal")
"""
LATERAL = (
    HELI
    + """
import synthesis
from studies.loops.lateral import lateral_loop
loop = lateral_loop(heli)
"""
)
WORK = {
    "trims by the hundred thousand": (
        HELI
        + "symheli.trim_batch(heli, airspeed=[5.0, 6.0])\n"
        + BEGIN
        + "speeds = np.linspace(0, 15, 300_000)\nsymheli.trim_batch(heli, airspeed=speeds)"
    ),
    "a sweep": (
        HELI
        + "symheli.sweep(heli, [5.0, 6.0])\n"
        + BEGIN
        + "symheli.sweep_grid(heli, np.linspace(0, 15, 200), acceleration=np.linspace(-2, 2, 300))"
    ),
    "one long flight": (
        HELI
        + BEGIN
        + "calm = symheli.AirspeedSchedule.transition(0, 13, acceleration=1.0, laps=3000)\n"
        + "symheli.fly(heli, calm)"
    ),
    "flights by the thousand": (
        HELI
        + BEGIN
        + "calm = symheli.AirspeedSchedule.transition(0, 13, acceleration=1.0, laps=40)\n"
        + "symheli.fly_batch(heli, calm, seeds=range(5000), noise_db=30.0)"
    ),
    "flights under a controller in Python": (
        HELI
        + "class Idle:\n    dt = 0.02\n    def reset(self): pass\n"
        + "    def step(self, measured, reference, p): return reference[['d_lon', 'd_lat', 'd_col',"
        + " 'd_ped']] if False else [0.0] * 4\n"
        + BEGIN
        + "while True:\n    try:\n        symheli.fly(heli, symheli.AirspeedSchedule.transition(0,"
        + " 13, acceleration=1.0), controller=Idle())\n    except symheli.FlightLostError:\n"
        + "        pass"
    ),
    "a simulation of many flights": (
        HELI
        + "point = symheli.trim(heli, airspeed=5.0)\n"
        + "x0, u = np.tile(point.x.array, (20_000, 1)), np.tile(point.u.array, (5000, 1))\n"
        + BEGIN
        + "symheli.simulate_batch(heli, x0, u, dt=0.02)"
    ),
    "a compiler": (
        "import os, tempfile\n"
        + "os.environ['SYMHELI_CACHE'] = tempfile.mkdtemp()\n"
        + "from symheli.codegen import compile\n"
        + "body = ''.join(f'x = x * {k}.5 + y; y = y / (x + {k});' for k in range(60_000))\n"
        + BEGIN
        + "compile.library('double f(double x, double y) {' + body + 'return x; }', 'long')"
    ),
    "a certificate, proof and trajectories": (
        LATERAL + BEGIN + "synthesis.l2_gain(loop, rate=3.0, form=synthesis.Spline(segments=64))"
    ),
    "an exact proof": (
        LATERAL
        + "cert = synthesis.l2_gain(loop, rate=1.0, search=None)\n"
        + BEGIN
        + "while True:\n    cert.verify(rigorous=True)"
    ),
}


def interrupted(code, after, status=-signal.SIGINT, arguments=("-c",)):
    """Standard error of a child that was interrupted in the middle; in time, or it fails."""
    child = subprocess.Popen(
        [sys.executable, *arguments, code] if code else [sys.executable, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        if code:
            assert child.stdout.readline() == "begins\n"
        time.sleep(after)
        assert child.poll() is None, "it ended by itself: there was nothing to interrupt"
        begin = time.perf_counter()
        child.send_signal(signal.SIGINT)
        _, err = child.communicate(timeout=60)
    finally:
        child.kill()
        child.wait()
    took = time.perf_counter() - begin
    print(f"{took:.2f} s")
    assert child.returncode == status
    assert took < LIMIT + OTHERS
    return err


@pytest.mark.slow
@pytest.mark.parametrize("what", WORK)
def test_an_interrupt_is_answered_within_two_seconds(what):
    assert interrupted(WORK[what], after=1.0).rstrip().endswith("KeyboardInterrupt")
