"""What identify says rests on the numbers it prints, and on predictions that know no more of p than
a pilot would.
"""

import json
import re
import warnings

import numpy as np
import pytest

import symheli
from identification import LPVARX, Polynomial, fit
from identification.judge import Scores, compare_constant
from identification.judge.against_constant import AgainstConstant, Scored, difference
from studies import cli
from symheli.errors import DataWarning
from symheli.records import FlightRecord


def judged(lpv, lti, *rivals, **over):
    """A comparison of models of one output with these held-out fits (1 s, free run)."""
    rng = np.random.default_rng(0)
    u, p = rng.standard_normal((2, 200))
    record = FlightRecord.from_arrays(
        0.1 * np.arange(200), dict.fromkeys("yup", "1"), y=np.cumsum(u) * 0.1, u=u, p=p
    )
    model = fit(
        LPVARX("y", "u", "p", na=1, nb=1, delay=1, basis=Polynomial(1, p.min(), p.max())), record
    )
    scores = [
        Scores(horizon=1.0, one_step={"y": 99.0}, ahead={"y": ahead}, free_run={"y": free})
        for ahead, free in (lpv, lti, *rivals)
    ]
    labels = ("LPV", "LTI", "LPV, moving trim", "LTI, moving trim")
    models = []
    for label, given in zip(labels, scores, strict=False):
        one = Scored(label=label, model=model, training=record, test=record, hold_p=False)
        vars(one).update(in_sample=given, held_out=given)  # as if they had been asked for
        models.append(one)
    return AgainstConstant(
        models=tuple(models),
        training=record,
        test=record,
        **over,
    )


@pytest.mark.parametrize(
    ("lpv", "lti", "verdict", "costs", "words"),
    [
        (
            (97.3, 97.0),
            (97.3, 85.6),
            "pays",
            False,
            "scheduling pays .*97.3 against 97.3 % .*no different., 97.0 against 85.6 % .*better.",
        ),
        (
            (96.0, 80.0),
            (90.0, 79.5),
            "pays for prediction only",
            False,
            r"scheduling pays for prediction only on .*\(better\), .*\(no different\)",
        ),
        (
            (90.5, 80.0),
            (90.0, 79.5),
            "does NOT pay",
            False,
            r"scheduling does NOT pay on held-out data: .*\(no different\), .*\(no different\)",
        ),
        (
            (91.04, 1.0),
            (90.05, 1.0),
            "does NOT pay",
            False,
            r"91.0 against 90.0 % 1 s ahead \(no different\)",
        ),  # as printed: exactly one point
        (
            (97.4, 1.0),
            (96.4, 1.0),
            "does NOT pay",
            False,
            "no different",
        ),  # whose difference in binary exceeds one
        (
            (96.0, 60.0),
            (90.0, 79.5),
            "pays for prediction only",
            True,
            r"scheduling pays for prediction only .*\(better\), .*\(worse\)",
        ),
        (
            (85.0, 79.5),
            (90.0, 60.0),
            "does NOT pay",
            True,
            r"scheduling does NOT pay .*\(worse\), .*\(better\)",
        ),
        (
            (80.0, -5.0),
            (70.0, -500.0),
            "pays for prediction only",
            False,
            r"-5.0 against -500.0 % in free run \(neither better than the mean of the record\)",
        ),
        (
            (80.0, -np.inf),
            (70.0, 30.0),
            "pays for prediction only",
            True,
            r"diverges against 30.0 % in free run \(worse\)",
        ),
        (
            (-20.0, -5.0),
            (-90.0, -np.inf),
            "does NOT pay",
            False,
            "scheduling does NOT pay on held-out data",
        ),
    ],
)
def test_a_verdict_follows_from_the_numbers_beside_it(lpv, lti, verdict, costs, words):
    """`costs`: better at one horizon, worse at the other."""
    found = judged(lpv, lti)
    (sentence,) = found.verdict()
    assert re.search(words, sentence), sentence
    assert found.verdict_on("y") == verdict
    assert sentence.startswith(f"y: scheduling {verdict} on held-out data")
    assert found.pays("y") is (verdict != "does NOT pay" and not costs)


def test_the_other_treatment_of_the_trim_is_heard_where_it_says_otherwise():
    found = judged((80.0, 80.0), (80.0, 80.0), (90.0, 85.0), (70.0, 60.0))
    own, other = found.verdict()
    assert "does NOT pay" in own
    assert other.startswith(
        "LPV, moving trim beside LTI, moving trim would say otherwise: y: scheduling pays on"
        " held-out data: 90.0 against 70.0"
    )
    assert len(judged((80.0, 80.0), (80.0, 80.0), (80.0, 80.0), (80.0, 80.0)).verdict()) == 1


def test_a_free_run_that_is_told_its_answer_is_not_counted():
    assert judged((90.0, 99.9), (90.0, 50.0)).verdict_on("y") == "pays"
    told = judged((90.0, 99.9), (90.0, 50.0), hold_p=True, leak=0.9)
    assert told.verdict_on("y") == "does NOT pay"
    told = judged((93.0, 99.9), (90.0, 50.0), hold_p=True, leak=0.9)
    assert told.verdict_on("y") == "pays for prediction only"
    assert "99.9 against 50.0 % in free run (not counted)" in told.verdict()[0]


def test_no_number_is_no_difference():
    assert difference(np.nan, 50.0) == difference(50.0, np.nan) == "no data to compare"


def about_a_trim(n=3000, seed=0, decimals=9):
    """An output about a trim x0(p) that moves fast; the text of a log, time in s."""
    rng = np.random.default_rng(seed)
    k = np.arange(n)
    p = 6.5 + 5 * np.sin(2 * np.pi * k / 400) + np.sin(2 * np.pi * k / 37)
    x0, u = 0.2 * p - 0.01 * p**2, np.repeat(rng.standard_normal(n // 4), 4)
    y = x0.copy()
    for j in range(1, n):
        y[j] = (
            x0[j]
            + (0.9 + 0.006 * (p[j - 1] - 6.5)) * (y[j - 1] - x0[j - 1])
            + (0.02 + 0.004 * p[j - 1]) * u[j - 1]
        )
    y += 0.01 * y.std() * rng.standard_normal(n)
    return "\n".join(
        [
            "t,y,u,p",
            *(f"{0.05 * i:.2f},{y[i]:.{decimals}g},{u[i]:.9g},{p[i]:.9g}" for i in range(n)),
        ]
    )


OPTIONS = (
    "--outputs",
    "y",
    "--inputs",
    "u",
    "--scheduling",
    "p",
    "--na",
    "1",
    "--nb",
    "1",
    "--units",
    "y=rad",
    "u=1",
    "p=m/s",
)


@pytest.fixture
def identify(tmp_path, capsys):
    """What `symheli identify` answers as data and as text, of a log written first."""

    def call(log, *options):
        (tmp_path / "log.csv").write_text(log)
        answers = []
        for form in (("--json",), ()):
            assert (
                cli.main(
                    ["identify", str(tmp_path / "log.csv"), *OPTIONS, *map(str, options), *form]
                )
                == 0
            )
            answers.append(capsys.readouterr().out)
        return json.loads(answers[0]), answers[1]

    return call


@pytest.mark.slow
def test_a_moving_trim_is_tried_and_kept_where_it_predicts_better(identify):
    data, text = identify(about_a_trim(), "--commanded")
    assert data["judged"] == ["LPV, degree 2, moving trim", "LTI, moving trim"]
    held = {
        label: model["fit_percent"]["held_out"]["1 s"]["y"]
        for label, model in data["models"].items()
    }
    assert held["LPV, degree 2, moving trim"] > held["LPV, degree 2"] + 5
    assert "offset_rate, the moving trim, in sample: " in text
    assert "judged is the model with" in text
    assert "p is taken as known ahead, as a command is" in text
    data, text = identify(about_a_trim(), "--commanded", "--offset-rate", "no")
    assert set(data["models"]) == {"LPV, degree 2", "LTI"}
    assert "offset_rate" not in text


@pytest.mark.slow(but=("p-options3", "y-options0", "u-options1", "p-options2"))
@pytest.mark.parametrize(
    ("column", "options"),
    [
        ("y", ()),
        ("u", ()),
        ("p", ()),
        ("p", ("--degree", 0)),
        ("p", ("--smooth-scheduling", 0.1)),
        ("p", ("--offset-rate", "no")),
        ("p", ("--scheduling-at", "now")),
        ("p", ("--method", "rls")),
        ("p", ("--decimate", 2)),
        ("p", ("--plot", "fits.png", "--bands", "bands.png", "--save", "model.json")),
    ],
)
def test_empty_cells_of_any_column_are_skipped(identify, tmp_path, monkeypatch, column, options):
    monkeypatch.chdir(tmp_path)
    head, *rows = about_a_trim(1500).splitlines()
    cells = [row.split(",") for row in rows]
    for k in np.random.default_rng(0).choice(len(cells), 100, replace=False):
        cells[k]["tyup".index(column)] = ""
    found, text = identify("\n".join([head, *map(",".join, cells)]), *options)
    assert found["read"]["samples_with_missing_values"] >= 95
    assert "slow modes" in text
    assert "nan" not in text


@pytest.mark.slow
def test_a_measured_p_is_held_from_the_start_of_each_prediction(identify):
    """The trim's motion within a second is news to whoever schedules on a measurement."""
    ahead = {c: identify(about_a_trim(), *c)[0] for c in ((), ("--commanded",))}
    fits = [
        found["models"]["LPV, degree 2, moving trim"]["fit_percent"]["held_out"]["1 s"]["y"]
        for found in ahead.values()
    ]
    assert fits[0] < fits[1] - 10
    assert [found["scheduling_held"] for found in ahead.values()] == [True, False]


@pytest.mark.slow
def test_means_are_identified_with_feedthrough_unless_told_otherwise(identify):
    log = about_a_trim(6000)
    auto, text = identify(log, "--commanded", "--decimate", 4)
    assert auto["models"]["LTI"]["coefficients"]["input_lags"] == [0, 1]
    assert "nb 2, delay 0," in text
    assert "samples are means of 4 samples: y(k) may depend on u(k)" in text
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        late, _ = identify(log, "--commanded", "--decimate", 4, "--delay", 1)
    one, two = (
        f["models"]["LPV, degree 2, moving trim"]["fit_percent"]["held_out"]["1 s"]["y"]
        for f in (auto, late)
    )
    assert one > two + 5


def test_another_log_is_held_out_as_a_whole(identify, tmp_path):
    (tmp_path / "other.csv").write_text(about_a_trim(1000, seed=7))
    data, text = identify(about_a_trim(2000), "--commanded", "--test", tmp_path / "other.csv")
    assert (data["read"]["training_samples"], data["read"]["held_out_samples"]) == (2000, 1000)
    assert "held out: other.csv, all 1000 samples" in text
    assert (
        cli.main(
            [
                "identify",
                str(tmp_path / "log.csv"),
                *OPTIONS,
                "--test",
                str(tmp_path / "other.csv"),
                "--train",
                "0.5",
            ]
        )
        == 1
    )


@pytest.mark.slow(but="iv-options0")
@pytest.mark.parametrize(
    ("method", "options"),
    [("iv", ("--instruments", "u")), ("ridge", ()), ("rls", ()), ("bj", ()), ("armax", ())],
)
def test_the_estimator_is_chosen_and_named(identify, method, options):
    data, text = identify(about_a_trim(), "--commanded", "--method", method, *options)
    assert data["method"] == method
    assert f"by {method}" in text
    assert (data["standard_errors"] is None) == (method != "rls")
    assert ("first-stage F" in text) == (method == "iv")


def test_instruments_for_a_method_that_takes_none_are_refused(tmp_path, capsys):
    log = tmp_path / "log.csv"
    log.write_text(about_a_trim())
    assert cli.main(["identify", str(log), *OPTIONS, "--instruments", "u"]) == 1
    said = "--instruments are for --method armax, bj, iv, oe, riv.*, not ls"
    assert re.search(said, capsys.readouterr().err)


@pytest.mark.slow
def test_a_scheduling_signal_made_of_outputs_is_found_and_its_free_runs_are_not_counted(identify):
    rng = np.random.default_rng(0)
    u, y, p = rng.standard_normal(3000), np.zeros(3000), np.zeros(3000)
    for k in range(1, 3000):
        y[k] = 0.97 * y[k - 1] + 0.05 * u[k - 1] + 0.2 * rng.standard_normal()
        p[k] = p[k - 1] + 0.2 * (y[k] - p[k - 1])
    log = "\n".join(
        ["t,y,u,p", *(f"{0.05 * k:.2f},{y[k]:.9g},{u[k]:.9g},{p[k]:.9g}" for k in range(3000))]
    )
    data, text = identify(log)
    assert data["scheduling_leak"] == pytest.approx(1.0, abs=1e-6)
    assert "offset_rate is not tried: 100 % of what is new in p is in the outputs" in text
    assert "free runs are told what they predict, and are not counted" in text
    assert "(not counted)" in text


def test_the_moving_trim_is_not_tried_where_the_data_cannot_tell_it():
    """p steps once: its change is not zero at one sample only."""
    rng = np.random.default_rng(0)
    u, p = rng.standard_normal(300), np.repeat([1.0, 2.0, 3.0], 100)
    y = np.convolve(u, 0.8 ** np.arange(40))[:300] * p + p
    record = FlightRecord.from_arrays(
        0.1 * np.arange(300), dict.fromkeys("yup", "1"), y=y, u=u, p=p
    )
    arx = LPVARX("y", "u", "p", na=1, nb=1, delay=1, basis=Polynomial(2, 1.0, 3.0), offset=True)
    found = compare_constant(arx, record, None, trim="auto")
    assert found.trim_note.startswith("offset_rate is not tried: the regressors have rank")
    assert len(found.models) == 2


def flown_csv(path, heli, **factors):
    """A flight as a table without units, signals times factors."""
    record = symheli.fly(
        heli,
        symheli.AirspeedSchedule.transition(0.0, 13.0, acceleration=3.0),
        excitation=symheli.Excitation({"d_lon": 0.012, "d_lat": 0.012, "d_ped": 0.03}),
    )
    names = ("p", "q", "r", "phi", "theta", "d_lon", "airspeed_command")
    table = [record.time, *(factors.get(name, 1.0) * record[name] for name in names)]
    np.savetxt(path, np.stack(table, axis=1), delimiter=",", header=",".join(("t", *names)))
    return path


@pytest.mark.slow
def test_rates_in_degrees_are_noticed_before_anything_is_believed(tmp_path, ideal, capsys):
    asked = ("--outputs", "q,theta", "--inputs", "d_lon", "--scheduling", "airspeed_command")
    sound = flown_csv(tmp_path / "sound.csv", ideal)
    assert cli.main(["identify", str(sound), *asked, "--na", "2"]) == 0
    assert "kinematics: consistent: p, q, r, phi, theta\n" in capsys.readouterr().out
    wrong = flown_csv(tmp_path / "wrong.csv", ideal, p=180 / np.pi)
    assert cli.main(["identify", str(wrong), *asked, "--na", "2", "--json"]) == 0
    rows = {row["signal"]: row for row in json.loads(capsys.readouterr().out)["kinematics"]}
    assert "it is in deg/s, declare that unit" in rows["p"]["verdict"]
    assert rows["p"]["scale"]["value"] == pytest.approx(180 / np.pi, rel=0.01)
    assert rows["q"]["verdict"] == "consistent"
