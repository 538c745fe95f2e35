"""An estimator, a log format and a question that are defined here: everything takes them."""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import identification as idn
import symheli
from identification.estimators.method import known_methods
from identification.model.saved_model import SCHEMA
from studies import cli
from studies.commands import calibrate
from symheli.errors import InputError, UnknownNameError
from symheli.logs.column import Column
from symheli.logs.format import LogFormat, contents_of, format_of
from symheli.values import plain_file
from symheli.values.kinematics import INPUTS
from symheli.values.named_subclasses import named_subclasses
from synthesis.certify.questions.certificate import Certificate
from synthesis.certify.questions.certify import certify
from synthesis.certify.questions.problem import pose
from synthesis.certify.statement.kind import Kind, Supply

DOCS = Path(__file__).resolve().parents[1] / "docs"
MODEL = ("--outputs", "y", "--inputs", "u", "--scheduling", "p", "--degree", "1", "--na", "1")
FIT = (*MODEL, "--nb", "1", "--json")


class Normal(idn.methods.Method):
    """Least squares by the normal equations."""

    shorthand, least_squares = "toy normal", True

    def estimate(self, arx, records, data):
        theta = np.linalg.solve(data.phi.T @ data.phi, data.phi.T @ data.y)
        return idn.methods.Estimate(theta=theta)


@dataclass(frozen=True)
class Told(idn.methods.Method):
    """Least squares that is told of instruments and claims nothing."""

    instruments: tuple[str, ...] = ()
    shorthand = "toy told"

    def estimate(self, arx, records, data):
        theta = np.linalg.lstsq(data.phi, data.y, rcond=None)[0]
        return idn.methods.Estimate(theta=theta, details={"told": list(self.instruments)})


class Lines(LogFormat):
    """A signal a line: name, unit, numbers; the step (s) in the first."""

    name, begins, own_names = "toy lines", b"toy lines ", True

    @staticmethod
    def columns(path):
        first, *lines = Path(path).read_text("utf-8").splitlines()
        step, rows = float(first.split()[-1]), [line.split() for line in lines]
        return {
            name: Column(step * np.arange(len(numbers)), np.array(numbers, float), unit)
            for name, unit, *numbers in rows
        }

    def read(self, path, by):
        found = self.columns(path)
        time = next(iter(found.values())).time
        return time, {n: c.values for n, c in found.items()}, {n: c.unit for n, c in found.items()}


class Timed(Lines):
    """The same, where the user names the time and the units."""

    name, begins, own_names, time_column = "toy timed", b"", False, True

    def recognises(self, head):
        return head.startswith(b"toy timed ")

    def read(self, path, by):
        found = self.columns(path)
        chosen = {name: found[name].values for name in by.given}
        return found[by.time].values, chosen, {n: u or "1" for n, u in by.given.items()}


POWER = Kind(
    "toy power",
    sense=1,
    fields=("gamma", "lower"),
    unit="power of y per power of u",
    meaning="the power of y is at most gamma times that of u",
    supply=lambda number, _: Supply(-number(1.0), 0, 0),
    level=lambda gamma: gamma,
    bound=lambda g: g,
    powers=(2.0, 2.0),
)


@pytest.fixture(scope="module")
def record():
    rng, n = np.random.default_rng(0), 400
    p, u = np.sin(0.05 * np.arange(n)), rng.uniform(-1, 1, n)
    y = np.zeros(n)
    for k in range(1, n):
        y[k] = (0.5 + 0.3 * p[k - 1]) * y[k - 1] + u[k - 1] + 0.01 * rng.normal()
    time = 0.1 * np.arange(n)
    return symheli.FlightRecord.from_arrays(time, dict.fromkeys("yup", "1"), y=y, u=u, p=p)


def written(record, path, name):
    """A log of one of the toy formats."""
    rows = [["t", "s", *record.time], *([str(s), s.unit, *record[s]] for s in record.signals)]
    lines = [" ".join(map(str, row)) for row in rows]
    path.write_text("\n".join([f"{name} 0.1", *lines]) + "\n", "utf-8")
    return path


def answered(capsys, *words):
    assert cli.main([*map(str, words)]) == 0
    return json.loads(capsys.readouterr().out)


# --- an estimator --------------------------------------------------------------------------------


def arx():
    return idn.LPVARX("y", "u", "p", na=1, nb=1, delay=1, basis=idn.Polynomial(1, -1.0, 1.0))


def test_fit_takes_a_method_of_ones_own_and_its_shorthand(record, tmp_path):
    plain = idn.fit(arx(), record)
    for method in (Normal(), "toy normal"):
        model = idn.fit(arx(), record, method)
        assert np.abs(model.theta - plain.theta).max() < 1e-9
        assert idn.uncertainty(model, record).covariance.shape == (1, 4, 1, 4)
    told = idn.fit(arx(), record, "toy told")
    with pytest.raises(InputError, match='that of least squares; the model was fitted by "toy'):
        idn.uncertainty(told, record)
    for model in (idn.fit(arx(), record, "toy normal"), told):
        again = idn.model.LPVARXModel.load(model.save(tmp_path / "model.json"))
        assert (again.method, again.least_squares) == (model.method, model.least_squares)


def test_a_model_saved_before_says_by_its_name_whether_it_is_least_squares(record, tmp_path):
    for method, told in (("ls", True), ("ridge", False)):
        file = idn.fit(arx(), record, method).save(tmp_path / "model.json")
        content = plain_file.read(file, SCHEMA)
        del content["least_squares"]
        plain_file.write(file, SCHEMA, content)
        assert idn.model.LPVARXModel.load(file).least_squares is told


def test_a_method_without_a_name_is_refused(record):
    class Nameless(Normal):
        pass

    assert idn.fit(arx(), record, Nameless()).method == "toy normal"
    assert type(known_methods()["toy normal"].default()) is Normal

    class Bare(idn.methods.Method):
        def estimate(self, arx, records, data):
            return idn.methods.Estimate(theta=np.zeros((4, 1)))

    with pytest.raises(InputError, match="method Bare: give the class a name, such as shorthand"):
        idn.fit(arx(), record, Bare())


def test_identify_takes_an_estimator_of_ones_own(record, tmp_path, capsys):
    log = record.to_csv(tmp_path / "log.csv")
    data = answered(capsys, "identify", log, *FIT, "--method", "toy normal")
    assert data["method"] == "toy normal"
    assert data["standard_errors"] is not None
    words = ("--method", "toy told", "--instruments", "u")
    data = answered(capsys, "identify", log, *FIT, *words)
    assert data["method"] == "toy told"
    assert data["standard_errors"] is None
    assert cli.main(["identify", str(log), *FIT, "--method", "toy normal", *words[2:]]) == 1
    said = capsys.readouterr().err
    assert re.search("--instruments are for --method .*toy told.*, not toy normal", said)
    assert cli.main(["identify", "--help"]) == 0
    assert "toy told" in " ".join(capsys.readouterr().out.split())


def test_pages_and_docstring_name_every_estimator_of_the_package():
    page = (DOCS / "identification.md").read_text("utf-8")
    table = page.partition("## Which estimator")[2].partition("\n## ")[0]
    ours = {n: m for n, m in known_methods().items() if m.__module__.startswith("identification.")}
    assert sorted(re.findall(r"^\| `(\w+)\(.*?\)`, `\"(.*?)\"` \|", table, re.MULTILINE)) == sorted(
        (method.__name__, name) for name, method in ours.items()
    )
    for name, method in ours.items():
        assert f'- `{method.__name__}`, "{name}": ' in (idn.fit.__doc__ or "")


def test_two_classes_of_one_name_are_refused_and_the_same_again_is_not():
    class Base(ABC):
        @abstractmethod
        def act(self): ...

    def once(name):
        return type(name, (Base,), {"label": "one", "act": id, "__module__": "mine"})

    first, second = once("First"), once("First")
    assert named_subclasses(Base, "label", "none") == {"one": second}
    other = once("Other")
    with pytest.raises(InputError, match="First and Other have one label, 'one': give one"):
        named_subclasses(Base, "label", "none")
    assert first is not other


# --- a log format --------------------------------------------------------------------------------


def test_a_record_is_read_by_a_format_of_ones_own(record, tmp_path):
    maps = {"toy lines": "", "toy timed": 'time = "t"\n'}
    for name, head in maps.items():
        log = written(record, tmp_path / "log", name)
        assert format_of(log) == name
        assert contents_of(log).columns.keys() == {"t", "y", "u", "p"}
        (tmp_path / "map.toml").write_text(f'{head}[signals]\nq = {{ column = "y", scale = 2 }}\n')
        read = symheli.FlightRecord.from_map(log, tmp_path / "map.toml")
        assert np.array_equal(read["q"], 2 * record["y"])
        assert read.dt == 0.1
    with pytest.raises(UnknownNameError, match="unknown format 'toy line'; did you mean 'toy line"):
        contents_of(log, "toy line")


@pytest.mark.parametrize("name", ["toy lines", "toy timed"])
def test_identify_takes_a_log_of_ones_own(record, tmp_path, capsys, name):
    plain = answered(capsys, "identify", record.to_csv(tmp_path / "log.csv"), *FIT)
    log = written(record, tmp_path / "log", name)
    assert answered(capsys, "identify", log, "--json")["format"] == name
    units = () if name == "toy lines" else ("--units", "y=1", "u=1", "p=1")
    for words in ((), ("--format", name)):
        found = answered(capsys, "identify", log, *FIT, *words, *units)
        assert found["models"] == plain["models"]
    signals = "".join(f'{n} = {{ column = "{n}", unit = "1" }}\n' for n in "yup")
    (tmp_path / "map.toml").write_text(f'format = "{name}"\ntime = "t"\n[signals]\n{signals}')
    found = answered(capsys, "identify", log, *FIT, "--map", tmp_path / "map.toml")
    assert found["models"] == plain["models"]
    assert cli.main(["identify", str(log), *FIT, "--format", "toy"]) == 2
    assert "'toy lines'" in capsys.readouterr().err


def test_commands_that_fly_take_a_log_of_ones_own(record, tmp_path, capsys):
    """The records of calibrate and tune; experiment asks for a map, and takes it."""
    names = dict.fromkeys(INPUTS, "rad") | {"q": "rad/s"}
    flight = record.with_signals(names, **dict.fromkeys(names, record["u"]))
    asked = argparse.Namespace(map=None, start=None, stop=5.0)
    found = calibrate.record_of(asked, written(flight, tmp_path / "log", "toy lines"))
    assert set(names) <= set(map(str, found.signals))
    assert len(found) == 50
    assert [s.unit for s in found.signals if s == "q"] == ["rad/s"]
    words = ["experiment", "--flown", str(tmp_path / "log"), "--plan", str(tmp_path / "plan.json")]
    assert cli.main(words) == 1
    assert "format toy lines needs a signal map, --map FILE.toml" in capsys.readouterr().err
    (tmp_path / "map.toml").write_text('[signals]\nq = { column = "q" }\n')
    assert cli.main([*words, "--map", str(tmp_path / "map.toml")]) == 1
    assert "plan.json: there is no such file" in capsys.readouterr().err


# --- a question ----------------------------------------------------------------------------------


def lag():
    p = symheli.Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    return symheli.LPVStateSpace.polynomial(
        [[[-1.0]], [[-1.0]]], [[[2.0]]], [[[1.0]]], [[[0.0]]], p
    )


def lag_of_two():
    p, q = (symheli.Scheduling(name, "1", 0.0, 1.0, rate=0.5) for name in "pq")
    z = (0, 0)
    A, D = {z: [[-1.0]], (1, 0): [[-1.0]]}, {z: [[0.0]]}
    B = {z: [[2.0]], (0, 1): [[-1.0]]}
    return symheli.LPVStateSpace.polynomial(A, B, {z: [[1.0]]}, D, [p, q])


@pytest.mark.parametrize("model", [lag, lag_of_two])
def test_a_question_of_ones_own_is_proven_saved_verified_and_drawn(model, tmp_path, capsys):
    """The power gain is the square of the gain, 2 at p = 0."""
    proof = certify(pose(model(), None, POWER, None, None, None, None))
    assert 4.0 <= proof.gamma < 4.001
    assert proof.verify(rigorous=True)
    again = Certificate.load(proof.save(tmp_path / "proof.json"))
    assert again.gamma == proof.gamma
    assert cli.main(["verify", str(tmp_path / "proof.json")]) == 0
    assert "toy power 4.000" in capsys.readouterr().out
    proof.plot()
    content = json.loads((tmp_path / "proof.json").read_text())
    (tmp_path / "proof.json").write_text(json.dumps({**content, "gamma": 3.99}))
    assert cli.main(["verify", str(tmp_path / "proof.json")]) == 1


# --- packages with entry points, from a shell ----------------------------------------------------

NAMED = """[symheli.methods]
toy = test_added_from_outside:Normal
[symheli.formats]
lines = test_added_from_outside:Lines
[symheli.kinds]
toy-power = test_added_from_outside:power
"""


def power():
    """What the entry point of a kind calls."""
    return POWER


@pytest.mark.slow
def test_the_command_line_finds_a_package_by_its_entry_points(record, tmp_path):
    info = tmp_path / "toy-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toy\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(NAMED)
    log = written(record, tmp_path / "log", "toy lines")
    proof = certify(pose(lag(), None, POWER, None, None, None, None)).save(tmp_path / "proof.json")
    places = [str(tmp_path), str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]
    for words in (["identify", log, *FIT, "--method", "toy normal"], ["verify", proof]):
        done = subprocess.run(
            [sys.executable, "-m", "studies.cli", *map(str, words)],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(places)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert "toy" in done.stdout
