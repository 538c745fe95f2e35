"""What a run of the study is asked for, in a TOML file: written with its defaults, read with every
complaint at once, kept beside the results.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

from studies.choices import about, check, checked, choice, default, sentence, toml
from studies.transition.effort import Effort
from symheli.errors import InputError
from symheli.values.whole_files import write_text

KEPT = "study.toml"
"""In the folder of a run: what it was asked for."""
WIDTH = 100


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """All that a run may be asked for. Raises `InputError` for what is of another type or out of
    range.
    """

    vehicle: str = choice("xcell60", "packaged airframe, or a vehicle file")
    seed: int = choice(0, "of excitation and noise", least=0)
    out: Path = field(default=Path("study"), metadata=about("folder of report and numbers"))
    quick: bool = choice(False, "a look: other defaults of [effort]")
    effort: Effort = field(default_factory=Effort, metadata=about("how much is done"))

    def __post_init__(self) -> None:
        check(self)

    @classmethod
    def of(cls, given: Mapping[str, Any], source: str = "the configuration") -> Configuration:
        """What the entries of a table ask for; `effort` holds what differs from its defaults.

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
        entries = {} if path is None else _entries(path)
        return cls.of({**entries, **options}, str(path or "options"))

    def write(self, path: Path) -> Path:
        """Write everything that was asked for, defaults too."""
        return write_text(path, self.text(path.parent, active=True))

    def text(self, folder: Path, active: bool = False) -> str:
        """The file as it stands in this folder: [effort] as comments to change, or `active`."""
        return "\n".join(self._lines(folder, active)) + "\n"

    def _lines(self, folder: Path, active: bool) -> Iterator[str]:
        yield "# symheli study FILE runs what this file asks for; options of the command line win."
        yield "# Paths are relative to this file."
        yield ""
        vehicle = Path(self.vehicle)
        paths = {"out": _beside(self.out, folder)}
        if vehicle.is_file():
            paths["vehicle"] = _beside(vehicle, folder)
        for name in ("vehicle", "seed", "out", "quick"):
            value = paths.get(name, getattr(self, name))
            yield f"{name} = {toml(value)}  # {sentence(Configuration, name)}"
        yield ""
        yield "[effort]"
        if not active:
            yield "# These are the defaults: remove the # to change one."
        yield from _entries_of(self.effort, "effort", "" if active else "# ")


def _effort(quick: bool, changes: Any, complaints: list[str]) -> Effort:
    """The usual effort, or that of a look, with these changes."""
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


def _entries(path: Path) -> dict[str, Any]:
    try:
        found = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(
            f"{path} is not there; symheli study --write-config {path} writes one with the defaults"
        ) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is no TOML file: {error}") from error
    if isinstance(out := found.get("out", str(default(Configuration, "out"))), str):
        found["out"] = str(path.parent / out)
    vehicle = found.get("vehicle")
    if isinstance(vehicle, str) and (path.parent / vehicle).is_file():
        found["vehicle"] = str(path.parent / vehicle)
    return found


def _entries_of(thing: Any, table: str, mark: str) -> Iterator[str]:
    """Lines of a table, those of the tables in it last."""
    inner = []
    for f in fields(thing):
        value = getattr(thing, f.name)
        if is_dataclass(value):
            inner.append((f.name, value))
        elif value is not None:
            entry, said = f"{mark}{f.name} = {toml(value)}", sentence(type(thing), f.name)
            if not said:
                yield entry
            elif len(entry) + len(said) + 4 <= WIDTH:
                yield f"{entry}  # {said}"
            else:
                yield from (f"# {said}:", entry)
    for name, value in inner:
        said = sentence(type(thing), name)
        yield from ("", f"{mark}[{table}.{name}]  # {said}")
        yield from _entries_of(value, f"{table}.{name}", mark)


def _beside(path: Path, folder: Path) -> str:
    """Relative to the folder where it can be."""
    try:
        return os.path.relpath(path, folder).replace(os.sep, "/")
    except ValueError:  # another drive
        return str(path.absolute())
