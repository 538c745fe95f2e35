"""What lies beside the code and is read at run time is declared as package data."""

import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("symheli", "identification", "synthesis", "studies")


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
