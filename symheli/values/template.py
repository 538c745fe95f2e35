"""Templates: source files written out with a few marked places filled."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

_MARK = re.compile(r"/\* @(\w+)@ \*/|@(\w+)@")
"""A C comment of its own, which a block of code replaces, or a word."""


def filled(path: Path, places: Mapping[str, object], names: Mapping[str, str] | None = None) -> str:
    """Return the text of the file at `path` with each marked place @key@ filled and each of `names`
    renamed.

    A name is replaced where it begins: {"model_": "roll_"} turns model_init into roll_init. Raises
    `ValueError` for a marked place that nothing fills, and for a place or a name that is not in the
    file.
    """
    text = path.read_text(encoding="utf-8")
    marks = {match[1] or match[2] for match in _MARK.finditer(text)}
    if marks != set(places):
        raise ValueError(
            f"{path.name}: its marked places are {sorted(marks)}, filled are {sorted(places)}"
        )
    for old, new in (names or {}).items():
        text, count = re.subn(rf"(?<![\w.]){re.escape(old)}", lambda _, new=new: new, text)
        if not count:
            raise ValueError(f"{path.name}: {old} is not in it")
    return _MARK.sub(lambda match: str(places[match[1] or match[2]]), text)


def filled_module(
    stem: Path,
    name: str,
    header: Mapping[str, object],
    source: Mapping[str, object],
    check: Mapping[str, object],
) -> dict[str, str]:
    """{NAME.h, NAME.c, NAME_check.c}: the texts of STEM.h, STEM.c and STEM_check.c with their
    marked places filled, and NAME for the last word of STEM in every name of theirs.
    """
    word = stem.name.rpartition("_")[2]
    names = {f"{word}_": f"{name}_", f"{word.upper()}_": f"{name.upper()}_"}
    own = names | {f"{word}.": f"{name}."}
    return {
        f"{name}.h": filled(stem.with_name(f"{stem.name}.h"), header, names),
        f"{name}.c": filled(stem.with_name(f"{stem.name}.c"), source, own),
        f"{name}_check.c": filled(
            stem.with_name(f"{stem.name}_check.c"), check, own | {f"{word}:": f"{name}:"}
        ),
    }
