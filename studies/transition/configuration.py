"""Configuration of a run of the study, in a TOML file: written with its defaults, read with all
errors at once, stored beside the results.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

from studies.choices import (
    about,
    beside,
    check,
    checked,
    choice,
    commented,
    default,
    entries,
    sentence,
    toml,
)
from studies.transition.effort import Effort
from symheli.errors import InputError
from symheli.values.whole_files import write_text

KEPT = "study.toml"
"""In the folder of a run: what it was asked for."""


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """All options of a run. Raises `InputError` for a wrong type or a value out of range."""

    vehicle: str = choice("xcell60", "packaged airframe, or a vehicle file")
    seed: int = choice(0, "of excitation and noise", least=0)
    out: Path = field(default=Path("study"), metadata=about("folder of report and numbers"))
    quick: bool = choice(False, "a look: other defaults of [effort]")
    effort: Effort = field(default_factory=Effort, metadata=about("how much is done"))

    def __post_init__(self) -> None:
        check(self)

    @classmethod
    def of(cls, given: Mapping[str, Any], source: str = "the configuration") -> Configuration:
        """Return the configuration of a table's entries; `effort` holds differences from its
        defaults.

        Raises `InputError` with everything that is wrong, by the name of the key.
        """
        complaints: list[str] = []
        found = checked(cls, given, complaints)
        effort = _effort(bool(found.get("quick")), found.pop("effort", {}), complaints)
        if complaints:
            counted = f"{len(complaints)} entries are" if len(complaints) > 1 else "an entry is"
            raise InputError(f"{source}: {counted} wrong: {'; '.join(complaints)}")
        return cls(**found, effort=effort)

    @classmethod
    def read(cls, path: Path | None, options: Mapping[str, Any]) -> Configuration:
        """The file (None: only defaults) with `options` in place of its entries of these names.

        Paths of the file are relative to it. Raises `InputError` for a file that cannot be read, or
        with everything that is wrong in it.
        """
        usual = default(cls, "out")
        given = {} if path is None else entries(path, "study", usual)
        return cls.of({**given, **options}, str(path or "options"))

    def write(self, path: Path) -> Path:
        """Write all options, defaults too."""
        return write_text(path, self.text(path.parent, active=True))

    def text(self, folder: Path, active: bool = False) -> str:
        """Return the file as it stands in this folder: [effort] as comments to change, or
        `active`.
        """
        return "\n".join(self._lines(folder, active)) + "\n"

    def _lines(self, folder: Path, active: bool) -> Iterator[str]:
        yield "# symheli study FILE runs what this file asks for; options of the command line win."
        yield "# Paths are relative to this file."
        yield ""
        for name in ("vehicle", "seed", "out", "quick"):
            value = beside(self, name, folder)
            yield f"{name} = {toml(value)}  # {sentence(Configuration, name)}"
        yield ""
        yield "[effort]"
        if not active:
            yield "# These are the defaults: remove the # to change one."
        yield from _entries_of(self.effort, "effort", "" if active else "# ")


def _effort(quick: bool, changes: Any, complaints: list[str]) -> Effort:
    """Return the default effort, or that of a quick look, with these changes."""
    base = Effort.look() if quick else Effort()
    if isinstance(changes, Effort):
        return changes
    for name, value in changes.items():
        if isinstance(value, Mapping):
            try:
                changes = {**changes, name: replace(getattr(base, name), **value)}
            except InputError as error:
                complaints.append(f"effort.{name}: {error}")
    return base if complaints else replace(base, **changes)


def _entries_of(thing: Any, table: str, mark: str) -> Iterator[str]:
    """Lines of a table, those of the tables in it last."""
    inner = []
    for f in fields(thing):
        value = getattr(thing, f.name)
        if is_dataclass(value):
            inner.append((f.name, value))
        elif value is not None:
            entry, comment = f"{mark}{f.name} = {toml(value)}", sentence(type(thing), f.name)
            yield from commented(entry, comment)
    for name, value in inner:
        comment = sentence(type(thing), name)
        yield from ("", f"{mark}[{table}.{name}]  # {comment}")
        yield from _entries_of(value, f"{table}.{name}", mark)
