"""symheli tune: from a flight and a change of gains to a verdict, and to a file of parameters."""

import numpy as np
import pytest

import symheli
from evidence.tuning import THROW, parameters
from studies.autopilot.tuned import LEAST, loop_margins
from symheli import AirspeedSchedule, Excitation
from symheli.airframe.written import as_toml
from symheli.errors import InputError
from symheli.flight import HelicopterLoops
from symheli.logs.parameters import read_parameters
from synthesis.design.loops.loop_measures import MEASURES

KEPT = ["d_lon", "d_lat", "d_col", "d_ped", "u", "v", "w", "p", "q", "r", "phi", "theta"]
THROWS = ("--throw", *(f"{u}={v}" for u, v in THROW.items()))
GAIN, DOUBLED, MUCH = (f"ATC_RAT_RLL_P={k * 0.02}" for k in (1, 2, 30))


@pytest.fixture(scope="module")
def loops():
    return HelicopterLoops.from_parameters(parameters(), throw=THROW)


@pytest.fixture(scope="module")
def folder(ideal, loops, tmp_path_factory):
    """A flight of a quarter of a minute, the autopilot's parameters, and a vehicle file whose
    inertias are wrong and uncertain, and all else known to 0.1 %.
    """
    folder = tmp_path_factory.mktemp("tune")
    flight = symheli.fly(
        ideal,
        AirspeedSchedule((6.0, 2.0), (2.0, 2.0), (2.0, 2.0)),
        controller=loops,
        excitation=Excitation(
            {"d_lon": 0.005, "d_lat": 0.004, "d_col": 0.008, "d_ped": 0.012},
            "multisine",
            (0.05, 4.0),
            1,
        ),
        noise_db=30.0,
        seed=1,
    )
    flight.select(KEPT).to_csv(folder / "flight.csv")
    text = "".join(f"{name},{value}\n" for name, value in parameters().items())
    (folder / "heli.param").write_text(text)
    (folder / "true.toml").write_text(as_toml(ideal.vehicle))
    wrong = ideal.vehicle.with_values({"body.Ixx": 0.25, "body.Iyy": 0.28})
    (folder / "mine.toml").write_text(as_toml(wrong))
    return folder


@pytest.fixture
def tune(answer, folder):
    def call(*words, vehicle="true.toml"):
        return answer(
            "tune",
            folder / "flight.csv",
            "--vehicle",
            folder / vehicle,
            "--parameters",
            folder / "heli.param",
            *THROWS,
            *words,
        )

    return call


@pytest.fixture
def refusal(run, folder):
    """The message of a command that fails; the parameters are those of the file where named."""

    def call(*words, parameters="heli.param"):
        files = ("--vehicle", folder / "true.toml", "--parameters", folder / parameters)
        status, out, err = run("tune", folder / "flight.csv", *files, *words)
        assert status != 0
        assert not out
        return err

    return call


def eigenvalues(heli, loops, airspeed):
    """Of plant and loops, closed by hand."""
    model = symheli.linearize(heli, symheli.trim(heli, airspeed))
    P = model.discretize(loops.dt).select(inputs=THROW, outputs=loops.linear.inputs)
    K = loops.linear
    A = np.block([[P.A + P.B @ K.D @ P.C, P.B @ K.C], [K.B @ P.C, K.A]])
    return np.abs(np.linalg.eigvals(A))


def test_a_change_that_keeps_the_loops_stable_is_shown_before_and_after(tune, ideal, loops):
    """As it is: the margins of the vehicle file, whose linear model closed by hand is stable."""
    found = tune("--as-it-is", "--set", DOUBLED, "--airspeeds", "0,6")
    assert eigenvalues(ideal, loops.with_parameters({"ATC_RAT_RLL_P": 0.04}), 6.0).max() < 1
    assert "all loops are stable" in found["verdict"]
    by = {(row["airspeed"], row["control"]): row for row in found["before"]}
    (lateral,) = (row for row in loop_margins([ideal], loops, [6.0]) if row.control == "d_lat")
    own = lateral.measures["gain"]
    assert by[6.0, "d_lat"]["gain"] == pytest.approx(own, rel=1e-6)  # file of 9 digits
    after = {(row["airspeed"], row["control"]): row for row in found["after"]}
    assert after[6.0, "d_lat"]["gain"] < by[6.0, "d_lat"]["gain"] - 1.0
    assert abs(after[6.0, "d_ped"]["gain"] - by[6.0, "d_ped"]["gain"]) < 0.5
    assert found["change"] == {"ATC_RAT_RLL_P": 0.04}


def test_margins_are_where_the_loops_become_unstable(ideal, loops):
    """All loops closed: the roll's output times the gain margin, just below and just above."""
    (row,) = (r for r in loop_margins([ideal], loops, [6.0]) if r.control == "d_lat")
    for factor, stable in ((0.999, True), (1.001, False)):
        more = THROW | {"d_lat": THROW["d_lat"] * factor * 10 ** (row.measures["gain"] / 20)}
        worst = eigenvalues(ideal, HelicopterLoops(loops.axes, loops.dt, loops.gyro, None, more), 6)
        assert bool(worst.max() < 1) is stable


def test_delay_and_servos_cost_phase(ideal, loops):
    def phase(**given):
        (row,) = (r for r in loop_margins([ideal], loops, [4.0], **given) if r.control == "d_lat")
        return row.measures["phase"], row.measures["crossover"]

    alone, late = phase(), phase(delay=0.04)
    lost = np.degrees(0.04 * alone[1])  # at the crossover, and coupling moves that
    assert late[0] == pytest.approx(alone[0] - lost, abs=0.15 * lost)
    servo = symheli.Servo(natural_frequency=40.0, damping=0.7)
    servos = dict.fromkeys(map(str, ideal.inputs), servo)
    assert phase(servos=servos)[0] < alone[0] - 1.0
    with pytest.raises(InputError, match=r"0.03 s is no whole number of samples of 0.02 s"):
        loop_margins([ideal], loops, [4.0], delay=0.03)


def test_a_gain_thirty_times_too_large_is_called_unstable(tune, ideal, loops, folder):
    written = folder / "new.param"
    found = tune("--as-it-is", "--set", MUCH, "--airspeeds", "0,6", "--write", written)
    changed = loops.with_parameters({"ATC_RAT_RLL_P": 0.6})
    for airspeed in (0.0, 6.0):
        assert eigenvalues(ideal, changed, airspeed).max() > 1
    assert "UNSTABLE at 0, 6 m/s: do not fly it" in found["verdict"]
    assert not any(row["stable"] for row in found["after"])
    assert all(row["stable"] for row in found["before"])
    assert "# After the change the loops are UNSTABLE" in written.read_text()


@pytest.mark.slow
def test_responses_are_shown_before_and_after_and_written_with_a_figure(tune, ideal, loops, folder):
    pytest.importorskip("matplotlib")
    out = folder / "figures"
    words = ("--as-it-is", "--set", DOUBLED, "--airspeeds", "0,6", "--out", out)
    found = tune(*words)
    lateral = next(row for row in found["after"] if row["airspeed"] == 6.0)
    changed = loops.with_parameters({"ATC_RAT_RLL_P": 0.04})
    (true, *_) = loop_margins([ideal], changed, [6.0])
    for name in LEAST:
        assert lateral[name] == pytest.approx(true.measures[name], rel=1e-5, abs=1e-6), name
        assert lateral[f"{name}_band"] == LEAST[name]  # one helicopter: no spread
        assert found["units"][name] == MEASURES[name].unit
    rows = np.genfromtxt(out / "tune.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    assert rows["change"].tolist() == ["before"] * 6 + ["after"] * 6
    assert rows["rejection"][9] == pytest.approx(lateral["rejection"])
    assert "</svg>" in (out / "tune.svg").read_text()


def test_a_proof_that_fails_says_why_and_stands_among_the_hypotheses(tune):
    """The rate of the airspeed is that of the command."""
    words = ("--airspeeds", "4,6", "--prove", "1", "--rate", "2")
    found = tune("--as-it-is", "--set", MUCH, *words)
    assert found["between"]["proven"] is False
    assert found["between"]["rate"] == {"value": 2.0, "unit": "m/s^2"}
    assert found["between"]["unstable_half_way"] == [5.0]
    assert "NOT PROVEN that the changed loops are stable" in found["hypotheses"][1]
    assert "from 4 to 6 m/s with |dV/dt| <= 2 m/s^2" in found["hypotheses"][1]


def test_the_written_parameters_have_the_hypotheses_in_their_head(tune, folder):
    written = folder / "written.param"
    words = ("--airspeeds", "4", "--servo", "40", "--delay", "0.04", "--write", written)
    found = tune("--as-it-is", "--set", DOUBLED, *words)
    head = [line[2:] for line in written.read_text().splitlines() if line.startswith("# ")]
    assert head[0].startswith("Changed by symheli tune. Load these by hand")
    assert head[1:] == [*found["hypotheses"], found["verdict"]]
    for words in ("delay 0.04 s", "servos 40 rad/s", "deflection at full output d_lat 0.15 rad"):
        assert words in head[1]
    assert read_parameters(written) == {"ATC_RAT_RLL_P": 0.04}


def test_helicopters_that_differ_in_stability_are_not_called_either(ideal, loops):
    """One whose inertias are a third, with a gain at which it alone is unstable."""
    inertias = ("body.Ixx", "body.Iyy", "body.Izz")
    light = ideal.with_parameters({name: ideal.parameters[name] / 3 for name in inertias})
    changed = loops.with_parameters({"ATC_RAT_RLL_P": 0.15})
    alone = [loop_margins([h], changed, [2.0])[0].stable for h in (ideal, light)]
    assert alone == [True, False]
    assert loop_margins([ideal, light], changed, [2.0])[0].stable is None


def test_what_is_missing_or_unknown_is_refused(refusal, folder):
    assert "nothing is changed: give --set NAME=VALUE" in refusal()
    assert "did you mean 'ATC_RAT_RLL_P'" in refusal("--set", "ATC_RAT_ROLL_P=0.1")
    assert "unknown control 'd_alt'" in refusal("--set", DOUBLED, "--throw", "d_alt=0.1")
    (folder / "short.param").write_text("ATC_RAT_RLL_P,0.02\n")
    said = refusal("--set", DOUBLED, parameters="short.param")
    assert "parameters are missing: ATC_RAT_RLL_I" in said
    assert "expected NAME,VALUE" in refusal("--set", DOUBLED, parameters="flight.csv")


def test_wind_and_windows_are_those_of_the_calibration(refusal, monkeypatch):
    """What the command hands on; what it does is tested with `calibrate`."""
    given = {}

    def calibrate(heli, record, **options):
        given.update(options)
        raise InputError("far enough")

    monkeypatch.setattr("identification.calibrate", calibrate)
    assert "far enough" in refusal("--set", DOUBLED, "--gust", "2", "--window", "0.5")
    assert given == {"gust": 2.0, "window": 0.5}


@pytest.mark.slow
def test_a_calibrated_flight_leaves_the_true_margins_in_the_bands(tune, ideal, loops):
    """From inertias 40 % wrong, all parameters free."""
    found = tune("--set", DOUBLED, "--airspeeds", "2,6", "--draws", "12", vehicle="mine.toml")
    true = loop_margins([ideal], loops.with_parameters({"ATC_RAT_RLL_P": 0.04}), [2.0, 6.0])
    for row, truth in zip(found["after"], true, strict=True):
        assert row["stable"] is truth.stable is True
        assert abs(row["gain"] - truth.measures["gain"]) <= row["gain_band"]
        assert abs(row["phase"] - truth.measures["phase"]) <= row["phase_band"]
        assert row["gain_band"] < 3.0
