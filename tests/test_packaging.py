"""What lies beside the code is packaged, and the package is a command that a shell completes."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from studies import cli
from studies.commands import completion

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("symheli", "identification", "synthesis", "studies")


TOP = {
    *ROOMS,
    *(
        "tests",
        "benchmarks",
        "evidence",
        "examples",
        "docs",
        ".ci",
        ".gitignore",
        "Makefile",
        "setup.py",
    ),
    *("pyproject.toml", "setup.py", "constraints.txt", "Makefile", ".gitignore"),
    *("README.md", "LICENSE", "CITATION.cff", "CHANGELOG.md"),
    *("CONTRIBUTING.md", "CODE_OF_CONDUCT.md", "SECURITY.md"),
}


def test_nothing_that_a_command_wrote_is_kept_at_the_top():
    """As the folders are into which commands write by default."""
    git = shutil.which("git")
    if git is None or not (ROOT / ".git").exists():
        pytest.skip("no git checkout")
    listed = subprocess.run(
        [git, "ls-files"], check=True, capture_output=True, text=True, cwd=ROOT
    ).stdout.splitlines()
    assert {name.split("/")[0] for name in listed} <= TOP


@pytest.mark.parametrize("room", ROOMS)
def test_every_file_beside_the_code_is_in_the_wheel(room):
    setuptools = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    declared = {p for glob in setuptools["package-data"][room] for p in (ROOT / room).glob(glob)}
    beside = {
        path
        for path in (ROOT / room).rglob("*")
        if path.is_file() and path.suffix not in (".py", ".pyc", ".so", ".pyd")
    }
    assert not {str(p.relative_to(ROOT)) for p in beside - declared}


@pytest.mark.parametrize("room", ROOMS)
def test_no_line_of_code_is_longer_than_a_hundred_columns(room):
    """Python is held to it by ruff; C, MATLAB and CMake here."""
    long = [
        f"{path.relative_to(ROOT)}:{number}"
        for path in (ROOT / room).rglob("*")
        if path.suffix in (".c", ".h", ".m") or path.name == "CMakeLists.txt"
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if len(line) > 100
    ]
    assert not long


def test_the_package_runs_as_a_module():
    """`python -m symheli` is the installed command."""
    answer = subprocess.run(
        [sys.executable, "-m", "symheli", "--version"], capture_output=True, text=True
    )
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.split()[0] == "symheli"


@pytest.mark.parametrize("shell", completion.SHELLS)
def test_every_verb_is_completed(shell, capsys):
    pytest.importorskip("shtab")
    assert cli.main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(verb in script for verb in cli.VERBS)


def test_completion_without_its_package_says_how_to_get_it(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "shtab", None)
    assert cli.main(["completion", "bash"]) == 1
    assert "pip install 'symheli[shell]'" in capsys.readouterr().err


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_bash_completes_a_verb(tmp_path, capsys):
    pytest.importorskip("shtab")
    assert cli.main(["completion", "bash"]) == 0
    (tmp_path / "symheli.bash").write_text(capsys.readouterr().out)
    asked = "source symheli.bash; COMP_WORDS=(symheli linea); COMP_CWORD=1; _shtab_symheli"
    answer = subprocess.run(
        ["bash", "-c", f'{asked}; echo "${{COMPREPLY[@]}}"'],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert answer.stdout.split() == ["linearize"]
