"""docs/appendix/tolerances.md lists every number by which something counts as small, equal or of no
rank: a new one is argued there, or this fails.
"""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "docs" / "appendix" / "tolerances.md"
ROOMS = ("synthesis", "symheli/lpv")
SMALL, LARGE = 0.01, 1e4
"""Numbers up to the one, 0 left out, and from the other on; between are shares, steps, counts."""
JUDGES = {"eps", "tiny", "spacing", "ulp", "isclose", "allclose", "matrix_rank", "pinv", "lstsq"}
"""Names that stand for the precision of numbers, or decide by it."""


def _is_number(node):
    return isinstance(node, ast.Constant) and isinstance(node.value, int | float)


def judges(tree):
    """(scope, line) of every tolerance: the constant that it is, or the function it stands in."""

    def visit(node, scope):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            scope = (*scope, node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign) and not scope:
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            names = [n.id for n in ast.walk(target) if isinstance(n, ast.Name)]
            scope = (", ".join(names),) if names else scope
        number = isinstance(node, ast.Constant) and isinstance(node.value, float)
        if number and (0 < abs(node.value) <= SMALL or abs(node.value) >= LARGE):
            yield ".".join(scope), node.lineno
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            below = isinstance(node.right, ast.UnaryOp) and isinstance(node.right.op, ast.USub)
            if below and isinstance(node.left, ast.Constant) and _is_number(node.right.operand):
                yield ".".join(scope), node.lineno
        name = {ast.Attribute: "attr", ast.Name: "id"}.get(type(node))
        if name and getattr(node, name) in JUDGES:
            yield ".".join(scope), node.lineno
        for child in ast.iter_child_nodes(node):
            yield from visit(child, scope)

    yield from visit(tree, ())


def found():
    every = {}
    for room in ROOMS:
        for path in sorted((ROOT / room).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            for scope, line in judges(ast.parse(path.read_text(encoding="utf-8"))):
                every.setdefault((name, scope), line)
    return every


def listed():
    """(file, scope) of the rows of the page: | `file` | `scope`, `scope` | ... |"""
    out = []
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if len(cells) == 4 and re.fullmatch(r"`[\w/]+\.py`", cells[0]):
            out += [(cells[0].strip("`"), scope) for scope in re.findall(r"`([^`]+)`", cells[1])]
    return out


def test_every_tolerance_is_on_the_page():
    missing = {at: line for at, line in found().items() if at not in listed()}
    assert not missing, f"argue these in {PAGE.name}: {missing}"


def test_the_page_lists_nothing_that_is_gone():
    rows = listed()
    assert len(set(rows)) == len(rows)
    assert set(rows) <= found().keys()


@pytest.mark.parametrize(
    "source",
    [
        "SLACK = 1e-9",
        "def f(x):\n    return x > 1e-12 * abs(x)",
        "class A:\n    def f(self, x):\n        return np.finfo(float).eps * x",
        "def f(x):\n    return np.linalg.matrix_rank(x)",
        "def f(x, least=1e-7):\n    return x > least",
        "SINGULAR = 1e12",
        "START = 2.0**-20",
    ],
)
def test_a_new_one_is_seen(source):
    assert list(judges(ast.parse(source)))
