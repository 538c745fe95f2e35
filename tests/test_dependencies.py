"""What is imported is declared: by itself where it is always needed, else as an extra whose name
the message gives.
"""

import ast
import re
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

from studies.commands import doctor
from symheli.errors import InputError
from symheli.extras import extra

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("symheli", "identification", "synthesis", "studies")
PACKAGE = {"flint": "python-flint", "PIL": "pillow"}
"""Where a module is not called like what brings it."""
ASKED_FOR_BY_NAME = {"scs"}
"""Solvers: `Solver` refuses those that are not installed before they are imported."""


def names(requirements):
    return {re.match(r"[\w-]+", requirement)[0].lower() for requirement in requirements}


@cache
def declared():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return names(project["dependencies"]), {
        key: names(value) for key, value in project["optional-dependencies"].items()
    }


def parents(tree):
    return {child: node for node in ast.walk(tree) for child in ast.iter_child_nodes(node)}


def guards(node, above):
    """The with-, try- and if-statements around a node, as source, innermost first."""
    while node in above:
        node = above[node]
        if isinstance(node, ast.With):
            yield ast.unparse(node.items[0].context_expr)
        elif isinstance(node, ast.Try):
            yield " ".join(ast.unparse(h.type) for h in node.handlers if h.type)
        elif isinstance(node, ast.If):
            yield ast.unparse(node.test)


def imports(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node, node.module
        elif (
            isinstance(node, ast.Call)
            and ast.unparse(node.func) == "importlib.import_module"
            and isinstance(node.args[0], ast.Constant)
        ):
            yield node, node.args[0].value


def complaint(source, own=ROOMS):
    """What is wrong with the imports of a source text that may import the packages `own`: "" where
    nothing is.
    """
    core, extras = declared()
    tree = ast.parse(source)
    above = parents(tree)
    for node, module in imports(tree):
        top = module.split(".")[0]
        package = PACKAGE.get(top, top).lower()
        if top in sys.stdlib_module_names or top in own or package in core:
            continue
        around = list(guards(node, above))
        if "TYPE_CHECKING" in around or "ImportError" in around or top in ASKED_FOR_BY_NAME:
            if not any(package in brought for brought in extras.values()):
                return f"{module} is declared nowhere"
            continue
        said = [match[1] for text in around if (match := re.match(r"extra\('(\w+)'", text))]
        if not said or package not in extras.get(said[0], ()):
            return (
                f"{module} is no core dependency: import it inside `with extra(...)` of the extra"
                " that brings it"
            )
    return ""


@pytest.mark.slow(but="evidence")
@pytest.mark.parametrize("package", [*ROOMS, "evidence"])
def test_every_import_is_declared(package):
    own = (*ROOMS, "evidence") if package == "evidence" else ROOMS
    found = {
        str(path.relative_to(ROOT)): complaint(path.read_text(encoding="utf-8"), own)
        for path in sorted((ROOT / package).rglob("*.py"))
    }
    assert found
    assert not {path: why for path, why in found.items() if why}


def test_the_evidence_is_not_installed_and_no_package_imports_it():
    found = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    assert found["find"]["include"] == [f"{room}*" for room in ROOMS]
    assert complaint("from evidence.tables import keep")


def test_doctor_asks_for_what_is_declared():
    core, extras = declared()
    assert set(doctor.REQUIRED) == core
    assert set(doctor.OPTIONAL) <= set.union(*extras.values())


def test_an_import_that_nothing_declares_is_found():
    assert complaint("import requests")
    assert complaint("def f():\n    import pandas")
    assert complaint("with extra('rigorous', 'a table'):\n    import pandas")
    assert not complaint("with extra('logs', 'a table'):\n    import pandas")


def test_a_missing_extra_is_named_with_what_it_is_for():
    with (
        pytest.raises(
            InputError, match=r"reading stars needs astrolabe: pip install 'symheli\[logs\]'"
        ),
        extra("logs", "reading stars"),
    ):
        import astrolabe  # noqa: F401
