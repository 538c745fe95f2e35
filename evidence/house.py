"""The rooms of the packages: which room imports which, what a proof rests on, and ratchets.

    python -m evidence.house            rooms, arrows, circles, and lines that a proof rests on
    python -m evidence.house --write    the tables of docs/architecture.md

The rooms and their order stand in house.toml, the numbers that may not rise in ratchets.toml.
"""

from __future__ import annotations

import argparse
import ast
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Literal, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
HERE = Path(__file__).resolve().parent
PACKAGES = ("symheli", "identification", "synthesis", "studies")
PROOF = ("synthesis.certify.proof", "synthesis.certify.questions.certificate_file")
"""What verifies a certificate that was read from its file: a package and a module."""
PAGE = ROOT / "docs" / "architecture.md"

When = Literal["load", "lazy", "types"]


class Import(NamedTuple):
    """One imported name of a file: its module, the name (None: the module itself), line and time.

    `when`: "load" of the file, "lazy" within a function, or for "types" only.
    """

    module: str
    name: str | None
    line: int
    when: When


@dataclass(frozen=True, eq=False)
class House:
    """The source files of the packages below a folder, by module."""

    root: Path = ROOT
    packages: tuple[str, ...] = PACKAGES
    files: dict[str, Path] = field(init=False)
    homes: dict[str, dict[str, tuple[str, str]]] = field(init=False)

    def __post_init__(self) -> None:
        """Find files and the homes of public names."""
        files = {
            ".".join(path.relative_to(self.root).with_suffix("").parts).removesuffix(
                ".__init__"
            ): path
            for package in self.packages
            for path in sorted((self.root / package).rglob("*.py"))
        }
        object.__setattr__(self, "files", files)
        homes = {
            m: _exports(path)
            for m, path in files.items()
            if path.name == "__init__.py" or path.with_suffix(".pyi").exists()
        }
        object.__setattr__(self, "homes", homes)

    def home(self, module: str, name: str) -> tuple[str, str | None]:
        """Return where a name of a module is defined; (module, None) where it is a module."""
        for _ in range(9):
            here = self.homes.get(module, {}).get(name)
            if here is None or here == (module, name):
                break
            module, name = here
        return (f"{module}.{name}", None) if f"{module}.{name}" in self.files else (module, name)

    def imports(self, module: str) -> tuple[Import, ...]:
        """Return what a file imports of the packages, wherever in it, names at their homes."""
        return _imports(self, module)

    def lines(self, modules: Iterable[str]) -> int:
        """Return the number of lines of these files together."""
        return sum(len(self.files[m].read_text(encoding="utf-8").splitlines()) for m in modules)

    def closure(self, starts: Sequence[str]) -> set[str]:
        """Return every file that these need, transitively, lazy imports too, types not.

        Packages on the way are counted too.
        """
        todo = [m for m in self.files if any(m == s or m.startswith(f"{s}.") for s in starts)]
        found: set[str] = set()
        while todo:
            module = todo.pop()
            if module in found:
                continue
            found.add(module)
            for each in self.imports(module):
                if each.when != "types":
                    parts = each.module.split(".")
                    above = (".".join(parts[:k]) for k in range(1, len(parts) + 1))
                    todo += [m for m in above if m in self.files]
        return found


def _exports(path: Path) -> dict[str, tuple[str, str]]:
    """Return where each name that a package exports comes from: its stub, else its imports."""
    stub = path.with_suffix(".pyi")
    tree = ast.parse((stub if stub.exists() else path).read_text(encoding="utf-8"))
    return {
        alias.asname or alias.name: (node.module, alias.name)
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }


@cache
def _imports(house: House, module: str) -> tuple[Import, ...]:
    tree = ast.parse(house.files[module].read_text(encoding="utf-8"))
    ours = house.packages
    found: list[Import] = []
    bound: dict[str, str] = {}

    def of(name: str) -> bool:
        return name.split(".")[0] in ours

    def visit(node: ast.AST, when: When) -> None:
        for child in ast.iter_child_nodes(node):
            inner = when
            if when == "load" and isinstance(child, ast.FunctionDef | ast.Lambda):
                inner = "lazy"
            elif isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test):
                inner = "types"
            if isinstance(child, ast.ImportFrom) and child.module and of(child.module):
                for alias in child.names:
                    home = house.home(child.module, alias.name)
                    found.append(Import(*home, child.lineno, inner))
            elif isinstance(child, ast.Import):
                for alias in child.names:
                    if of(alias.name):
                        bound[alias.asname or alias.name.split(".")[0]] = alias.name
                        found.append(Import(alias.name, None, child.lineno, inner))
            visit(child, inner)

    visit(tree, "load")
    for node in ast.walk(tree) if bound else ():
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            package = bound.get(node.value.id)
            if package is not None:
                found.append(Import(*house.home(package, node.attr), node.lineno, "lazy"))
    return tuple(found)


class Room(NamedTuple):
    """A room of a package: its place from the bottom, what it holds, and whether it is a ring."""

    name: str
    place: int
    holds: str
    ring: bool = False


@cache
def table() -> dict[str, tuple[Room, ...]]:
    """Return the rooms of each package, from the bottom to the top, as house.toml lists them."""
    listed = tomllib.loads((HERE / "house.toml").read_text(encoding="utf-8"))["package"]
    out = {}
    for package in listed:
        rows = [(*row, False) for row in package["rooms"]]
        rows += [(*row, True) for row in package.get("rings", ())]
        out[package["name"]] = tuple(
            Room(f"{package['name']}.{name}", place, holds, ring)
            for place, (name, holds, ring) in enumerate(rows)
        )
    return out


def sees() -> dict[str, tuple[str, ...]]:
    """Return what each room may see of the packages below its own."""
    listed = tomllib.loads((HERE / "house.toml").read_text(encoding="utf-8"))["sees"]
    return {room: tuple(names) for room, names in listed.items()}


@cache
def room_of(module: str) -> Room | None:
    """Return the room in which a module lies; None at the top of its package."""
    around = [room for room in table()[module.split(".")[0]] if inside(module, (room.name,))]
    return max(around, key=lambda room: len(room.name), default=None)


def arrows(house: House, package: str) -> dict[tuple[Room, Room], list[str]]:
    """Return which rooms of a package import which, lazily or for types too, with every place."""
    found: dict[tuple[Room, Room], list[str]] = {}
    for module, path in house.files.items():
        here = room_of(module)
        if module.split(".")[0] != package or here is None:
            continue
        for each in house.imports(module):
            there = room_of(each.module) if each.module.split(".")[0] == package else None
            if there is not None and there != here:
                where = f"{path.relative_to(house.root)}:{each.line} imports {each.module}"
                found.setdefault((here, there), []).append(where)
    return found


def upward(found: Iterable[tuple[Room, Room]]) -> Iterator[tuple[Room, Room]]:
    """Yield the arrows that lead to a room above, or from one ring to another."""
    for here, there in found:
        if there.place > here.place or (here.ring and there.ring):
            yield here, there


def roomless(house: House) -> list[str]:
    """Return the files that lie in no room of the table, nor are faces; `__init__` is in none."""
    faces = tomllib.loads((HERE / "house.toml").read_text(encoding="utf-8"))["faces"]
    return [
        str(path.relative_to(house.root))
        for module, path in house.files.items()
        if path.name not in ("__init__.py", "__main__.py")
        and room_of(module) is None
        and module not in faces
    ]


def outside(house: House) -> list[str]:
    """Return every import of another package that `sees` does not allow."""
    allowed, wrong = sees(), []
    for module, path in house.files.items():
        package = module.split(".")[0]
        own = {n for room, names in allowed.items() if inside(module, (room,)) for n in names}
        for each in house.imports(module):
            name = f"{each.module}.{each.name}" if each.name else each.module
            if each.module.split(".")[0] == package or (each.module in PACKAGES and not each.name):
                continue
            if not inside(name, own):
                wrong.append(f"{path.relative_to(house.root)}:{each.line} imports {name}")
    return wrong


def inside(name: str, packages: Iterable[str]) -> bool:
    """Whether a dotted name is one of these, or lies below one."""
    return any(name == package or name.startswith(f"{package}.") for package in packages)


def circles(house: House) -> list[list[str]]:
    """Return circles of files, counting only what is imported when a file is loaded."""
    edges = {
        m: {
            e.module
            for e in house.imports(m)
            if e.when == "load" and e.module in house.files and e.module != m
        }
        for m in house.files
    }
    done: set[str] = set()
    found: list[list[str]] = []

    def visit(module: str, trail: list[str]) -> None:
        if module in trail:
            found.append([*trail[trail.index(module) :], module])
        elif module not in done:
            for other in sorted(edges[module]):
                visit(other, [*trail, module])
            done.add(module)

    for module in sorted(edges):
        visit(module, [])
    return found


def page_table(package: str) -> str:
    """Return the rooms of a package as a table in Markdown."""
    rows = ["| room | holds |", "|---|---|"]
    rows += [
        f"| `{room.name}`{' (ring)' if room.ring else ''} | {room.holds} |"
        for room in table()[package]
    ]
    return "\n".join(rows)


def marks(package: str) -> tuple[str, str]:
    """Return the lines between which the table of a package stands on the page."""
    return (
        f"<!-- rooms of {package}: python -m evidence.house --write -->",
        f"<!-- rooms of {package}: end -->",
    )


def with_tables(page: str) -> str:
    """Return the text of a page with the tables of the rooms as house.toml has them."""
    for package in table():
        begin, end = marks(package)
        before, rest = page.split(begin, 1)
        page = f"{before}{begin}\n\n{page_table(package)}\n\n{end}{rest.split(end, 1)[1]}"
    return page


def main() -> None:
    """Print rooms, arrows and circles of each package, and the lines that a proof rests on."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write the tables of architecture.md")
    if parser.parse_args().write:
        PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    house = House()
    for package, rooms in table().items():
        found = arrows(house, package)
        up = list(upward(found))
        print(f"{package:16}{len(rooms):4} rooms{len(found):5} arrows{len(up):4} upwards")
    print(f"{len(circles(house))} circles of files at load, {len(outside(house))} imports outside")
    closure = house.closure(PROOF)
    print(f"a proof rests on {len(closure)} files, {house.lines(closure)} lines")


if __name__ == "__main__":
    main()
