"""symheli live and serve: from the command line to what is printed and written."""

import json
import math
import signal
import subprocess
import sys

import numpy as np
import pytest

import identification
import symheli
from studies import cli
from studies.live.identifier import ENOUGH_SAMPLES, LAG, LiveIdentifier
from studies.live.recorder import Recorder
from studies.live.sample import Sample
from studies.live.stream import Row, Stream
from studies.live.watch import Watch
from symheli import FlightRecord

DEFLECTIONS = ("d_lon", "d_lat", "d_col", "d_ped")


@pytest.fixture(scope="module")
def flight():
    """Two minutes between 1 and 5 m/s without noise, and the helicopter."""
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    schedule = symheli.AirspeedSchedule((5.0, 1.0) * 6, (1.0,) * 12, (4.0,) * 12, start=1.0)
    excitation = symheli.Excitation(dict.fromkeys(heli.inputs, 0.01), "multisine", (0.05, 4.0))
    return heli, symheli.fly(heli, schedule, excitation=excitation)


def learnt(record, rows=slice(None)):
    """An identifier that has taken in the rows of a record."""
    identifier = LiveIdentifier(DEFLECTIONS, 0.0, 6.0, record.dt)
    for t, values in zip(record.time[rows], record.columns(identifier.signals)[rows], strict=True):
        identifier.take(Row(float(t), values))
    return identifier


def with_slow_airspeed(record):
    """The record with the lagged airspeed, sample by sample."""
    slow = [record["airspeed"][0]]
    for V in record["airspeed"][1:]:
        slow.append(slow[-1] + (1.0 - math.exp(-record.dt / LAG)) * (V - slow[-1]))
    return record.with_signals({"airspeed_slow": "m/s"}, airspeed_slow=np.array(slow))


def test_live_coefficients_are_those_of_the_batch_fit(flight):
    """Of the same rows, with the lagged airspeed as the schedule."""
    _, record = flight
    live, lagged = learnt(record), with_slow_airspeed(record)
    batch = identification.fit(live.structure, lagged, method="ls").aerodynamics
    found = live.model().aerodynamics
    assert found.rows_used == batch.rows_used
    fitted = batch.theta / np.abs(batch.theta).max(axis=0)
    np.testing.assert_allclose(
        found.theta / np.abs(batch.theta).max(axis=0), fitted, rtol=1e-6, atol=1e-9
    )


@pytest.mark.parametrize("lost", [False, True])
def test_the_trim_of_a_live_model_is_that_of_the_flight(flight, lost):
    """It is what the kinematics are linearized about; rows lost in bursts move it little."""
    _, record = flight
    rows = np.ones(len(record), bool)
    if lost:
        for k in np.random.default_rng(0).integers(0, len(record) - 20, len(record) // 200):
            rows[k : k + 10] = False
    live = learnt(record, rows)
    batch = identification.fit(live.structure, with_slow_airspeed(record), method="ls")
    model = live.model()
    sizes = np.array([1.0] * 3 + [0.1] * 5)
    speeds = np.linspace(1.0, 5.0, 9)
    off = (live.structure.basis(speeds) @ (model.trim - batch.trim)) / sizes
    assert np.abs(off).max() < 0.2  # means of an excited motion over a tenth of its samples
    u = (live.structure.basis(speeds) @ model.trim)[:, 0]
    np.testing.assert_allclose(u, speeds, rtol=0.01)  # level flight, not rest
    for V in (2.0, 4.0):
        A, B = np.asarray(model.at(V).A), np.asarray(batch.at(V).A)
        assert np.abs(A - B).max() < 0.03 * np.abs(B).max()


def test_control_powers_are_those_of_the_linearization(flight):
    """With its flapping settled, to the damping within a sample."""
    heli, record = flight
    linear = symheli.linearize(heli, symheli.trim(heli, 3.0))
    A, B = np.asarray(linear.A), np.asarray(linear.B)
    flap = np.array([str(s) in ("a1", "b1") for s in linear.states])
    settled = B - A[:, flap] @ np.linalg.solve(A[flap][:, flap], B[flap])
    for power in learnt(record).control_powers([3.0]):
        at = list(linear.states).index(power.output), DEFLECTIONS.index(power.control)
        assert power.value == pytest.approx(settled[at], rel=0.02)


def test_standard_errors_of_control_powers_are_their_scatter(flight, monkeypatch):
    """Of 200 sets of coefficients drawn from their covariance."""
    _, record = flight
    rng, found = np.random.default_rng(0), []
    live = learnt(record)
    expected = [p.error for p in live.control_powers([3.0])]
    state = live.online.state
    n = live.structure.n_regressors
    R, theta = state.factor[:n, :n], state.solve()
    noise = np.linalg.cholesky(state.residual_covariance)
    for _ in range(200):
        moved = theta + np.linalg.solve(R, rng.normal(size=theta.shape) @ noise.T)
        monkeypatch.setattr(type(state), "solve", lambda _, moved=moved: moved)
        found.append([p.value for p in live.control_powers([3.0])])
    np.testing.assert_allclose(np.std(found, axis=0), expected, rtol=0.2)


@pytest.mark.parametrize("clock", [0.0, 1000.0])
def test_nothing_is_learnt_across_a_gap(flight, clock):
    """Rows that do not follow are a start, on whatever clock."""
    _, record = flight
    identifier = LiveIdentifier(DEFLECTIONS, 0.0, 6.0, record.dt)
    rows = record.columns(identifier.signals)
    taught = [
        identifier.take(Row(record.time[k] + clock * (k >= 100), rows[k]))
        for k in (*range(50), *range(100, 110))
    ]
    assert taught[50:54] == [False, False, True, True]


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A flight of half a minute with excitation, as a log of deflections."""
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    schedule = symheli.AirspeedSchedule((5.0, 1.0, 4.0), (2.0,) * 3, (6.0,) * 3, start=1.0)
    excitation = symheli.Excitation(dict.fromkeys(heli.inputs, 0.01), "multisine", (0.05, 4.0))
    record = symheli.fly(heli, schedule, excitation=excitation, noise_db=40.0)
    path = tmp_path_factory.mktemp("live") / "flight.csv"
    names = ("u", "v", "w", "p", "q", "r", "phi", "theta", "airspeed", *map(str, heli.inputs))
    record.select(names).to_csv(path)
    return path, len(record)


def test_a_record_that_comes_again_is_identified(log, tmp_path, capsys):
    path, samples = log
    words = ["live", str(path), "--speed", "1000", "--inputs", "d_lon,d_lat,d_col,d_ped"]
    words += ["--airspeeds", "0", "6", "--degree", "1", "--record", str(tmp_path / "again.csv")]
    words += ["--save", str(tmp_path / "model.json")]
    assert cli.main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["samples"] == samples
    assert found["states"] == {"GOOD": samples}
    assert found["learnt"] > 0.98 * samples
    powers = {p["output"]: p for p in found["control_power"]}
    assert set(powers) == {"p", "q", "r", "w"}
    again = FlightRecord.from_csv(tmp_path / "again.csv")
    np.testing.assert_array_equal(again["q"], FlightRecord.from_csv(path)["q"])
    from identification.model import KinematicModel

    assert KinematicModel.load(tmp_path / "model.json").dt == pytest.approx(0.02)


def test_a_reader_sees_tables(log, capsys):
    path, samples = log
    words = ["live", str(path), "--speed", "1000", "--inputs", "d_lon,d_lat,d_col,d_ped"]
    assert cli.main([*words, "--airspeeds", "0", "6", "--degree", "1"]) == 0
    out = capsys.readouterr().out
    assert f"{samples} samples from flight.csv: GOOD {samples}" in out
    assert "control power" in out
    assert "p by d_lat" in out


SHORT = ("--speed", "1000", "--airspeeds", "0", "6", "--degree", "1")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "has no stick_lon, stick_lat, stick_col, stick_ped: --inputs names the controls"),
        (["--inputs", "d_lon,d_foo"], "it has u, v, w, p, q, r, phi, theta, airspeed, d_lon"),
        (["--inputs", "d_lon", "--rate", "100"], "has 50 samples a second: leave --rate out"),
        (["--inputs", "d_lon", "--rate", "2000"], "expected 1 to 1000 Hz"),
        (["--inputs", "d_lon", "--record", "no/a.csv"], "make the folder no first"),
    ],
)
def test_what_a_record_cannot_give_is_said(log, words, message, capsys):
    assert cli.main(["live", str(log[0]), *SHORT, *words]) == 1
    assert message in capsys.readouterr().err


@pytest.fixture
def slow(log, tmp_path):
    """Every other line of the log: 25 Hz."""
    head, *lines = log[0].read_text().splitlines()
    (tmp_path / "slow.csv").write_text("\n".join([head, *lines[::2]]))
    return tmp_path / "slow.csv"


def test_a_file_is_learnt_at_its_own_rate(slow, capsys):
    words = ["live", str(slow), *SHORT, "--inputs", ",".join(DEFLECTIONS), "--json"]
    assert cli.main(words) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["learnt"] <= found["samples"]
    assert {p["control"] for p in found["control_power"]} == set(DEFLECTIONS)


def test_a_report_is_printed_where_no_model_can_be_saved(log, tmp_path, capsys):
    head, *lines = log[0].read_text().splitlines()
    (tmp_path / "short.csv").write_text("\n".join([head, *lines[:20]]))
    words = ["live", str(tmp_path / "short.csv"), *SHORT, "--inputs", ",".join(DEFLECTIONS)]
    assert cli.main([*words, "--save", str(tmp_path / "a.json")]) == 1
    out = capsys.readouterr().out
    assert "20 samples from short.csv" in out
    assert "no model is saved" in out


def watched(source, identifier, rate=50.0):
    """A watch with a record of what comes from a source."""
    return Watch(source, identifier, Stream(identifier.signals, 1.0 / rate))


class Samples:
    """A source of samples that are there."""

    name = "samples"

    def __init__(self, samples):
        self.left = list(samples)

    def receive(self, timeout):
        if not self.left:
            raise EOFError
        return [self.left.pop(0)]

    def close(self):
        pass


def test_a_signal_that_never_comes_is_named(flight):
    _, record = flight
    identifier = LiveIdentifier(DEFLECTIONS, 0.0, 6.0)
    rows = [dict(zip(record.signals, row, strict=True)) for row in record.values[:100]]
    for row in rows:
        del row["airspeed"], row["d_ped"]
    watch = watched(Samples(Sample(0.02 * k, row, "a") for k, row in enumerate(rows)), identifier)
    watch.run(10.0, print)
    assert "no number has come of d_ped, airspeed" in watch.line()


@pytest.mark.parametrize(
    ("hz", "gap", "said"), [(50, 0.0, False), (30, 0.0, True), (50, 4.0, False)]
)
def test_samples_that_come_too_slowly_are_said(hz, gap, said):
    """One gap is nothing."""
    values = dict.fromkeys(LiveIdentifier(["stick"], 0.0, 6.0).signals, 0.0)
    samples = [Sample(k / hz + gap * (k > 180), values, "a") for k in range(200)]
    watch = watched(Samples(samples), LiveIdentifier(["stick"], 0.0, 6.0))
    for sample in samples:
        watch.take(sample, sample.time)
    assert ("only 30 samples come a second: give --rate 30" in watch.line()) == said


def test_another_vehicle_is_neither_recorded_nor_counted(tmp_path):
    values = dict.fromkeys(LiveIdentifier(["stick"], 0.0, 6.0).signals, 0.0)
    samples = [Sample(0.02 * k, values, "ab"[k % 2]) for k in range(20)]
    watch = watched(Samples(samples), LiveIdentifier(["stick"], 0.0, 6.0), 25.0)
    watch.recorder = Recorder(tmp_path / "a.csv", ("q",))
    watch.run(10.0, print)
    assert watch.received == len(FlightRecord.from_csv(tmp_path / "a.csv")) == 10


def test_the_next_airspeed_is_the_nearest_and_moves_on(flight):
    """Each advice that is followed gives another, until every airspeed is covered."""
    identifier, row = LiveIdentifier(["stick"], 0.0, 6.0), 1
    V, advice = 3.5, []
    identifier.take(Row(0.0, np.array([0.0] * 9 + [V])))
    while (said := identifier.next_to_fly()) != "every airspeed is covered":
        assert said not in advice
        advice.append(said)
        V = float(said.split()[2]) + 0.5
        for _ in range(ENOUGH_SAMPLES + 400):  # and until the lagged airspeed is there
            values = [0.0] * 8 + [math.sin(0.1 * row), V]
            identifier.take(Row(0.02 * row, np.array(values)))
            row += 1
    assert [one.split()[2] for one in advice] == ["3", "2", "1", "0", "4", "5"]


@pytest.mark.usefixtures("interruptible")
def test_an_interrupted_watch_reports_and_leaves_a_whole_record(log, tmp_path):
    """Ctrl-C in the middle of a flight at its own pace."""
    words = ["live", str(log[0]), "--inputs", ",".join(DEFLECTIONS), "--degree", "0"]
    code = "import sys; from studies.cli import main; sys.exit(main(sys.argv[1:]))"
    words += ["--record", str(tmp_path / "a.csv")]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", code, *words], **pipes) as watching:
        while "learnt" not in (said := watching.stderr.readline()):
            assert said
        watching.send_signal(signal.SIGINT)
        out, _ = watching.communicate(timeout=30)
    assert watching.returncode == 0
    samples = int(out.split()[0])
    assert 20 < samples == len(FlightRecord.from_csv(tmp_path / "a.csv"))
    assert (tmp_path / "a.csv").read_text().count("\n") == samples + 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere.csv"], "sources are xplane, mavlink and a CSV file"),
        (["xplane:localhost:abc"], "expected xplane:HOST:PORT"),
        (["xplane", "--airspeeds", "5", "5"], "expected 0 <= LOW < HIGH"),
        (["xplane:127.0.0.1:70000"], "expected 1 to 65535"),
        (["xplane", "--inputs", "d_lon"], "has no d_lon"),
        (["xplane:127.0.0.1:9", "--duration", "0.2"], "nothing came from X-Plane at 127.0.0.1:9"),
    ],
)
def test_what_cannot_be_watched_is_said(words, message, capsys):
    assert cli.main(["live", *words]) == 1
    assert message in capsys.readouterr().err


def test_a_vehicle_serves_until_its_time_is_over(capsys):
    """At 50 times real time; nobody listens, which stops nothing."""
    words = ["serve", "--duration", "5", "--speed", "50", "--xplane", "0", "--noise"]
    assert cli.main([*words, "--airspeeds", "1", "3", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert 5.0 <= found["flown"] < 15.0  # to the end of a leg
    assert found["samples"] == pytest.approx(found["flown"] / 0.02)


def test_a_served_flight_is_excited_to_its_end(monkeypatch):
    """Its excitation is as long as its schedule, which takes little more than the duration."""
    made = {}

    def fly(heli, schedule, controller, **_):
        made.update(schedule=schedule, added=controller._added)

    monkeypatch.setattr(symheli, "fly", fly)
    assert cli.main(["serve", "--duration", "70", "--xplane", "0"]) == 0
    assert 70.0 <= made["schedule"].duration < 92.0
    assert len(made["added"]) * 0.02 >= made["schedule"].duration
    assert np.abs(made["added"][-100:]).max() > 0.0
