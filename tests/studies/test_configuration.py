"""What a run is asked for: written with its defaults, read with every complaint at once."""

import math
import tomllib
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest

from studies import cli
from studies.transition.configuration import Configuration
from studies.transition.effort import Effort
from symheli.errors import InputError
from synthesis.analysis import LowerBoundSearch
from synthesis.forms import Spline


def entries(thing):
    """Every key that can be written, with dots."""
    for f in fields(thing):
        value = getattr(thing, f.name)
        if is_dataclass(value):
            yield from (f"{f.name}.{name}" for name in entries(value))
        elif value is not None:
            yield f.name


def active(text):
    """The same file with its defaults no comments any more."""
    return "\n".join(
        line.removeprefix("# ")
        if line.startswith("# ") and ("] " in line or " = " in line)
        else line
        for line in text.splitlines()
        if not line.startswith("# symheli study FILE")
    )


@pytest.mark.parametrize("quick", [False, True])
def test_the_template_changes_nothing_and_lists_every_entry(tmp_path, quick):
    usual = Configuration.of({"quick": quick, "out": tmp_path / "study"})
    text = usual.text(tmp_path)
    (tmp_path / "my.toml").write_text(text)
    assert Configuration.read(tmp_path / "my.toml", {}) == usual
    assert "effort" not in tomllib.loads(text) or not tomllib.loads(text)["effort"]
    whole = tomllib.loads(active(text))
    found = {
        name if not isinstance(value, dict) else f"{name}.{inner}"
        for name, value in whole["effort"].items()
        for inner in (value if isinstance(value, dict) else [""])
    }
    assert found == set(entries(usual.effort))


def test_every_entry_is_explained():
    for f in fields(Effort):
        assert f.metadata["meaning"], f.name


def test_what_is_kept_comes_back_whatever_it_was(tmp_path):
    asked = Configuration.of(
        {
            "vehicle": "r50",
            "seed": 7,
            "out": tmp_path,
            "effort": {
                "gust_rates": [0, 2.5, math.inf],
                "longitudinal_rates": [],
                "thorough": False,
                "robust_form": {"degree": 2, "segments": [2, 4]},
                "search": {"seconds": 0.1, "samples": 10_000},
            },
        }
    )
    assert asked.effort.robust_form == Spline(degree=2, segments=(2, 4))
    assert asked.effort.search == LowerBoundSearch(seconds=0.1, samples=10_000)
    path = asked.write(tmp_path / "kept.toml")
    assert Configuration.read(path, {}) == Configuration.of(
        {"vehicle": "r50", "seed": 7, "out": tmp_path, "effort": asked.effort}
    )


def test_an_entry_wins_over_quick_and_an_option_over_the_file(tmp_path):
    (tmp_path / "my.toml").write_text("seed = 3\nquick = true\n[effort]\nramps = 9\n")
    found = Configuration.read(tmp_path / "my.toml", {"seed": 4})
    assert (found.seed, found.effort.ramps) == (4, 9)
    assert found.effort.gentle_ramps == Effort.look().gentle_ramps
    whole = Configuration.read(tmp_path / "my.toml", {"quick": False})
    assert whole.effort.gentle_ramps == Effort().gentle_ramps


def test_paths_are_relative_to_the_file(tmp_path):
    vehicle = tmp_path / "mine.toml"
    vehicle.write_text("")
    (tmp_path / "my.toml").write_text('vehicle = "mine.toml"\nout = "there"\n')
    found = Configuration.read(tmp_path / "my.toml", {})
    assert (found.vehicle, found.out) == (str(vehicle), tmp_path / "there")
    found.write(tmp_path / "there" / "study.toml")
    again = Configuration.read(tmp_path / "there" / "study.toml", {})
    assert Path(again.vehicle).samefile(vehicle)
    assert again.out.resolve() == (tmp_path / "there").resolve()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sed = 1", "sed is unknown; did you mean seed?"),
        ("zzz = 1", "zzz is unknown; known: vehicle, seed, out, quick, effort"),
        ("seed = -1", "seed: expected a whole number >= 0, got -1"),
        ("seed = 1.5", "seed: expected a whole number >= 0, got 1.5"),
        ("seed = true", "seed: expected a whole number >= 0, got True"),
        ("vehicle = 3", "vehicle: expected a text in quotes, got 3"),
        ("out = 3", "out: expected a text in quotes, got 3"),
        ('quick = "yes"', "quick: expected true or false, got 'yes'"),
        ("effort = 3", "effort: expected a table with any of ramps, "),
        ("[effort]\nramp = 3", "effort.ramp is unknown; did you mean ramps?"),
        ("[effort]\nramps = 1", "effort.ramps: expected a whole number >= 2, got 1"),
        ("[effort]\naggressive = nan", "effort.aggressive: expected a number >= 20, got nan"),
        ("[effort]\ngust_rates = 3", "effort.gust_rates: expected a list of numbers >= 0, one"),
        ("[effort]\ngust_rates = []", "effort.gust_rates: expected a list of numbers >= 0, one"),
        ("[effort]\ngust_rates = [-1]", "effort.gust_rates: expected a list of numbers >= 0, one"),
        ("[effort]\ngust_segments = [2.5]", "effort.gust_segments: expected a list of whole"),
        ("[effort.search]\nnode = 3", "effort.search.node is unknown; did you mean nodes?"),
        ("[effort.search]\nnodes = 3", "effort.search: nodes: expected a whole number >= 8"),
        ("[effort.robust_form]\ndegree = 9", "effort.robust_form: degree of P must be 0 .. 4"),
        ('[effort.robust_form]\nsegments = "a"', "effort.robust_form.segments: expected a whole"),
    ],
)
def test_what_is_wrong_is_said_by_its_name(tmp_path, text, said):
    path = tmp_path / "my.toml"
    path.write_text(text)
    with pytest.raises(InputError) as found:
        Configuration.read(path, {})
    assert f"my.toml: an entry is wrong: {said}" in str(found.value)


def test_all_complaints_come_in_one_message(tmp_path):
    path = tmp_path / "my.toml"
    path.write_text("sed = 1\nquick = 1\n[effort]\nramps = 0\n[effort.search]\nnodes = 1\n")
    with pytest.raises(InputError, match="4 entries are wrong") as found:
        Configuration.read(path, {})
    for name in ("sed is", "quick:", "effort.ramps:", "effort.search:"):
        assert name in str(found.value)


@pytest.mark.parametrize("text", ["seed = ", "[effort\n", "seed = 1\nseed = 2"])
def test_what_is_no_toml_says_where(tmp_path, text):
    path = tmp_path / "my.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"my.toml is not a TOML file: .*\(at "):
        Configuration.read(path, {})


def test_effort_made_by_hand_is_validated_too():
    with pytest.raises(InputError, match=r"ramps: expected a whole .*, got 1; servo_rates"):
        Effort(ramps=1, servo_rates=())


def test_the_command_writes_a_file_that_it_reads(tmp_path, capsys):
    path = tmp_path / "my.toml"
    assert cli.main(["study", "--seed", "5", "--write-config", str(path)]) == 0
    assert Configuration.read(path, {}).seed == 5
    capsys.readouterr()
    assert cli.main(["study", "--write-config", str(path)]) == 1
    assert "already exists; give another name" in capsys.readouterr().err
    assert cli.main(["study", str(path), "--write-config"]) == 0
    assert "seed = 5 " in capsys.readouterr().out


def test_a_file_that_is_not_there_says_how_to_make_one(tmp_path, capsys):
    assert cli.main(["study", str(tmp_path / "none.toml")]) == 1
    assert "--write-config" in capsys.readouterr().err
