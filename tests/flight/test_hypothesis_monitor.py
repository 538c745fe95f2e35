"""The monitor of hypotheses is green just where they hold, and C says the same at every sample."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

import symheli
from studies.cli import main
from symheli.errors import InputError
from symheli.export import write_monitor
from symheli.flight import HypothesisEvents as Events
from symheli.flight import HypothesisMonitor, TableController

CC = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
SPEED = symheli.Scheduling("airspeed", "m/s", 0.0, 13.0, 3.0)
LIMITS = {"d_lon": (-0.2, 0.2), "d_ped": (-0.3, 0.1)}
DT = 0.02


def monitor(speed=SPEED, **options):
    return HypothesisMonitor(speed, DT, LIMITS, ("d_lon", "d_lat", "d_ped"), **options)


def flown(own, readings, seconds=None, commands=None, valid=None):
    """Events at each sample."""
    state, said = own.init(), []
    for k, p in enumerate(readings):
        events, state = own.update(
            state,
            p,
            DT if seconds is None else seconds[k],
            np.zeros(3) if commands is None else commands[k],
            valid=True if valid is None else bool(valid[k]),
        )
        said.append(events)
    return said


def steady(count=40, speed=5.0):
    return np.full(count, speed)


def test_it_is_green_once_the_window_is_full():
    own = monitor()
    said = flown(own, 5.0 + 0.9 * SPEED.limit * DT * np.arange(40))
    assert own.samples == 10
    assert said[:10] == [Events.UNKNOWN] * 10
    assert said[10:] == [Events.MET] * 30


def test_a_parameter_at_just_the_proven_rate_is_within_it():
    """What rounding adds to readings and sums does not count."""
    assert flown(monitor(), SPEED.limit * DT * np.arange(200))[10:] == [Events.MET] * 190


@pytest.mark.parametrize("rate", [3.05, -3.05])
def test_one_percent_more_than_the_rate_is_seen(rate):
    said = flown(monitor(), 6.0 + rate * DT * np.arange(40))
    assert all(Events.RATE in events for events in said[1:])


def test_the_rate_is_judged_as_by_definition():
    """In double precision, by the difference to each sample of the window."""
    own, rng = monitor(noise=0.1), np.random.default_rng(1)
    readings = (6.0 + np.cumsum(rng.uniform(-0.15, 0.15, 3000))).clip(0.1, 12.9)
    readings = readings.astype(np.float32).astype(float)
    said = flown(own, readings)
    found = set()
    for k in range(own.samples, len(readings)):
        back = np.arange(1, own.samples + 1)
        most = SPEED.limit * DT * back + own.noise
        margin = (most - np.abs(readings[k] - readings[k - back])).min()
        if abs(margin) > 1e-4:
            assert (Events.RATE in said[k]) == (margin < 0), k
            found.add(bool(margin < 0))
    assert found == {True, False}


def test_green_readings_are_those_of_a_motion_within_the_rate():
    """Between green readings lies a p(t) that keeps to the rate, within half the noise of each: the
    largest one below them all, raised by that half.
    """
    own, rng = monitor(noise=0.1, window=1.0), np.random.default_rng(3)
    t, found = DT * np.arange(50), set()
    for _ in range(200):
        true = 6.0 + SPEED.limit * DT * np.cumsum(rng.choice([-1.0, 1.0], 50))
        readings = true + rng.uniform(-0.06, 0.06, 50)
        green = not any(Events.RATE in events for events in flown(own, readings))
        cones = readings + SPEED.limit * np.abs(t[:, None] - t)
        motion = cones.min(axis=1) + 0.05
        assert np.abs(np.diff(motion)).max() <= SPEED.limit * DT + 1e-9
        assert green == (np.abs(motion - readings).max() <= 0.05 + 1e-5)
        found.add(green)
    assert found == {True, False}


def test_no_number_no_trust_and_a_late_sample_are_never_green():
    own, n = monitor(), 10
    for broken in ("nan", "inf", "valid", "late", "early", "no time"):
        readings, seconds, valid = steady(), np.full(40, DT), np.ones(40)
        where = {"nan": readings, "inf": readings, "valid": valid}.get(broken, seconds)
        where[20] = {
            "nan": np.nan,
            "inf": np.inf,
            "valid": 0,
            "late": 2 * DT,
            "early": 0.5 * DT,
            "no time": np.nan,
        }[broken]
        said = flown(own, readings, seconds, valid=valid)
        assert said[19] == Events.MET
        reason = Events.MISSING if broken in ("nan", "inf", "valid") else Events.PERIOD
        assert reason in said[20]
        after = n if reason == Events.PERIOD else n + 1
        assert all(Events.UNKNOWN in events for events in said[20 : 20 + after]), broken
        assert said[20 + after] == Events.MET, broken


def test_it_knows_the_ends_of_the_range_and_of_the_commands():
    own = monitor()
    readings = np.concatenate([steady(20, 12.99), steady(20, 13.01)])
    said = flown(own, readings)
    assert Events.RANGE not in said[19]
    assert all(Events.RANGE in events for events in said[20:])
    commands = np.zeros((40, 3))
    commands[20, 0], commands[21, 2], commands[22, 1] = 0.2, -0.31, 1e6
    commands[23, 1], commands[24, 1] = np.nan, np.inf
    said = flown(own, steady(), commands=commands)
    assert said[20] == said[21] == Events.SATURATED
    assert said[22] == Events.MET  # d_lat has no limits
    assert Events.MISSING in said[23]
    assert Events.MISSING in said[24]
    assert said[25] == Events.MET


def test_an_arbitrarily_fast_parameter_has_no_rate():
    fast = symheli.Scheduling("airspeed", "m/s", 0.0, 13.0)
    said = flown(monitor(fast), np.tile([1.0, 12.0], 20))
    assert said[10:] == [Events.MET] * 30


def table(**options):
    return TableController(
        (0.0, 13.0), np.zeros((2, 1, 2)), (), ("p",), ("d_lat",), DT, rate=2.0, **options
    )


def test_it_is_made_of_a_controller_and_of_what_is_proven():
    own = HypothesisMonitor.of(table(limits={"d_lat": (-0.1, 0.1)}))
    assert (own.scheduling.low, own.scheduling.high, own.scheduling.limit) == (0.0, 13.0, 2.0)
    assert (own.dt, own.limits, list(own.outputs)) == (DT, {"d_lat": (-0.1, 0.1)}, ["d_lat"])
    proven = symheli.Scheduling("airspeed", "m/s", 1.0, 20.0, 1.5)
    own = HypothesisMonitor.of(table(), proven)
    assert (own.scheduling.low, own.scheduling.high, own.scheduling.limit) == (1.0, 13.0, 1.5)
    with pytest.raises(InputError, match="over 20 to 29: nothing in common"):
        HypothesisMonitor.of(table(), symheli.Scheduling("airspeed", "m/s", 20.0, 29.0, 1.0))
    with pytest.raises(InputError, match=r"over airspeed \(m/s\)"):
        HypothesisMonitor.of(table(), symheli.Scheduling("mach", "1", 0.0, 0.1))
    with pytest.raises(InputError, match="as a number"):
        monitor(symheli.Scheduling("airspeed", "m/s", 0.0, 13.0, "acceleration"))
    with pytest.raises(InputError, match="jitter"):
        monitor(jitter=0.0)
    with pytest.raises(InputError, match="at most"):
        monitor(window=1e3)
    with pytest.raises(InputError, match="positive seconds"):
        monitor(window=-1.0)


def compiled(own, folder, flags=()):
    write_monitor(own, folder, "own")
    command = [
        CC,
        *STRICT,
        *flags,
        "-ffp-contract=off",
        "-shared",
        "-fPIC",
        "own.c",
        "-o",
        "own.so",
    ]
    subprocess.run(command, cwd=folder, check=True)
    code, state = ctypes.CDLL(str(folder / "own.so")), np.full(2100, np.nan, np.float32)
    at = ctypes.c_void_p(state.ctypes.data)
    code.own_init(at)

    def update(p, seconds, command, valid):
        command = np.asarray(command, np.float32)
        assert np.isnan(state[-1])  # nothing is written beyond, and it lives on
        return code.own_update(
            at,
            ctypes.c_float(p),
            ctypes.c_int(int(valid)),
            ctypes.c_float(seconds),
            ctypes.c_void_p(command.ctypes.data),
        )

    return update


@pytest.mark.skipif(CC is None, reason="no C compiler")
@pytest.mark.parametrize("options", [{}, {"window": DT}, {"noise": 0.2, "window": 0.5}])
def test_c_says_what_python_says(tmp_path, options):
    own, rng = monitor(**options), np.random.default_rng(2)
    update, count = compiled(own, tmp_path), 4000
    readings = 6.0 + 5.0 * np.sin(0.01 * np.arange(count)) + rng.normal(0, 0.01, count)
    readings[rng.integers(count, size=60)] = rng.choice([np.nan, np.inf, -1.0, 40.0], 60)
    seconds = DT * (1 + rng.normal(0, 0.02, count))
    seconds[rng.integers(count, size=20)] = np.nan
    commands = rng.normal(0, 0.06, (count, 3))
    commands[rng.integers(count, size=20), 1] = np.nan
    valid = rng.random(count) > 0.005
    said = flown(own, readings, seconds, commands, valid)
    in_c = [update(*row) for row in zip(readings, seconds, commands, valid, strict=True)]
    assert in_c == [int(events) for events in said]
    together = Events(0)
    for events in said:
        together |= events
    assert together == Events(63)
    assert Events.MET in said


@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_the_check_beside_it_passes_and_notices_another_number(tmp_path):
    own = monitor()
    write_monitor(own, tmp_path)
    for edit, status in ((None, 0), (("rate = 0x1.8", "rate = 0x1.7"), 1)):
        source = tmp_path / "monitor.c"
        if edit:
            text = source.read_text()
            assert edit[0] in text
            source.write_text(text.replace(*edit))
        command = [CC, *STRICT, "monitor.c", "monitor_check.c", "-o", "check"]
        subprocess.run(command, cwd=tmp_path, check=True)
        done = subprocess.run([str(tmp_path / "check")], capture_output=True, text=True)
        assert done.returncode == status, done.stdout
    assert "400 of 400" not in done.stdout


def test_the_command_takes_range_and_rate_from_a_certificate(tmp_path, capsys):
    import synthesis

    table(limits={"d_lat": (-0.1, 0.1)}).save(tmp_path / "c.json")
    speed = symheli.Scheduling("airspeed", "m/s", 2.0, 9.0, 1.25)
    lag = symheli.LPVStateSpace.polynomial(
        [[[-1.0]], [[-0.1]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], speed
    )
    synthesis.l2_gain(lag).save(tmp_path / "proof.json")
    words = ["export", "monitor", "--model", str(tmp_path / "c.json"), "--out", str(tmp_path)]
    assert main([*words, "--certificate", str(tmp_path / "proof.json")]) == 0
    header = (tmp_path / "monitor.h").read_text()
    assert "range     2 to 9" in header
    assert "<= 1.25 (t(k) - t(k-j))" in header
    assert "MONITOR_Y_d_lat 0 /* rad, -0.1 to 0.1 */" in header
    assert main([*words, "--reading-error", "0.3", "--rate-window", "0.5", "--jitter", "0.2"]) == 0
    header = (tmp_path / "monitor.h").read_text()
    assert "<= 2 (t(k) - t(k-j)) + 0.3   for j = 1 .. 25" in header
    assert "0.016 to 0.024 s since" in header
    synthesis.l2_gain(lag.discretize(0.05)).save(tmp_path / "other.json")
    assert main([*words, "--certificate", str(tmp_path / "other.json")]) == 1
    assert "sample period of 0.05 s" in capsys.readouterr().err
    assert main([*words, "--certificate", str(tmp_path / "c.json")]) == 1
    assert main(["export", "monitor"]) == 1
    assert "name the controller" in capsys.readouterr().err


@pytest.mark.parametrize("ends", [(np.nan, np.nan), (np.nan, 0.2), (0.2, -0.2), (1,), ("x", 2)])
def test_limits_that_no_command_can_reach_are_refused(ends):
    """Not a number as an end was never reached: green whatever was commanded."""
    with pytest.raises(InputError, match=r"limits\['d_lon'\]: expected \(low, high\)"):
        HypothesisMonitor(SPEED, DT, {"d_lon": ends})


def test_what_32_bits_cannot_hold_is_refused_or_infinite():
    with pytest.raises(InputError, match="in another unit"):
        monitor(symheli.Scheduling("airspeed", "m/s", 0.0, 1e39, 3.0))
    with pytest.raises(InputError, match="samples at most"):
        HypothesisMonitor(SPEED, 1e-300, LIMITS, window=1e300)
    said = flown(monitor(), np.append(steady(20), 1e300), commands=np.full((21, 3), 0.05))
    assert Events.MISSING in said[20]
