"""A full disk, a folder that cannot be written, a compiler, a solver or an extra that is not there:
one sentence, exit status 1 or 2, a JSON object under --json, and files as they were.
"""

import errno
import json
import os
import subprocess
import sys
import tempfile

import pytest

import symheli
import synthesis
from studies import cli
from symheli.errors import InputError, SolverError, SymheliError

LAG = symheli.LPVStateSpace.polynomial(
    A=[[[-2.0]], [[1.0]]],
    B=[[[1.0]]],
    C=[[[1.0]]],
    D=[[[0.0]]],
    scheduling=symheli.Scheduling("p", "1", 0.0, 1.0, rate=0.5),
)


def _fails(number):
    def fail(*_, **__):
        raise OSError(number, os.strerror(number))

    return fail


@pytest.fixture(scope="module")
def certificate():
    return synthesis.stability(LAG)


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EACCES, errno.EROFS])
@pytest.mark.parametrize("where", ["mkstemp", "fsync", "replace"])
def test_a_file_that_cannot_be_written_leaves_the_old_one(
    certificate, tmp_path, monkeypatch, number, where
):
    path = certificate.save(tmp_path / "proof.json")
    before = path.read_bytes()
    monkeypatch.setattr(tempfile if where == "mkstemp" else os, where, _fails(number))
    with pytest.raises(SymheliError, match=r"disk is full|cannot be written"):
        certificate.save(path)
    monkeypatch.undo()
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["proof.json"]


@pytest.mark.parametrize("path", ["a\0b", "\udc80"])
def test_what_is_no_path_is_refused(certificate, tmp_path, monkeypatch, path):
    monkeypatch.chdir(tmp_path)
    if path.isprintable() or "\0" in path:
        with pytest.raises(InputError, match="not a path"):
            certificate.save(path)
    else:  # half a character is a name on this system
        assert certificate.save(path).is_file()


WRONG = (
    (("trim", "--airspeed", "fast"), 2, "UsageError"),
    (("trim", "--airspeed", "nan"), 2, "UsageError"),
    (("trim", "--no-such"), 2, "UsageError"),
    (("no-such-verb",), 2, "UsageError"),
    (("trim", "--vehicle", "no-such"), 1, "UnknownNameError"),
    (("trim", "--airspeed", "900"), 1, "TrimError"),
    (("verify", "no-such.json"), 1, "InputError"),
    (("identify", "no-such.csv"), 1, "InputError"),
)


@pytest.mark.slow(only="arguments5-1-TrimError")
@pytest.mark.parametrize(("arguments", "status", "kind"), WRONG)
def test_what_fails_is_one_sentence_and_under_json_an_object(
    tmp_path, monkeypatch, capsys, arguments, status, kind
):
    monkeypatch.chdir(tmp_path)
    assert cli.main([*arguments, "--json"]) == status
    out, err = capsys.readouterr()
    told = json.loads(out)
    assert list(told) == ["error"]
    assert told["error"]["type"] == kind
    assert told["error"]["message"]
    assert err.rstrip().splitlines()[-1] == f"symheli: {told['error']['message']}"
    assert "Traceback" not in err
    assert cli.main(list(arguments)) == status
    assert capsys.readouterr().out == ""
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
@pytest.mark.parametrize("arguments", [["vehicles"], ["vehicles", "--json"]])
def test_an_answer_that_finds_no_room_is_a_failure_too(arguments):
    with open("/dev/full", "w", encoding="utf-8") as full:
        done = subprocess.run(
            [sys.executable, "-m", "studies.cli", *arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 1
    assert "No space left" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_solver_that_is_not_there_is_named():
    with pytest.raises(SolverError, match="NOSUCH"):
        synthesis.stability(LAG, solver=synthesis.Solver("NOSUCH"))


@pytest.mark.slow
def test_without_a_compiler_numbers_come_out_and_it_is_said():
    code = (
        "import warnings, symheli\n"
        "with warnings.catch_warnings(record=True) as told:\n"
        "    warnings.simplefilter('always')\n"
        "    heli = symheli.Helicopter.load('xcell60', governor='ideal')\n"
        "    point = symheli.trim(heli, airspeed=5.0)\n"
        "    u = [list(point.u.values())] * 5\n"
        "    flown = symheli.simulate(heli, point, u, dt=0.02)\n"
        "import numpy as np\n"
        "print(np.isfinite(flown.states).all(), {w.category.__name__ for w in told})\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "SYMHELI_COMPILE": "0"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == "True {'CompilerWarning'}"


def test_an_extra_that_is_not_there_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyulog", None)
    path = tmp_path / "log.ulg"
    path.write_bytes(b"ULog")
    with pytest.raises(InputError, match=r"symheli\[logs\]"):
        symheli.FlightRecord.from_ulog(path, {"q": ("rates", "xyz[1]", "rad/s")}, dt=0.02)
