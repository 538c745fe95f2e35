"""Ctrl-C is answered within two seconds, in the middle of whatever takes long."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from evidence.damaged_logs import pitch_with_lost_rows

BEGIN = "print('begins', flush=True)\n"
LIMIT = 2.0
"""Seconds of processor time, which other work on the machine does not make longer."""
ENDING = 1.0
"""That Python needs to end when so many libraries are loaded: 0.4 s, measured."""
pytestmark = [
    pytest.mark.skipif(
        not Path("/proc/self/stat").exists(), reason="reads processor times in /proc"
    ),
    pytest.mark.usefixtures("interruptible"),
]

HELI = """
import numpy as np
import symheli
heli = symheli.Helicopter.load("xcell60", governor="ideal")
short = symheli.AirspeedSchedule.transition(4.0, 6.0, acceleration=2.0, hold=0.5)
"""
LATERAL = (
    HELI
    + """
import synthesis
from studies.loops.lateral import lateral_loop
loop = lateral_loop(heli)
"""
)
RECORD = """
import numpy as np
import identification as idn
import symheli
from scipy.signal import lfilter
channels, hour = range(4), 180_000
rng = np.random.default_rng(0)
p = 6.5 + 6.0 * np.sin(2 * np.pi * np.arange(hour) / 3001)
u = rng.standard_normal((hour, 4))
y = lfilter([0.0, 0.1], [1.0, -0.9], u @ rng.standard_normal((4, 4)), axis=0)
y += 0.05 * rng.standard_normal(y.shape)
columns = {f"y{i}": y[:, i] for i in channels} | {f"u{i}": u[:, i] for i in channels} | {"p": p}
units = dict.fromkeys(columns, "1")
record = symheli.FlightRecord.from_arrays(0.02 * np.arange(hour), units, **columns)
arx = idn.LPVARX(
    outputs=tuple(f"y{i}" for i in channels),
    inputs=tuple(f"u{i}" for i in channels),
    scheduling="p", na=3, nb=3, delay=1, basis=idn.Polynomial(2, 0.0, 13.0), offset=True,
)
"""
"""An hour at 50 Hz, four inputs and four outputs, 75 regressors."""
WORK = {
    "trims by the hundred thousand": (
        HELI
        + "symheli.steady.trim_batch(heli, airspeed=[5.0, 6.0])\n"
        + BEGIN
        + "speeds = np.linspace(0, 15, 300_000)\n"
        + "while True:\n    symheli.steady.trim_batch(heli, airspeed=speeds)"
    ),
    "a sweep": (
        HELI
        + "symheli.sweep(heli, [5.0, 6.0])\n"
        + BEGIN
        + "speeds, accelerations = np.linspace(0, 15, 200), np.linspace(-2, 2, 300)\n"
        + "while True:\n    symheli.steady.sweep_grid(heli, speeds, acceleration=accelerations)"
    ),
    "one long flight": (
        HELI
        + "symheli.fly(heli, short)\n"
        + BEGIN
        + "calm = symheli.AirspeedSchedule.transition(0, 13, acceleration=1.0, laps=3000)\n"
        + "symheli.fly(heli, calm)"
    ),
    "flights by the thousand": (
        HELI
        + "symheli.flight.fly_batch(heli, short, seeds=range(8))\n"
        + BEGIN
        + "calm = symheli.AirspeedSchedule.transition(0, 13, acceleration=1.0, laps=40)\n"
        + "symheli.flight.fly_batch(heli, calm, seeds=range(5000), noise_db=30.0)"
    ),
    "flights under a controller in Python": (
        HELI
        + "class Idle:\n    dt = 0.02\n    def reset(self): pass\n"
        + "    def step(self, measured, reference, p): return [0.0] * 4\n"
        + "def lost():\n    try:\n        symheli.fly(heli, short, controller=Idle())\n"
        + "    except symheli.errors.FlightLostError:\n        pass\n"
        + "lost()\n"
        + BEGIN
        + "while True:\n    lost()"
    ),
    "a simulation of many flights": (
        HELI
        + "point = symheli.trim(heli, airspeed=5.0)\n"
        + "x0, u = np.tile(point.x.array, (20_000, 1)), np.tile(point.u.array, (5000, 1))\n"
        + "symheli.integrate.simulate_batch(heli, x0[:9], u[:9], dt=0.02)\n"
        + BEGIN
        + "symheli.integrate.simulate_batch(heli, x0, u, dt=0.02)"
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
        LATERAL
        + BEGIN
        + "synthesis.l2_gain(loop, rate=3.0, form=synthesis.forms.Spline(segments=64))"
    ),
    "the lasso of an hour": RECORD
    + BEGIN
    + "while True:\n    idn.fit(arx, record, method='lasso')",
    "least squares of an hour": RECORD + BEGIN + "while True:\n    idn.fit(arx, record)",
    "recursive least squares over an hour": (
        RECORD
        + "rls = idn.RecursiveLeastSquares(arx)\n"
        + BEGIN
        + "while True:\n    rls.run(record)"
    ),
    "instrumental variables of an hour": (
        RECORD
        + "ways = idn.InstrumentalVariables(tuple(f'u{i}' for i in channels))\n"
        + BEGIN
        + "while True:\n    idn.fit(arx, record, method=ways)"
    ),
    "refined instruments of an hour": (
        RECORD + BEGIN + "while True:\n    idn.fit(arx, record, method='riv')"
    ),
    "output error": (
        RECORD
        + "part = record.rows(np.arange(60_000))\n"
        + BEGIN
        + "while True:\n    idn.fit(arx, part, method='oe')"
    ),
    "filter error": (
        HELI
        + "import identification as idn\n"
        + "long = symheli.AirspeedSchedule.transition(0, 13, acceleration=1.0, laps=20)\n"
        + "excitation = symheli.Excitation(dict.fromkeys(heli.inputs, 0.01))\n"
        + "flight = symheli.fly(heli, long, noise_db=30.0, excitation=excitation)\n"
        + "basis = idn.Polynomial(2, 0.0, 13.0)\n"
        + "kin = idn.KinematicARX(heli.inputs, 'airspeed_command', nb=2, basis=basis)\n"
        + "method = idn.FilterError(symheli.flight.SimulatedFlight(heli))\n"
        + BEGIN
        + "while True:\n    idn.fit(kin, flight, method=method)"
    ),
    "an exact proof": (
        LATERAL
        + "cert = synthesis.l2_gain(loop, rate=1.0, search=None)\n"
        + BEGIN
        + "while True:\n    cert.verify(rigorous=True)"
    ),
}


def interrupted(child):
    """Its standard error after an interrupt, how it ended, and the processor time in between, s,
    with that of the processes that it has waited for.
    """
    assert child.poll() is None, "it ended by itself: there was nothing to interrupt"
    before = spent(child.pid)
    child.send_signal(signal.SIGINT)
    with child.stdout, child.stderr:
        err = child.stderr.read()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    return err, child.returncode, usage.ru_utime + usage.ru_stime - before


def stat(process):
    """The numbers of a line of /proc after the name of the program."""
    return (process / "stat").read_text().rpartition(")")[2].split()


def spent(pid):
    """Processor time of a process and of those it has waited for, s."""
    return sum(map(int, stat(Path("/proc") / str(pid))[11:15])) / os.sysconf("SC_CLK_TCK")


def begun(*arguments):
    return subprocess.Popen(
        [sys.executable, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def worked(pid, seconds):
    """Wait until a process has worked so long, by the processor."""
    end, limit = spent(pid) + seconds, time.monotonic() + 60
    while spent(pid) < end and time.monotonic() < limit:
        time.sleep(0.02)


@pytest.mark.slow
@pytest.mark.parametrize("what", list(WORK)[::3])
def test_an_interrupt_is_answered_within_two_seconds(what):
    child = begun("-c", WORK[what])
    assert child.stdout.readline() == "begins\n"
    worked(child.pid, 1.0)
    err, status, seconds = interrupted(child)
    assert err.rstrip().endswith("KeyboardInterrupt")
    assert status == -signal.SIGINT
    assert seconds < LIMIT + ENDING


@pytest.mark.slow
def test_an_interrupted_identification_ends_in_a_sentence(tmp_path):
    """Of a log of many parts, in the middle of the search."""
    log, file = pitch_with_lost_rows(), tmp_path / "log.csv"
    file.write_text("\n".join(map(",".join, log.rows)), "utf-8")
    child = begun("-m", "studies.cli", "identify", str(file), *log.options, "--method", "oe")
    worked(child.pid, 5.0)
    err, status, seconds = interrupted(child)
    assert status == 130
    assert err.splitlines()[-1].startswith("symheli: interrupted; nothing was written")
    assert "Traceback" not in err
    assert seconds < LIMIT + ENDING


def workers(parent):
    """Processes that compute for this one."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if int(stat(process)[1]) == parent:
                found.append(process)
    return found


@pytest.mark.slow
def test_an_interrupted_study_ends_its_processes_and_says_what_is_kept(tmp_path):
    out = ["--quick", "--out", str(tmp_path)]
    child = begun("-m", "studies.cli", "study", *out)
    end = time.monotonic() + 120
    while not (tmp_path / "stages" / "baseline.stage").exists() and time.monotonic() < end:
        time.sleep(0.1)
    page, text = tmp_path / "report.html", ""
    while 'id="figure-trim"' not in text and time.monotonic() < end:
        time.sleep(0.1)
        text = page.read_text(encoding="utf-8")
    assert "The study is running" in text
    assert "Designing controllers" in text.partition("Still to come")[2].partition("</ul>")[0]
    computing = workers(child.pid)
    err, status, _ = interrupted(child)
    assert status == 130
    assert err.splitlines()[-1] == (
        f"symheli: interrupted; what was finished is in {tmp_path}; --resume goes on from there"
    )
    assert "Traceback" not in err
    assert not [process for process in computing if process.exists()]
    assert (tmp_path / "stages" / "baseline.stage").exists()
    assert '"complete": false' in (tmp_path / "results.json").read_text()
    text = page.read_text(encoding="utf-8")
    assert "The study was interrupted." in text
    assert 'id="figure-trim"' in text
    assert "refresh" not in text
