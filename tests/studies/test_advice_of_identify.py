"""The advice of `identify` works: each flag in its words is typed, and its reason is gone."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest

import identification
from evidence.damaged_logs import Log, pitch_with_lost_rows
from studies.log.advice import FLAGS

UNITS = {"q": "rad/s", "theta": "rad", "d_lon": "rad", "airspeed_command": "m/s"}


@pytest.fixture(scope="module")
def log():
    return pitch_with_lost_rows(lost=30, seconds=60.0)


@pytest.fixture
def identify(run, tmp_path, log):
    """Status, and all that is said of rows with these options."""

    def call(*options, rows=log.rows, given=log.options):
        file = tmp_path / "log.csv"
        file.write_text("\n".join(map(",".join, rows)) + "\n", "utf-8")
        with warnings.catch_warnings():
            warnings.simplefilter("default")
            status, out, error = run("identify", file, *given, *options)
        return status, out + error

    return call


def scaled(log: Log, column: str, factor: float):
    i = log.rows[0].index(column)
    return [
        log.rows[0],
        *([*r[:i], f"{factor * float(r[i]):.7g}", *r[i + 1 :]] for r in log.rows[1:]),
    ]


OF_COMMAND = ["--scheduling", "airspeed_command"]
BY_INSTRUMENTS = ("--method", "iv", "--instruments", "d_lon")


@pytest.mark.parametrize(
    ("options", "change", "said", "typed"),
    [
        ((), ("q", 57.3), "units: q is 5", ["--units", "q=deg/s"]),
        ((), ("theta", 57.3), "units: q is 0.01", ["--units", "theta=deg"]),
        ((), ("t", 1e3), "samples are 20 s apart", ["--time-unit", "us"]),
        (("--method", "iv"), None, "--method iv needs its instruments", ["--instruments", "d_lon"]),
        (("--decimate", "3", "--delay", "1"), None, "give --delay 0", ["--delay", "0"]),
        (
            ("--stop", "14", "--na", "9", "--nb", "9"),
            None,
            "or lower --na, --nb or --degree",
            ["--na", "2", "--nb", "2"],
        ),
        (("--decimate", "100"), None, "fewer together (--decimate)", ["--decimate", "5"]),
        (
            ("--scheduling", "theta", "--offset-rate", "yes"),
            None,
            "or schedule on a command",
            OF_COMMAND,
        ),
        (("--degree", "2", "--scheduling", "d_still"), None, "--degree 0", ["--degree", "0"]),
        pytest.param(
            ("--method", "riv"),
            None,
            "did not settle",
            list(BY_INSTRUMENTS),
            marks=pytest.mark.slow,
        ),
        (("--stop", "14"), None, "NOT known", ["--decimate", "2"]),
        (
            (*BY_INSTRUMENTS, "--na", "3"),
            None,
            "are weak",
            ["--na", "1", "--nb", "1", "--degree", "0"],
        ),
    ],
)
def test_advice_is_followed(identify, log, options, change, said, typed):
    rows = log.rows if change is None else scaled(log, *change)
    rows = [[*rows[0], "d_still"], *([*row, "1"] for row in rows[1:])]
    extra = ("--units", "d_still=1") if "d_still" in options else ()
    _, before = identify(*options, *extra, rows=rows)
    assert said in before
    status, after = identify(*options, *extra, *typed, rows=rows)
    assert status == 0
    assert said not in after


def test_what_mends_a_fit_that_diverges_was_tried(identify):
    high = ("--na", "4", "--nb", "4", "--degree", "2")
    _, before = identify(*high)
    first = before.splitlines()[0]
    assert first.startswith("the fit diverges: q, theta run away; tried and better: ")
    assert "both diverge" in before
    assert "diverges against" not in before
    found = re.findall(r"(--[^(]*) \(", first)
    assert found
    for flags in found:
        status, after = identify(*high, *flags.split())
        assert status == 0
        assert not after.startswith("the fit diverges")


def test_advice_is_of_the_words_of_the_libraries():
    """Words that a library no longer has would never be turned into flags."""
    root = Path(identification.__file__).parent
    sources = "".join(path.read_text("utf-8") for path in root.rglob("*.py"))
    joined = re.sub(r"[\"']\s*\n\s*f?[\"']", "", sources).replace("{term}", "offset_rate")
    joined = joined.replace("{what}", "offset_rate") + joined.replace(
        "offset_rate", 'scheduling_at="now"'
    )
    for words in FLAGS:
        assert words in joined, words


def test_uneven_steps_are_told_and_taken(identify, log):
    rng = np.random.default_rng(0)
    for spread, said in ((0.5, "the stamps scatter by up to"), (6.0, "the steps are uneven")):
        moved = [
            [f"{float(row[0]) + rng.uniform(-spread, spread):.3f}", *row[1:]]
            for row in log.rows[1:]
        ]
        status, text = identify(rows=[log.rows[0], *moved])
        assert status == 0
        assert said in text


def test_options_win_over_the_map_and_say_so(identify, tmp_path, log):
    signals = [f'{n} = {{ column = "{n}", unit = "{u}" }}' for n, u in UNITS.items()]
    path = tmp_path / "m.toml"
    head = ['time = "t"', 'time_unit = "us"', "dt = 0.02", "[signals]"]
    path.write_text("\n".join([*head, *signals]))
    given = ("--map", path, *log.options[:-2])
    status, text = identify(given=given)
    assert status == 1
    assert "2e-05 s apart if the time is in us; give --time-unit ms (0.02 s)" in text
    options = ("--time-unit", "ms", "--dt", "0.04", "--units", "q=deg/s")
    status, text = identify(*options, given=given)
    assert status == 0
    assert "--time-unit ms in place of time_unit = us of m.toml" in text
    assert "--dt 0.04 in place of dt = 0.02 of m.toml" in text
    assert "--units q=deg/s in place of q in rad/s of m.toml" in text
    assert "dt 0.04 s" in text
    assert "units: q is 0.01" in text
    assert "check its unit" not in text
