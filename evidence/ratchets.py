"""Numbers of the project that may not rise without a reason: ratchets.toml keeps them.

    python -m evidence.ratchets            each number beside its limit
    python -m evidence.ratchets --lower    write the numbers that have fallen as the new limits

A limit rises in the commit that edits ratchets.toml: `was` keeps the old one, `reason` says why.
"""

from __future__ import annotations

import argparse
import importlib
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

from evidence.house import PACKAGES, PROOF, ROOT, House, arrows, table
from evidence.tables import APPENDIX

FILE = Path(__file__).with_suffix(".toml")
FACES = ("symheli", "symheli.lpv", "identification", "synthesis")
LEANING = ("Of", "That", "Those", "As", "What", "Where")
"""First words of a docstring that refer to the line above."""
LONG = 40
"""Words of a sentence that is too long."""


def prose(text: str) -> str:
    """Return a page without code, tables, links' addresses and comments."""
    text = re.sub(r"```.*?```|\$\$.*?\$\$|<!--.*?-->", "", text, flags=re.S)
    lines = (line for line in text.splitlines() if not re.match(r" {4}|\s*\|", line))
    return re.sub(r"\]\([^)]*\)|`[^`]*`|\$[^$]*\$", "X", "\n".join(lines))


def sentences(text: str) -> list[str]:
    """Return the sentences of a page's prose; an item of a list and a heading end one too."""
    parts = re.split(r"(?<=[.!?:;])\s+(?=[A-Z`*(\[])|\n\s*\n|\n\s*[-*#]|\n\s*\d+\. ", prose(text))
    return [part for part in parts if part.strip()]


def first_words(house: House) -> Iterator[str]:
    """Yield the first word of every docstring of the packages, those of constants too."""
    for path in house.files.values():
        yield from re.findall(r'^\s*"""(\w+)', path.read_text(encoding="utf-8"), re.MULTILINE)


def measured(house: House | None = None) -> dict[str, int]:
    """Return every number that is kept, by name, of a house that is read already or read anew."""
    house = house or House()
    pages = [
        p.read_text(encoding="utf-8")
        for p in sorted((ROOT / "docs").rglob("*.md"))
        if p.parent.name != APPENDIX
    ]
    every = {package: importlib.import_module(package).__all__ for package in FACES}
    return {
        "files": len(house.files),
        "lines": house.lines(house.files),
        "rooms": sum(map(len, table().values())),
        "arrows": sum(len(arrows(house, package)) for package in PACKAGES),
        "lines_of_the_proof": house.lines(house.closure(PROOF)),
        "public_names": len({(p, n) for p, names in every.items() for n in names}),
        "words_of_docs": sum(len(prose(page).split()) for page in pages),
        "words_of_pages": sum(len(page.split()) for page in pages),
        "long_sentences": sum(len(s.split()) > LONG for page in pages for s in sentences(page)),
        "leaning_docstrings": sum(word in LEANING for word in first_words(house)),
    }


def limits() -> dict[str, dict]:
    """Return the limit of each number, the one before, and the reason where it rose."""
    return tomllib.loads(FILE.read_text(encoding="utf-8"))


def main() -> None:
    """Print each number beside its limit; lower the limits where that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lower", action="store_true", help="write what has fallen")
    lower = parser.parse_args().lower
    found, text = measured(), FILE.read_text(encoding="utf-8")
    for name, limit in limits().items():
        value = found.get(name)
        print(f"{name:20}{'' if value is None else value:>8}{limit['limit']:>8}")
        if lower and value is not None and value < limit["limit"]:
            own = re.compile(rf"(\[{name}\]\n)(?:.+\n)+")
            text = own.sub(rf"\g<1>limit = {value}\nwas = {limit['limit']}\n", text)
    if lower:
        FILE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
