"""One token changed at a time in the proof code of a room, and whether its guards see it.

    python -m evidence.token_mutants proof --count 20

The places are drawn by a seed; comments, docstrings, messages and annotations are left alone.
"""

from __future__ import annotations

import argparse
import ast
import io
import random
import tempfile
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from evidence.mutants import ROOT, copy, passes

OTHER = {
    "+": "-",
    "-": "+",
    "*": "/",
    "/": "*",
    "<": "<=",
    "<=": "<",
    ">": ">=",
    ">=": ">",
    "==": "!=",
    "!=": "==",
    "and": "or",
    "or": "and",
    "all": "any",
    "any": "all",
    "max": "min",
    "min": "max",
    "True": "False",
    "False": "True",
    "0": "1",
    "1": "2",
    "2": "1",
    "-1": "1",
    "0.0": "1.0",
    "1.0": "2.0",
    "2.0": "1.0",
    "not": "bool",
}
"""What a token becomes."""
STATEMENTS = "tests/synthesis/test_proven_statements.py tests/synthesis/test_lying_solvers.py"


class Room(NamedTuple):
    """Files whose tokens are changed, and the tests that must see it."""

    files: tuple[str, ...]
    tests: str


ROOMS = {
    "proof": Room(
        (
            "synthesis/certify/proof/box.py",
            "synthesis/certify/proof/inequalities.py",
            "synthesis/certify/proof/one_parameter.py",
        ),
        f"{STATEMENTS} tests/synthesis/certify/test_no_false_proof.py"
        " tests/synthesis/certify/test_second_witness.py"
        " tests/synthesis/certify/test_gain_closed_forms.py"
        " tests/synthesis/certify/test_uncertain_models.py"
        " tests/synthesis/certify/test_saved_certificates.py"
        " tests/synthesis/certify/test_sharper_lyapunov_functions.py",
    ),
    "lft": Room(
        ("synthesis/certify/lft/proof.py",),
        f"{STATEMENTS} tests/synthesis/certify/test_lft_gain.py",
    ),
    "sets": Room(
        ("synthesis/sets/proof.py", "synthesis/sets/inequality.py"),
        f"{STATEMENTS} tests/synthesis/sets",
    ),
    "switching": Room(
        ("synthesis/switching/inequality.py",),
        f"{STATEMENTS} tests/synthesis/switching",
    ),
    "tubes": Room(
        ("synthesis/tubes/proof.py", "synthesis/tubes/inequality.py"),
        f"{STATEMENTS} tests/synthesis/tubes",
    ),
}


class Change(NamedTuple):
    """A token of a line of a file, and what it becomes."""

    file: str
    line: int
    column: int
    right: str
    wrong: str


def changes(file: str) -> Iterator[Change]:
    """Yield every change of one token that can be made in the code of functions of a file."""
    text = (ROOT / file).read_text(encoding="utf-8")
    inside = _of_functions(ast.parse(text))
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        wrong = OTHER.get(token.string)
        if wrong and token.start[0] in inside and token.type != tokenize.STRING:
            yield Change(file, *token.start, token.string, wrong)


def _of_functions(tree: ast.Module) -> set[int]:
    """The lines of statements in functions, without signatures, messages and raised errors."""
    lines: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            body = node.body[1:] if isinstance(node.body[0], ast.Expr) else node.body
            for each in body:
                lines |= set(range(each.lineno, (each.end_lineno or each.lineno) + 1))
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise | ast.JoinedStr | ast.Assert):
            lines -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return lines


def caught(change: Change, tests: str, folder: Path) -> bool:
    """Whether a test fails once the token is another in the copy, which is right again after."""
    path = folder / change.file
    text = path.read_text(encoding="utf-8")
    rows = text.splitlines(keepends=True)
    row, end = rows[change.line - 1], change.column + len(change.right)
    rows[change.line - 1] = row[: change.column] + change.wrong + row[end:]
    path.write_text("".join(rows), encoding="utf-8")
    try:
        return not passes(tests, folder)
    except RuntimeError:  # the tests could not even be collected
        return True
    finally:
        path.write_text(text, encoding="utf-8")


def main() -> None:
    """Print which changes the tests of a room see."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("room", choices=ROOMS)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    room = ROOMS[asked.room]
    every = [change for file in room.files for change in changes(file)]
    chosen = random.Random(asked.seed).sample(every, min(asked.count, len(every)))
    seen = 0
    with tempfile.TemporaryDirectory() as name:
        folder = copy(Path(name))
        if not passes(room.tests, folder):
            raise SystemExit("the tests of this room fail as they are")
        for change in chosen:
            found = caught(change, room.tests, folder)
            seen += found
            word = "seen  " if found else "MISSED"
            at = f"{change.file}:{change.line}:{change.column}"
            print(f"{word} {at} {change.right} -> {change.wrong}", flush=True)
    print(f"{seen} of {len(chosen)} seen, of {len(every)} places")


if __name__ == "__main__":
    main()
