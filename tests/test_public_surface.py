"""The whole public surface: documented, and light to import."""

import ast
import importlib
import inspect
import os
import re
import subprocess
import sys
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest
from public_faces import TOP, faces, module, names

from symheli.values.html_table import as_table
from symheli.values.summary import summarized

pytestmark = pytest.mark.guard

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("symheli", "identification", "synthesis", "studies")
NOT_INSTALLED = ("evidence", "benchmarks", "examples", "tests")
"""Folders of programs beside the packages."""
PACKAGES = (
    *faces((*TOP, "symheli.lpv")),
    "symheli.equations",
    "symheli.export",
    "identification.export",
)
FACES = {"symheli": 24, "symheli.lpv": 18, "identification": 17, "synthesis": 25}
"""Names at the top of each package; `CONTRACT`, on which scripts outside rely, counts beside."""
CONTRACT = {"identification": {"Polynomial"}}


def public(package):
    """Names of a package; of a module that has more than public names those that moved there."""
    return names(package) or module(package).__all__


@pytest.mark.parametrize("package", FACES)
def test_the_face_of_a_package_is_one_screen(package):
    names = set(importlib.import_module(package).__all__) - CONTRACT.get(package, set())
    assert len(names) == FACES[package]


def test_the_modules_of_names_need_no_import_of_their_own():
    for package, name in {
        "symheli": "lpv.tools.pade_delay",
        "synthesis": "designs.ncfsyn",
    }.items():
        run = f"import {package}; {package}.{name}"
        subprocess.run([sys.executable, "-c", run], check=True)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_exists_and_is_documented(package):
    own = importlib.import_module(package)
    for name in public(package):
        thing = getattr(own, name)
        assert inspect.getdoc(thing), f"{package}.{name} has no docstring"
        if inspect.isclass(thing):
            for member, value in vars(thing).items():
                if member.startswith("_") or not (
                    callable(value) or isinstance(value, property | classmethod | staticmethod)
                ):
                    continue
                assert inspect.getdoc(getattr(thing, member)), (
                    f"{package}.{name}.{member} has no docstring"
                )
    assert list(public(package)) == list(dict.fromkeys(public(package)))


ARRAY = re.compile(r"(tuple\[|ForwardRef\(')?(Array|np\.ndarray)\b")


def test_no_public_value_prints_its_arrays():
    """A dataclass or named tuple with arrays says what it is in a few lines; a string at a prompt
    that scrolls the work away is of no use.
    """
    flooding = []
    for package in PACKAGES:
        for name in public(package):
            thing = getattr(module(package), name)
            if is_dataclass(thing):
                types = [f.type for f in fields(thing) if f.repr]
            elif hasattr(thing, "_fields"):
                types = [str(hint) for hint in thing.__annotations__.values()]
            else:
                continue
            if any(ARRAY.match(str(t)) for t in types):
                own = thing.__repr__ is summarized or name == "NamedVector"
                flooding += [] if own else [f"{package}.{name}"]
    assert not flooding, ", ".join(flooding)


def test_a_summary_is_short_and_a_table_is_escaped():
    @dataclass(frozen=True)
    class Made:
        title: str
        values: np.ndarray
        names: tuple
        nothing: None = None

        __repr__ = summarized
        _repr_html_ = as_table

    made = Made("<b>a & b</b>", np.arange(1e6), tuple(f"signal{i}" for i in range(1000)))
    assert repr(made).startswith(
        "Made(title='<b>a & b</b>', values=1000000 numbers from 0 to 999999"
    )
    assert len(repr(made)) < 300
    assert "nothing" not in repr(made)
    assert '<td style="text-align:left">&#x27;&lt;b&gt;a &amp; b&lt;/b&gt;&#x27;</td>' in (
        made._repr_html_()
    )


def test_importing_the_packages_loads_no_heavy_library():
    heavy = "('casadi', 'cvxpy', 'matplotlib', 'numpy', 'scipy', 'pandas', 'control', 'sympy')"
    code = (
        f"import sys, symheli, identification, synthesis; print([m for m in {heavy} if"
        " m in sys.modules])"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.strip()
    assert loaded == "[]"


@pytest.mark.parametrize(
    "package", [m for m in PACKAGES if Path(str(module(m).__file__)).with_suffix(".pyi").exists()]
)
def test_what_a_package_loads_at_first_use_is_what_its_stub_says(package):
    """The stub is the one list of public names: each is there, and public for a type checker."""
    own = importlib.import_module(package)
    stub = Path(own.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    typed = {
        alias.name: (node.module, alias.asname)
        for node in ast.parse(stub).body
        if isinstance(node, ast.ImportFrom) and node.module != package  # its submodules
        for alias in node.names
    }
    assert sorted(typed) == own.__all__
    for name, (home, public) in typed.items():
        assert public == name  # else a type checker takes it for private
        assert getattr(own, name) is getattr(importlib.import_module(home), name)
    assert set(own.__all__) <= set(dir(own))
    with pytest.raises(AttributeError, match="no attribute 'no_such_name'"):
        own.no_such_name  # noqa: B018


def test_importing_the_studies_changes_no_environment_variable():
    modules = ["studies", "studies.cli", "studies.threads"]
    code = f"""
import importlib, os
before = dict(os.environ)
for module in {modules}:
    importlib.import_module(module)
print(before == dict(os.environ))
"""
    said = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={}
    ).stdout.strip()
    assert said == "True"


def test_a_process_that_starts_here_asks_for_one_thread_unless_told_otherwise(monkeypatch):
    from studies.threads import BLAS, one_thread

    for variable in BLAS:
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv(BLAS[0], "2")
    one_thread()
    assert [os.environ[variable] for variable in BLAS] == ["2", "1", "1"]
    numpy_first = "import sys, studies.threads, studies.cli; print('numpy' in sys.modules)"
    said = subprocess.run(
        [sys.executable, "-c", numpy_first], capture_output=True, text=True, check=True
    ).stdout.strip()
    assert said == "False"  # one_thread comes in time


def test_a_script_beside_a_folder_called_symheli_imports_the_package(tmp_path):
    """As a script beside the clone does: a folder without __init__.py must not pass for the
    package.
    """
    for room in ROOMS:
        (tmp_path / room).mkdir()
    script = tmp_path / "script.py"
    script.write_text(
        "import identification, studies, symheli, synthesis\nsymheli.Helicopter, synthesis.l2_gain"
    )
    subprocess.run([sys.executable, str(script)], check=True, capture_output=True, cwd=tmp_path)


@pytest.mark.parametrize("room", [*ROOMS, "evidence", "tests", "examples", "benchmarks", "docs"])
def test_no_path_of_somebodys_computer(room):
    machine = re.compile(r"(?<![\w.])/(?:home|root|Users|work|tmp|mnt|opt)/\w")
    wrong = [
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for path in (ROOT / room).rglob("*")
        if path.suffix in (".py", ".md", ".toml", ".j2", ".c", ".h")
        for line in path.read_text(encoding="utf-8").splitlines()
        if machine.search(line)
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.slow
def test_examples_run():
    own = "terminal_in_do_mpc"  # a package of others: its test runs it where that is installed
    paths = [path for path in sorted((ROOT / "examples").glob("*.py")) if path.stem != own]
    assert len(paths) >= 2
    for path in paths:
        subprocess.run([sys.executable, str(path)], check=True, capture_output=True, timeout=60)


LEANING = ("Of", "That", "Those", "As", "What", "Where")
"""First words that need the line above them."""


def found_at(path):
    """What a dotted path names: a module, a public name of one, an attribute of that."""
    parts = path.split(".")
    thing = importlib.import_module(parts[0])
    for part in parts[1:]:
        thing = getattr(thing, part)
    return thing


@pytest.mark.parametrize("package", ["symheli", "symheli.lpv", "identification", "synthesis"])
def test_every_docstring_of_the_face_stands_alone_and_points_to_others(package):
    """Its first sentence leans on nothing, and See Also names others that are there."""
    face = importlib.import_module(package)
    for name in face.__all__:
        text = inspect.getdoc(getattr(face, name))
        assert text.split()[0] not in LEANING, f"{package}.{name}"
        section = re.search(r"^See Also\n-{8}\n((?:\S.*\n?)+)", text, flags=re.MULTILINE)
        assert section, f"{package}.{name} points to nothing"
        others = [
            each.strip()
            for line in section[1].splitlines()
            for each in line.partition(" : ")[0].split(",")
        ]
        assert 1 <= len(others) <= 3, f"{package}.{name}"
        for other in others:
            assert inspect.getdoc(found_at(other)), f"{package}.{name}: {other}"
