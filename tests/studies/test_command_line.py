"""What a user types, what comes back, and how it fails."""

import json
import re
import subprocess
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.io import loadmat

import symheli
from identification.model import LPVARXModel
from studies import cli
from studies.commands import study as study_command
from studies.output import as_json
from studies.transition.configuration import Configuration
from symheli.errors import SymheliError

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
TREX_UNITS = ("--units", "q_radps=rad/s", "theta_rad=rad", "lon=1", "u_mps=m/s", "v_mps=m/s")


def test_vehicles_are_listed_with_title_and_source(run, answer):
    assert "MIT X-Cell .60 SE" in run("vehicles")[1]
    assert all(v["source"] for v in answer("vehicles")["vehicles"])


def test_trim_prints_the_numbers_of_the_library_with_units(run, answer):
    got = answer("trim", "--airspeed", "5", "--climb-rate", "-1", "--governor", "pi")
    point = symheli.trim(symheli.Helicopter.load("xcell60"), 5.0, climb_rate=-1.0)
    assert got["inputs"]["d_col"] == {
        "value": pytest.approx(point.u["d_col"], rel=1e-9),
        "unit": "rad",
    }
    status, out, _ = run("trim", "--sideslip-deg", "10", "--airspeed", "4")
    assert status == 0
    assert "theta" in out
    assert "deg" in out


def test_linearize_prints_matrices_with_names_and_poles(run, answer, ideal):
    got = answer("linearize", "--airspeed", "5")
    lin = symheli.linearize(ideal, symheli.trim(ideal, 5.0))
    np.testing.assert_allclose(got["A"], lin.A, atol=1e-9)
    assert got["states"] == list(lin.states)
    assert {"real", "imag"} == set(got["poles_rad_per_s"][0])
    assert "damping ratio" in run("linearize")[1]


def test_doctor_says_what_works_here(run, answer, monkeypatch, tmp_path):
    status, out, _ = run("doctor")
    assert status == 0
    assert "C compiler" in out
    blocked = tmp_path / "file"
    blocked.touch()
    monkeypatch.setenv("SYMHELI_CACHE", str(blocked / "cache"))
    got = answer("doctor")
    assert got["cache_writable"] is False
    assert "CLARABEL" in got["solvers"]
    assert got["compiled_estimator"] == (got["estimator_level"] is not None)


def test_margins_of_the_hold_and_how_near_the_interpolation_comes(answer, ideal):
    got = answer("margins", "--airspeeds", 2, 8, "--points", 4)
    assert [row["airspeed"] for row in got["exact"]] == [2.0, 4.0, 6.0, 8.0]
    for row, near, gap in zip(got["exact"], got["interpolated"], got["nu_gap"], strict=True):
        assert row["stable"]
        assert row["disk_gain"][1] <= row["gain"][1]
        # the cubic runs through four nodes
        assert near["phase"] == pytest.approx(row["phase"], rel=1e-6)
        assert gap < 1e-6


def test_certify_brackets_the_gain_of_a_frozen_loop(answer):
    got = answer("certify", "--rate", 0, "--airspeeds", 4, 9)
    assert got["verified"]
    assert got["frozen"] <= got["lower"] * (1 + 1e-6)
    assert got["lower"] <= got["gamma"] * (1 + 1e-6)


@pytest.mark.slow
def test_certify_takes_a_memory_and_a_degree(answer, run):
    loop = ("certify", "--stability", "--rate", 2, "--airspeeds", 6, 9, "--rigorous")
    assert answer(*loop, "--memory", 0.5, "--segments", 2, "--across", 1, 1)["exact"]
    status, _, err = run("certify", "--order", 2, "--rate", 0, "--airspeeds", 6, 9)
    assert status == 1
    assert "proves stability only" in err


@pytest.mark.slow
def test_a_saved_certificate_is_proven_again_from_its_file(answer, run, tmp_path):
    path = tmp_path / "proof.json"
    made = answer("certify", "--rate", 0, "--airspeeds", 4, 9, "--save", path)
    got = answer("verify", path)
    assert got["exact"]
    assert got["gamma"] == made["gamma"]
    assert got["kind"] == "l2 gain"
    status, out, _ = run("verify", path)
    assert status == 0
    assert "proven in exact arithmetic: l2 gain" in out
    path.write_text(path.read_text().replace('"gamma": ', '"gamma": 0.5, "was": '))
    status, _, err = run("verify", path)
    assert status == 1
    assert "unknown: was" in err
    path.write_text(path.read_text()[:100])
    status, _, err = run("verify", path)
    assert status == 1
    assert "damaged" in err


@pytest.mark.slow(only="options0-not both")
@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--memory", 0.5, "--order", 2), "not both"),
        (("--across", 2, 2), "give --memory"),
        (("--lft", "DG", "--segments", 4), "leave out --segments"),
    ],
)
def test_certify_refuses_options_that_mean_nothing_together(run, options, said):
    status, _, err = run("certify", "--airspeeds", 6, 9, *options)
    assert status == 1
    assert said in err


@pytest.mark.slow
def test_certify_with_an_lft_test_lets_the_airspeed_jump(answer, run):
    got = answer("certify", "--lft", "DG", "--airspeeds", 5.5, 7.5, "--stability")
    assert got["verified"]
    assert got["rate"] == "inf"
    status, out, _ = run("certify", "--lft", "small gain", "--stability")
    assert status == 1
    assert "no certificate exists" in out
    status, _, err = run("certify", "--lft", "DGG")
    assert status == 1
    assert "did you mean 'DG'" in err


# --- identify ------------------------------------------------------------------------------------


def scheduled_csv(path, n=900, noise=0.0):
    """y(k) = (0.9 - 0.05 p) y(k-1) + (0.2 + 0.02 p) u(k-1), p a slow sine, time in ms."""
    rng = np.random.default_rng(0)
    p, u, y = 5 + 4 * np.sin(2 * np.pi * np.arange(n) / 300), rng.standard_normal(n), np.zeros(n)
    for k in range(1, n):
        y[k] = (
            (0.9 - 0.05 * p[k - 1]) * y[k - 1]
            + (0.2 + 0.02 * p[k - 1]) * u[k - 1]
            + noise * rng.standard_normal()
        )
    rows = [f"{0.05 * k:.3f},{np.degrees(y[k]):.12g},{u[k]:.12g},{p[k]:.12g}" for k in range(n)]
    path.write_text("\n".join(["t,y,u,p", *rows]))
    return path


STRUCTURE = (
    "--na",
    1,
    "--nb",
    1,
    "--degree",
    1,
    "--no-offset",
    "--outputs",
    "y",
    "--inputs",
    "u",
    "--scheduling",
    "p",
)
UNITS = ("--units", "y=deg", "u=1", "p=m/s")
MAPPED = (("theta", "y", "deg"), ("stick", "u", "1"), ("speed", "p", "m/s"))


def test_identify_recovers_a_scheduled_model_from_a_table(run, answer, tmp_path):
    log = scheduled_csv(tmp_path / "log.csv")
    got = answer("identify", log, *STRUCTURE, *UNITS)
    A = got["models"]["LPV, degree 1"]["coefficients"]["A"]
    np.testing.assert_allclose(np.ravel(A), [-0.9, 0.05], atol=1e-8)  # the file has 12 digits
    assert got["scheduling_pays"] == {"y": True}
    assert got["read"]["dt"] == pytest.approx(0.05)
    assert got["read"]["signals"] == {"y": "rad", "u": "1", "p": "m/s"}
    status, out, _ = run("identify", log, *STRUCTURE, *UNITS)
    assert status == 0
    assert "scheduling pays" in out
    assert "excitation: sufficient" in out


def test_identify_reads_by_a_map_and_compares_orders(answer, run, tmp_path):
    log, signal_map = scheduled_csv(tmp_path / "log.csv"), tmp_path / "aircraft.toml"
    signal_map.write_text(
        'time = "t"\n[signals]\n'
        + "".join(f'{n} = {{ column = "{c}", unit = "{u}" }}\n' for n, c, u in MAPPED)
    )
    got = answer(
        "identify",
        log,
        *STRUCTURE[:-6],
        "--outputs",
        "theta",
        "--inputs",
        "stick",
        "--scheduling",
        "speed",
        "--map",
        signal_map,
    )
    np.testing.assert_allclose(
        np.ravel(got["models"]["LPV, degree 1"]["coefficients"]["A"]), [-0.9, 0.05], atol=1e-8
    )
    assert np.shape(got["standard_errors"]) == (4, 1)
    scan = answer("identify", log, *STRUCTURE[6:], *UNITS, "--orders")
    best = max(
        (t for t in scan["trials"] if not t["refused"]),
        key=lambda t: t["fit_percent"]["free run"][0],
    )
    assert best["degree"] >= 1
    status, _, error = run("identify", log, *STRUCTURE[6:], *UNITS, "--orders", "--train", 1)
    assert status == 1
    assert "held-out samples" in error


@pytest.mark.slow(but="svg")
@pytest.mark.parametrize("end", ["png", "svg", "pdf"])
def test_identify_draws_what_was_measured_and_predicted(run, answer, tmp_path, end):
    log, picture = scheduled_csv(tmp_path / "log.csv", noise=0.1), tmp_path / f"fits.{end}"
    got = answer("identify", log, *STRUCTURE, *UNITS, "--plot", picture)
    assert got["written"] == [str(picture)]
    assert picture.read_bytes().startswith(
        {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[end]
    )
    status, _, error = run("identify", log, *STRUCTURE, *UNITS, "--plot", picture, "--orders")
    assert status == 1
    assert "--plot draws the fits of one model" in error


def test_identify_writes_the_model_and_the_bands_of_its_coefficients(answer, run, tmp_path):
    pytest.importorskip("matplotlib")
    log = scheduled_csv(tmp_path / "log.csv", noise=0.1)
    paths = [tmp_path / name for name in ("bands.svg", "model.json")]
    got = answer("identify", log, *STRUCTURE, *UNITS, "--bands", paths[0], "--save", paths[1])
    assert got["written"] == [str(path) for path in paths]
    assert paths[0].read_bytes().startswith(b"<?xml")
    model = LPVARXModel.load(paths[1])
    np.testing.assert_array_equal(
        model.coefficients.monomial().A, got["models"]["LPV, degree 1"]["coefficients"]["A"]
    )
    np.testing.assert_allclose(
        np.sqrt(np.einsum("yiyi->iy", model.covariance)), got["standard_errors"], rtol=1e-12
    )
    answer("identify", log, *STRUCTURE, *UNITS, "--save", tmp_path / "model.mat")
    assert list(np.atleast_1d(loadmat(tmp_path / "model.mat", simplify_cells=True)["outputs"])) == [
        "y"
    ]
    status, _, error = run("identify", log, *STRUCTURE, *UNITS, "--save", paths[1], "--orders")
    assert status == 1
    assert "--save writes one model" in error
    status, _, error = run(
        "identify", log, *STRUCTURE, *UNITS, "--save", log / "model.json"
    )  # a file is no folder
    assert status == 1
    assert "cannot be written" in error


def test_identify_says_whether_the_model_is_fit_for_a_loop(answer, run, tmp_path):
    log = scheduled_csv(tmp_path / "log.csv", noise=0.01)
    got = answer("identify", log, *STRUCTURE, *UNITS, "--loop", "u=y:-0.2")["fit_for_control"]
    assert got["verdict"] == "not known"  # least squares has no covariance that knows of its bias
    rows = {row["name"]: row for row in got["criteria"]}
    assert rows["TIC"]["verdict"] == rows["J"]["verdict"] == "fit"
    assert len(got["scheduling"]) == len(got["margin"]) == 9
    assert min(got["margin"]) > 0
    status, out, _ = run("identify", log, *STRUCTURE, *UNITS, "--loop", "u=y:-0.2")
    assert status == 0
    assert "verdict: not known" in out
    unstable = answer("identify", log, *STRUCTURE, *UNITS, "--loop", "u=y:-50")
    assert unstable["fit_for_control"]["verdict"] == "not fit"
    status, _, error = run("identify", log, *STRUCTURE, *UNITS, "--loop", "phi")
    assert status != 0
    assert "input=output:gain" in error
    status, _, error = run("identify", log, *STRUCTURE, *UNITS, "--loop", "u=z:1")
    assert status != 0
    assert "signal of --loop" in error


def test_identify_says_where_scheduling_does_not_pay(run, tmp_path):
    log = tmp_path / "log.csv"
    rng = np.random.default_rng(1)
    u, y = rng.standard_normal(600), np.zeros(600)
    for k in range(1, 600):
        y[k] = 0.8 * y[k - 1] + u[k - 1] + 0.3 * rng.standard_normal()
    log.write_text(
        "\n".join(
            [
                "y,u,p",
                *(f"{a},{b},{c}" for a, b, c in zip(y, u, rng.uniform(0, 5, 600), strict=True)),
            ]
        )
    )
    status, out, _ = run("identify", log, "--dt", 0.1, *STRUCTURE, *UNITS)
    assert status == 0
    assert "scheduling does NOT pay" in out


def test_a_step_beside_a_time_column_resamples_by_that_column(answer, run, tmp_path):
    log = scheduled_csv(tmp_path / "log.csv")
    assert answer("identify", log, *STRUCTURE, *UNITS, "--dt", 0.1)["read"]["samples"] == 450
    status, _, error = run("identify", log, *STRUCTURE, *UNITS, "--dt", 1e-9)
    assert status == 1
    assert "dt is in seconds" in error
    status, _, error = run("identify", log, *STRUCTURE, *UNITS, "--delay", 5000)
    assert status == 1
    assert "0 usable samples" in error


def test_identify_reads_milliseconds_and_decimal_commas_and_asks_where_the_unit_is_not_said(
    answer, run, tmp_path
):
    log, other = scheduled_csv(tmp_path / "log.csv"), tmp_path / "semicolons.csv"
    rows = [line.split(",") for line in log.read_text().splitlines()]
    ticks = [["t"], *([str(50 * k)] for k in range(len(rows) - 1))]
    other.write_text(
        "# logger\n"
        + "\n".join(
            " ;".join([t, *row[1:]]).replace(".", ",")
            for (t,), row in zip(ticks, rows, strict=True)
        )
    )
    expected, got = (
        answer("identify", log, *STRUCTURE, *UNITS),
        answer("identify", other, *STRUCTURE, *UNITS, "--time-unit", "ms"),
    )
    assert got["models"] == expected["models"]
    assert got["read"]["dt"] == 0.05
    with warnings.catch_warnings():
        warnings.simplefilter("default")  # as at a prompt, where a note is printed
        status, _, error = run("identify", other, *STRUCTURE, *UNITS)
    assert status == 1
    assert "the samples are 50 s apart if the time is in s; give --time-unit ms (0.05 s)" in error
    other.write_text(other.read_text().replace("t ;", "clock ;", 1))
    status, _, error = run("identify", other, *STRUCTURE, *UNITS)
    assert status == 1
    assert (
        "no column is called t or time; name it with --time, or give the sample period with --dt;"
        " found 'clock', 'y', 'u', 'p'" in error
    )


def test_identify_cuts_decimates_smooths_and_fits_lti_models(answer, tmp_path):
    log = scheduled_csv(tmp_path / "log.csv")
    options = (
        "--start",
        5,
        "--stop",
        35,
        "--decimate",
        2,
        "--smooth-scheduling",
        0.5,
        "--train",
        0.5,
        "--scheduling-at",
        "now",
    )
    got = answer("identify", log, *STRUCTURE, *UNITS, *options)
    assert got["read"]["samples"] == 300
    assert got["read"]["rows_outside_start_stop"] == 300
    assert got["read"]["dt"] == pytest.approx(0.1)
    assert got["read"]["held_out_samples"] == 150
    alone = answer(
        "identify", log, "--outputs", "y", "--inputs", "u", "--degree", 0, "--train", 1, *UNITS[:3]
    )
    assert list(alone["models"]) == ["LTI"]
    assert alone["models"]["LTI"]["fit_percent"]["held_out"] is None


def test_identify_reads_matlab_files_by_content(answer, tmp_path):
    from scipy.io import savemat

    table = np.genfromtxt(scheduled_csv(tmp_path / "log.csv"), delimiter=",", names=True)
    savemat(tmp_path / "log.mat", {name: table[name] for name in table.dtype.names})
    (tmp_path / "log.mat").rename(tmp_path / "flight")
    got = answer("identify", tmp_path / "flight", *STRUCTURE, *UNITS)
    assert got["read"]["format"] == "mat"
    assert got["scheduling_pays"]["y"]
    coarse = answer(
        "identify", tmp_path / "flight", *STRUCTURE, *UNITS, "--dt", 3 * got["read"]["dt"]
    )
    assert coarse["read"]["dt"] == pytest.approx(3 * got["read"]["dt"])


@pytest.mark.slow
def test_an_xplane_log_needs_one_short_line(run):
    log = DATA / "xplane" / "Forward.txt"
    if not log.exists():
        pytest.skip(f"{log} is not here")
    status, out, _ = run("identify", log, "--dt", 0.1)
    assert status == 0
    assert "parts without a gap: 2, of 4, 935" in out
    assert "does NOT pay" in out


@pytest.mark.slow
def test_a_real_flight_is_identified_and_scheduling_does_not_pay(answer):
    log = DATA / "trex550" / "trex550_flight_clean.csv"
    if not log.exists():
        pytest.skip(f"{log} is not here")
    structure = (
        "--na",
        2,
        "--nb",
        3,
        "--degree",
        1,
        "--decimate",
        4,
        "--start",
        31,
        "--scheduling-from",
        "u_mps,v_mps",
    )
    got = answer(
        "identify",
        log,
        "--dt",
        0.0084,
        "--outputs",
        "q_radps,theta_rad",
        "--inputs",
        "lon",
        *structure,
        *TREX_UNITS,
    )
    assert got["scheduling_pays"] == {"q_radps": False, "theta_rad": False}
    assert got["read"]["scheduling_range"][1] < 8.2
    fit = got["models"]["LTI"]["fit_percent"]["held_out"]
    assert fit["one step"]["theta_rad"] > 95  # one step flatters
    assert fit["1 s"]["theta_rad"] < 60


# --- failure -------------------------------------------------------------------------------------


@pytest.mark.slow(only="arguments3-no trim at")
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["trim", "--vehicle", "xcel60"], "did you mean 'xcell60'?"),
        (["trim", "--airspeed", "-1"], "rearward flight is --airspeed 1 --sideslip-deg 180"),
        (["trim", "--climb-rate", "-3"], "straight down is --airspeed 3 --climb-rate -3"),
        (["trim", "--airspeed", "90"], "no trim at"),
        (["identify", "map.toml"], "a signal map goes with --map FILE.toml"),
        (["identify", "nowhere.csv"], "there is no such file"),
        (["export", "c", "--out", "model.cpp"], "ends in .c"),
        (["export", "mat", "--airspeeds", "5", "2"], "LOW < HIGH"),
    ],
)
def test_a_failure_is_one_sentence_and_status_1(run, arguments, sentence):
    status, out, err = run(*arguments)
    assert status == 1
    assert out == ""
    assert sentence in err
    assert len(err.splitlines()) == 1
    assert not re.search(r"throw|`start`|sideslip = pi", err), "words of Python"


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--outputs", "y"], "give the signals to predict and the inputs that drive them"),
        (["--outputs", "y", "--inputs", "u"], "name the scheduling signal"),
        (
            ["--outputs", "y", "--inputs", "u", "--scheduling", "p"],
            "the unit of 'y' is not known: --units y=UNIT",
        ),
        ([*STRUCTURE, *UNITS, "z=1"], "unknown signal in --units 'z'"),
        ([*STRUCTURE, "--units", "y=deg", "u=1", "p=knotz"], "unknown unit 'knotz'"),
        ([*STRUCTURE, *UNITS, "--scheduling-from", "u,y"], "not both"),
        ([*STRUCTURE, *UNITS, "--start", "99"], "the record goes from 0 to 44.95 s"),
        ([*STRUCTURE, *UNITS, "--decimate", "600"], "leaves fewer than two"),
        ([*STRUCTURE, *UNITS, "--train", "0.0001"], "samples to fit"),
        ([*STRUCTURE, *UNITS, "--degree", "12", "--stop", "1"], "cannot determine"),
        ([*STRUCTURE, *UNITS, "--time", "tt"], "unknown column 'tt'"),
    ],
)
def test_identify_says_what_is_missing(run, tmp_path, options, sentence):
    status, _, err = run("identify", scheduled_csv(tmp_path / "log.csv"), *options)
    assert status == 1
    assert sentence in err


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["fly"],
        ["trim", "--airspeed", "fast"],
        ["identify", "log", "--units", "q"],
        ["identify", "log", "--plot", "fits.doc"],
        ["export", "pdf"],
    ],
)
def test_wrong_usage_is_status_2(run, arguments):
    assert run(*arguments)[0] == 2


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["tirm"], "unknown verb 'tirm'; did you mean 'trim'"),
        (["trim", "--airspeeed", "5"], "unknown option '--airspeeed'; did you mean '--airspeed'"),
        (["study", "--quik"], "unknown option '--quik'; did you mean '--quick'"),
        (["trim", "xcell60", "5"], "symheli trim does not take '5'"),
    ],
)
def test_a_misspelt_verb_or_option_gets_the_nearest_name(run, arguments, sentence):
    status, _, err = run(*arguments)
    assert status == 2
    assert sentence in err


@pytest.mark.parametrize(("old", "new"), cli.FORMER.items())
def test_a_verb_of_the_last_release_still_works_and_names_the_new_one(run, old, new):
    now, told = run(new, "--help"), f"symheli: note: symheli {old} is symheli {new} now"
    status, out, err = run(old, "--help")
    assert (status, out) == now[:2]
    assert err.count("\n") == 1
    assert err.startswith(told)
    assert run(old, "--seedz", 1)[0] == run(new, "--seedz", 1)[0] == 2


def test_export_estimator_is_export_identifier(run, tmp_path):
    words = ("--outputs", "q", "--inputs", "d_lon", "--out")
    assert run("export", "identifier", *words, tmp_path / "new")[2] == ""
    status, out, err = run("export", *words, tmp_path / "old", "estimator")
    assert status == 0
    assert "estimator_check.c" in out
    assert err.count("\n") == 1
    assert "symheli export estimator is symheli export identifier now" in err
    files = [sorted(p.name for p in (tmp_path / name).iterdir()) for name in ("new", "old")]
    assert files[0] == files[1]


def test_without_a_verb_the_verbs_are_shown(run):
    status, out, err = run()
    assert (status, out) == (2, "")
    assert all(f"\n    {verb}" in err for verb in cli.VERBS)


def test_options_of_a_vehicle_tell_their_defaults_and_what_may_be_named(run):
    said = " ".join(run("trim", "--help")[1].split())
    assert "(default: ideal)" in said
    assert "tail_rotor_linear" in said


def test_the_columns_of_margins_are_explained_below_them(run):
    status, out, _ = run("margins", "--airspeeds", 0, 5, "--points", 2, "--degree", 1)
    assert status == 0
    head, _, legend = out.partition("\n\ngain, phase, delay:")
    for column in ("disk", "roll BW", "pitch BW", "lag", "gap"):
        assert column in head
        assert column in legend


def test_a_suggested_unit_can_be_typed_into_a_shell(run, tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("t,GyroY dps,u\n" + "".join(f"{k / 50},{k % 7},{k % 5}\n" for k in range(99)))
    status, _, err = run(
        *("identify", log, "--outputs", "GyroY dps", "--inputs", "u", "--degree", 0)
    )
    assert status == 1
    assert "--units 'GyroY dps=UNIT'" in err


def test_no_option_of_a_verb_takes_what_the_command_line_keeps_for_itself():
    """`specs` was always whole: argparse gives an option the default that is set by its name."""
    given = {"run", "usage", "kept", "every_verb", "default_of", "verb", "json"}
    (verbs,) = (a for a in cli.parser()._actions if isinstance(a.choices, dict))
    for name, verb in verbs.choices.items():
        own = [a.dest for a in verb._actions if a.option_strings != ["--json"]]
        assert not given & set(own), name


def test_help_and_version_succeed(run):
    assert run("--version")[1].strip() == f"symheli {symheli.__version__}"
    for verb in cli.VERBS:
        assert run(verb, "--help")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "module", "function", "passed"),
    [
        (
            ["study", "--quick", "--seed", "3", "--out", "o"],
            "study",
            "run_study",
            {
                "configuration": Configuration.of({"out": Path("o"), "quick": True, "seed": 3}),
                "resume": False,
            },
        ),
        (
            ["campaign", "--seeds", "4", "--out", "c.zarr", "--workers", "1"],
            "campaign",
            "run_campaign",
            {"seeds": 4, "vehicle": "xcell60", "path": Path("c.zarr")},
        ),
    ],
)
def test_long_jobs_get_their_options_and_show_their_result(
    run, monkeypatch, arguments, module, function, passed
):
    given = {}

    class Result:
        def summary(self):
            return "a table"

        def to_dict(self):
            return {"gain": np.float64(2.5)}

    def job(*arguments, on=None, **options):
        given.update(zip(("configuration",), arguments, strict=False), **options)
        return Result()

    monkeypatch.setitem(
        sys.modules, f"studies.transition.{module}", SimpleNamespace(**{function: job})
    )
    status, out, _ = run(*arguments)
    assert (status, out.splitlines()[0]) == (0, "a table")
    assert given == passed
    assert json.loads(run(*arguments, "--json")[1]) == {"gain": 2.5}


@pytest.mark.parametrize("inside", [False, True])
def test_interruption_says_what_was_kept(run, monkeypatch, inside):
    """Also where compiled code has turned the interruption into an error of its own."""

    def interrupted(arguments):
        if inside:
            raise SystemError("returned a result with an exception set") from KeyboardInterrupt()
        raise KeyboardInterrupt

    monkeypatch.setattr(study_command, "run", interrupted)
    status, _, err = run("study", "--out", "some/folder")
    assert status == 130
    assert "what was finished is in some/folder" in err


def test_a_full_disk_is_a_sentence_and_leaves_the_old_file(tmp_path, monkeypatch):
    import errno
    import os

    from symheli.values.whole_files import write_text

    target = write_text(tmp_path / "report.html", "old")

    def full(handle):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(SymheliError, match="the disk is full"):
        write_text(target, "new")
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_json_is_strict_and_keeps_what_is_not_finite():
    got = json.loads(
        as_json(
            {
                "a": np.array([1.0, np.inf]),
                "b": float("nan"),
                "c": 1 + 2j,
                "d": (np.int64(3), None, True),
                "e": Path("x"),
            }
        )
    )
    assert got == {
        "a": [1.0, "inf"],
        "b": "nan",
        "c": {"real": 1.0, "imag": 2.0},
        "d": [3, None, True],
        "e": "x",
    }


def test_the_command_line_starts_without_heavy_libraries():
    heavy = "('casadi', 'cvxpy', 'pandas', 'matplotlib')"
    code = (
        f"import sys; from studies import cli; cli.parser(); print([m for m in {heavy} if m in"
        " sys.modules])"
    )
    assert (
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout.strip()
        == "[]"
    )
