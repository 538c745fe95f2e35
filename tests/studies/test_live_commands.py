"""symheli live and serve: from the command line to what is printed and written."""

import json
import math

import numpy as np
import pytest

import identification
import symheli
from studies import cli
from studies.live.identifier import LAG, LiveIdentifier
from studies.live.stream import Row
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


def test_live_coefficients_are_those_of_the_batch_fit(flight):
    """Of the same rows, with the lagged airspeed as the schedule."""
    _, record = flight
    live, slow = learnt(record), [record["airspeed"][0]]
    for V in record["airspeed"][1:]:
        slow.append(slow[-1] + (1.0 - math.exp(-record.dt / LAG)) * (V - slow[-1]))
    lagged = record.with_signals({"airspeed_slow": "m/s"}, airspeed_slow=np.array(slow))
    batch = identification.fit(live.structure, lagged, method="ls").aerodynamics
    found = live.model().aerodynamics
    assert found.rows_used == batch.rows_used
    fitted = batch.theta / np.abs(batch.theta).max(axis=0)
    np.testing.assert_allclose(
        found.theta / np.abs(batch.theta).max(axis=0), fitted, rtol=1e-6, atol=1e-9
    )


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


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere.csv"], "sources are xplane, mavlink and a CSV file"),
        (["xplane:localhost:abc"], "expected xplane:HOST:PORT"),
        (["xplane", "--airspeeds", "5", "5"], "expected 0 <= LOW < HIGH"),
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
    assert found["flown"] >= 5.0
    assert found["samples"] == pytest.approx(found["flown"] / 0.02)
