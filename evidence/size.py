"""Size of the project: files, lines, classes and public names, and the way of a model through
`l2_gain`.

    python -m evidence.size
    python -m evidence.size --walk     the way of a model through static calls, today and before
"""

from __future__ import annotations

import argparse
import ast
import importlib
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from evidence.house import House
from evidence.walk import Walk

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("symheli", "identification", "synthesis", "studies")
BESIDE = ("evidence", "benchmarks", "tests")
PUBLIC = (*PACKAGES[:3], "symheli.lpv", "symheli.flight", "symheli.integrate", "symheli.records")


def counted(folder: str) -> tuple[int, int, int]:
    """Files (.py, .pyi, .c, .h), lines in them, and classes."""
    files = [
        f for f in sorted((ROOT / folder).rglob("*")) if f.suffix in (".py", ".pyi", ".c", ".h")
    ]
    texts = [file.read_text(encoding="utf-8") for file in files]
    trees = [ast.parse(t) for f, t in zip(files, texts, strict=True) if f.suffix == ".py"]
    classes = sum(isinstance(node, ast.ClassDef) for tree in trees for node in ast.walk(tree))
    return len(files), sum(t.count("\n") for t in texts), classes


def repeated() -> list[str]:
    """Class names that stand in more than one file of the packages."""
    found = Counter(
        node.name
        for package in PACKAGES
        for file in (ROOT / package).rglob("*.py")
        for node in ast.parse(file.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef)
    )
    return sorted(name for name, times in found.items() if times > 1)


def entered_at_run_time() -> list[str]:
    """Modules in which `l2_gain` of a model with one parameter hands the model itself to a
    function.
    """
    import symheli
    import synthesis

    p = symheli.Scheduling("p", "1", low=0.0, high=1.0, rate=0.5)
    model = symheli.LPVStateSpace.polynomial(
        [[[-1.0]], [[-0.5]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p
    )
    synthesis.l2_gain(model)  # loads what is loaded at first use
    seen: set[str] = set()

    def watch(frame, event, argument) -> None:
        here = str(frame.f_globals.get("__name__"))
        ours = here.split(".")[0] in PACKAGES and event == "call"
        if ours and any(value is model for value in frame.f_locals.values()):
            seen.add(here)

    sys.setprofile(watch)
    try:
        synthesis.l2_gain(model)
    finally:
        sys.setprofile(None)
    return sorted(seen)


QUESTIONS = ("synthesis/certify/questions/questions.py", "synthesis/analysis/questions.py")
"""Where `l2_gain` stands, and where it stood."""
BEFORE = "3fea9f6d"
"""The last commit before the rooms of synthesis had floors."""


def walked(root: Path) -> dict[str, list[str]]:
    """Return the modules that `model` of `l2_gain` enters by static calls, in a tree of sources."""
    path = next(path for path in QUESTIONS if (root / path).exists())
    start = path.removesuffix(".py").replace("/", "."), "l2_gain"
    return Walk(House(root)).follow(start, "model")


def walk() -> None:
    """Print the way of a model through static calls, today and at `BEFORE`."""
    with tempfile.TemporaryDirectory() as folder:
        archive = subprocess.run(
            ["git", "archive", BEFORE, *PACKAGES], cwd=ROOT, capture_output=True, check=True
        ).stdout
        subprocess.run(["tar", "-x", "-C", folder], input=archive, check=True)
        before = walked(Path(folder))
    for when, entered in ((BEFORE, before), ("today", walked(ROOT))):
        print(f"{when}: a model enters {len(entered)} modules in l2_gain by static calls")
        for module, functions in sorted(entered.items()):
            print(f"  {module}: {', '.join(functions)}")
    print(f"at run time, of one parameter, today: {len(entered_at_run_time())} modules")


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--walk", action="store_true", help="the way of a model through l2_gain")
    if parser.parse_args().walk:
        walk()
        return
    print(f"{'':16}{'files':>8}{'lines':>8}{'classes':>9}")
    for group in (PACKAGES, BESIDE):
        rows = [counted(folder) for folder in group]
        for folder, row in zip(group, rows, strict=True):
            print(f"{folder:16}{row[0]:8}{row[1]:8}{row[2]:9}")
        if group is PACKAGES:
            total = [sum(column) for column in zip(*rows, strict=True)]
            print(f"{'product':16}{total[0]:8}{total[1]:8}{total[2]:9}")
    names = {package: importlib.import_module(package).__all__ for package in PUBLIC}
    print(", ".join(f"{package} {len(public)}" for package, public in names.items()), end=": ")
    print(len(set().union(*names.values())), "different public names")
    print("class names in two files or more:", ", ".join(repeated()))
    modules = entered_at_run_time()
    print(f"a model passes through {len(modules)} modules in l2_gain: {', '.join(modules)}")


if __name__ == "__main__":
    main()
