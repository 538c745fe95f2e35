"""An option that is given is read by the work, or refused: alone, and beside every other."""

import argparse
from functools import cache
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import identification as idn
import symheli
from studies import cli
from studies.output import Output
from symheli.errors import InputError, SymheliError

NEITHER = {"help", "json", "allow_code"}
"""Options that the command line itself reads."""

VALUES = {
    "--airspeed": ["6"],
    "--climb-rate": ["1"],
    "--turn-rate": ["0.1"],
    "--altitude": ["100"],
    "--sideslip-deg": ["5"],
    "--governor": ["pi"],
    "--printed": ["tail_rotor_linear"],
    "--vehicle": ["yamaha_r50"],
    "--points": ["5"],
    "--outputs": ["q"],
    "--inputs": ["d_lat"],
    "--forgetting": ["0.99"],
    "--model": ["model.json"],
    "--controller": ["controller.json"],
    "--states": ["p,phi"],
    "--degree": ["1"],
    "--feedback": ["d_lat=phi:-0.1"],
    "--channel": ["inputs"],
    "--rate": ["0.5"],
    "--lft": ["DG"],
    "--memory": ["0.5"],
    "--across": ["2", "2"],
    "--order": ["2"],
    "--segments": ["2"],
    "--grading": ["3"],
    "--seeds": ["3"],
    "--show": ["y"],
    "--workers": ["1"],
    "--axis": ["lateral"],
    "--flights": ["2"],
    "--attitude-deg": ["20"],
    "--na": ["2"],
    "--nb": ["2"],
    "--delay": ["0"],
    "--map": ["map.toml"],
    "--servo": ["30"],
    "--gust": ["1"],
    "--window": ["2"],
    "--start": ["1"],
    "--stop": ["20"],
    "--parameters": ["body.mass"],
    "--target": ["cortex-m7"],
    "--certificate": ["certificate.json"],
    "--reading-error": ["0.1"],
    "--rate-window": ["0.5"],
    "--jitter": ["0.1"],
    "--of": ["controller"],
    "--period": ["0.01"],
}
"""A value of each option that is not its default."""

WITHOUT_VALUE = {
    "--directional",
    "--single",
    "--offset",
    "--stability",
    "--rigorous",
    "--toml",
    "--reference",
    "--again",
    "--sweeps",
}

AFTER = {"out", "save", "write", "rigorous"}
"""Read after the work, of which a stub makes nothing."""

MODES = {
    "trim": ["trim"],
    "linearize": ["linearize"],
    "derivatives": ["derivatives"],
    "vehicles": ["vehicles"],
    "reference of vehicles": ["vehicles", "--reference"],
    **{f"export {kind}": ["export", kind] for kind in ("c", "identifier", "mat", "latex")},
    "export model": ["export", "model", "--model", "model.json"],
    "export monitor": ["export", "monitor", "--model", "table.json"],
    **{f"export fmu of {of}": ["export", "fmu", "--of", of] for of in ("helicopter", "identifier")},
    "export fmu": ["export", "fmu", "--model", "table.json"],
    "export mat of a model": ["export", "mat", "--model", "model.json"],
    "margins": ["margins"],
    "margins of a model": ["margins", "--model", "model.json", "--feedback", "u=y:-0.1"],
    "certify": ["certify"],
    "certify of a model": ["certify", "--model", "model.json"],
    "certify by an LFT": ["certify", "--lft", "DG"],
    "experiment": ["experiment"],
    "compare": ["compare"],
    "campaign": ["campaign"],
    "calibrate": ["calibrate", "xcell60", "log.csv"],
}


class Read(argparse.Namespace):
    """Arguments that know which of them were read."""

    def __init__(self, given):
        super().__init__(**vars(given))
        object.__setattr__(self, "_read", set())

    def __getattribute__(self, name):
        if not name.startswith("_"):
            object.__getattribute__(self, "_read").add(name)
        return object.__getattribute__(self, name)


class Reached(Exception):
    """The work has what it asks for."""


def reached(*_, **__):
    raise Reached


_parser = cache(cli.parser)


def options_of(verb):
    (verbs,) = (a for a in _parser()._actions if isinstance(a.choices, dict))
    return [
        action
        for action in verbs.choices[verb]._actions
        if action.option_strings
        and action.dest not in NEITHER
        and (action.option_strings[0] in VALUES or action.option_strings[0] in WITHOUT_VALUE)
    ]


def words_of(action):
    name = action.option_strings[0]
    return [name] if name in WITHOUT_VALUE else [name, *VALUES[name]]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the files are that options name."""
    found = tmp_path_factory.mktemp("options")
    rng, n = np.random.default_rng(0), 300
    p, u = np.sin(0.05 * np.arange(n)), rng.uniform(-1, 1, n)
    y = np.zeros(n)
    for k in range(1, n):
        y[k] = (0.5 + 0.3 * p[k - 1]) * y[k - 1] + u[k - 1]
    record = symheli.FlightRecord.from_arrays(
        0.1 * np.arange(n), dict.fromkeys("yup", "1"), y=y, u=u, p=p
    )
    arx = idn.LPVARX("y", "u", "p", na=1, nb=1, basis=idn.Polynomial(1, -1.0, 1.0))
    idn.fit(arx, record).save(found / "model.json")
    symheli.TableController((0.0, 13.0), np.zeros((2, 1, 2)), (), ("p",), ("d_lat",), 0.02).save(
        found / "table.json"
    )
    (found / "log.csv").write_text("t,y\n0,1\n1,2\n")
    return found


@pytest.fixture
def stubbed(monkeypatch, folder):
    """The dear work ends where it has been handed its options."""
    import synthesis
    from identification import export as identifiers
    from studies.campaigns import experiments, pays
    from studies.commands import calibrate
    from studies.loops import lateral
    from studies.transition import campaign
    from symheli import export as exports

    monkeypatch.chdir(folder)
    monkeypatch.setattr(cli, "parser", _parser)
    stubs = (
        (symheli, ("trim", "sweep")),
        (synthesis, ("l2_gain", "stability", "lft_gain")),
        (synthesis.analysis, ("lft_stability",)),
    )
    for module, names in stubs:
        for name in names:
            monkeypatch.setattr(module, name, reached)
    loop = SimpleNamespace(to_lft=lambda: SimpleNamespace(reduce=lambda *_: None))
    monkeypatch.setattr(lateral, "lateral_loop", lambda *_, **__: loop)
    monkeypatch.setattr(experiments, "design", reached)
    monkeypatch.setattr(pays, "where_scheduling_pays", reached)
    monkeypatch.setattr(campaign, "run_campaign", reached)
    monkeypatch.setattr(calibrate, "record_of", lambda a, _: (a.map, a.start, a.stop))
    monkeypatch.setattr(idn, "calibrate", reached)
    writers = (
        (exports, ("write_c", "write_mat", "write_board", "write_monitor")),
        (exports, ("write_helicopter_fmu", "write_controller_fmu")),
        (identifiers, ("write_estimator", "write_model")),
    )
    for module, names in writers:
        for name in names:
            monkeypatch.setattr(module, name, lambda *_, **__: (Path("written.c"),))
    monkeypatch.setattr(identifiers, "write_identifier_fmu", lambda *_: Path("written.fmu"))


def vanished(words):
    """Options given that the work has neither read nor refused."""
    try:
        arguments = cli.parsed(words)
    except SymheliError:
        return set()
    read = Read(arguments)
    try:
        assert isinstance(arguments.run(read), Output)
    except Reached:
        pass
    except InputError:
        return set()
    given = {
        name
        for name, value in vars(arguments).items()
        if name not in ("run", "usage", "kept", "every_verb", "default_of", "verb", "format")
        and name not in ("logs", "file", "named_vehicle", "json", "allow_code")
        and value != arguments.default_of(name)
    }
    return given - read._read - AFTER


@pytest.mark.parametrize("mode", MODES)
def test_an_option_alone_acts_or_is_refused(stubbed, mode):
    base = MODES[mode]
    for action in options_of(base[0]):
        assert not vanished([*base, *words_of(action)]), action.dest


@pytest.mark.parametrize("mode", MODES)
def test_two_options_act_or_are_refused(stubbed, mode):
    base = MODES[mode]
    for pair in combinations(options_of(base[0]), 2):
        both = [word for action in pair for word in words_of(action)]
        assert not vanished([*base, *both]), both


def test_an_option_that_is_not_read_is_found(monkeypatch):
    from studies.commands import trim

    monkeypatch.setattr(trim, "run", lambda arguments: Output(str(arguments.airspeed), {}))
    assert vanished(["trim", "--airspeed", "6", "--altitude", "100"]) == {"altitude"}
