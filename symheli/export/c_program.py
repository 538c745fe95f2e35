"""C99 modules written from templates: header, source, and a program that checks the compiled
code.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from symheli.export.c_text import require_identifier
from symheli.values.whole_files import write_own, write_text

_PLACE = re.compile(r"/\* @(\w+)@ \*/|@(\w+)@")
"""A place to fill: a C comment of its own, which a block of code replaces, or a word."""


@dataclass(frozen=True, kw_only=True)
class CProgram:
    """A C module and its check program: the files NAME.h, NAME.c and NAME_check.c.

    The compiled check program exits with 0 if the module reproduces the numbers that were computed
    in Python and are tabulated in it.

    Parameters
    ----------
    template : path
        STEM of the templates STEM.h, STEM.c and STEM_check.c.
    name : str
        NAME of the files, and of the functions and macros if a `word` is replaced.
    word : str
        Word in the templates that `name` replaces wherever a name begins with it, also in capitals;
        a name must then be a C identifier. Empty: no name is replaced.
    header, source, check : mapping of str to object
        Texts or numbers for the marked places of each file.
    check_template : path, optional
        Template of the check program, if it is another.
    before, after : mapping of str to str
        Further files by name, written before and after the three.
    cmake : (path, mapping), optional
        Template of a CMakeLists.txt and what fills its places.

    Raises
    ------
    InputError
        The name is no C identifier.
    """

    template: Path
    name: str
    word: str = ""
    header: Mapping[str, object]
    source: Mapping[str, object] = field(default_factory=dict)
    check: Mapping[str, object]
    check_template: Path | None = None
    before: Mapping[str, str] = field(default_factory=dict)
    after: Mapping[str, str] = field(default_factory=dict)
    cmake: tuple[Path, Mapping[str, object]] | None = None

    def __post_init__(self) -> None:
        if self.word:
            require_identifier(self.name)

    @property
    def files(self) -> dict[str, str]:
        """Texts of the files by their names, but for CMakeLists.txt."""
        name, word = self.name, self.word
        names, own, printed = {}, {}, {}
        if word:
            names = {f"{word}_": f"{name}_", f"{word.upper()}_": f"{name.upper()}_"}
            own = names | {f"{word}.": f"{name}."}
            printed = {f"{word}:": f"{name}:"}
        template = str(self.template)
        check = self.check_template or Path(f"{template}_check.c")
        return {
            **self.before,
            f"{name}.h": filled(Path(f"{template}.h"), self.header, names),
            f"{name}.c": filled(Path(f"{template}.c"), self.source, own),
            f"{name}_check.c": filled(check, self.check, own | printed),
            **self.after,
        }

    def write(self, folder: str | os.PathLike[str]) -> tuple[Path, ...]:
        """Write the files into a folder, made as needed, and return their paths.

        A CMakeLists.txt of another author is left alone and not returned. Raises `SymheliError` if
        a file cannot be written.
        """
        folder = Path(folder)
        written = tuple(write_text(folder / name, text) for name, text in self.files.items())
        if self.cmake is None:
            return written
        own = write_own(folder / "CMakeLists.txt", filled(*self.cmake))
        return written if own is None else (*written, own)


def filled(path: Path, places: Mapping[str, object], names: Mapping[str, str] | None = None) -> str:
    """The text of the file at `path` with each marked place @key@ filled and each of `names`
    renamed.

    A name is replaced where it begins: {"model_": "roll_"} turns model_init into roll_init. Raises
    `ValueError` for a marked place that nothing fills, and for a place or a name that is not in the
    file.
    """
    text = path.read_text(encoding="utf-8")
    marks = {match[1] or match[2] for match in _PLACE.finditer(text)}
    if marks != set(places):
        raise ValueError(
            f"{path.name}: its marked places are {sorted(marks)}, filled are {sorted(places)}"
        )
    for old, new in (names or {}).items():
        text, count = re.subn(rf"(?<![\w.]){re.escape(old)}", lambda _, new=new: new, text)
        if not count:
            raise ValueError(f"{path.name}: {old} is not in it")
    return _PLACE.sub(lambda match: str(places[match[1] or match[2]]), text)
