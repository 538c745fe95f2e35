"""Choices that a TOML file makes: fields of a dataclass, each with its type, its range and a
sentence about it.
"""

from __future__ import annotations

import difflib
import json
import math
import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import MISSING, field, fields, is_dataclass
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

from symheli.errors import InputError

Table = Mapping[str, Any]

WIDTH = 100
"""Width of the lines of a written file, where possible."""
FILES = ("vehicle", "model")
"""Fields that may name a file."""


def about(meaning: str, least: float | None = None, empty: bool = False) -> dict[str, Any]:
    """Metadata of a field: numbers are at least `least`, lists and texts may be `empty`."""
    return {"meaning": meaning, "least": least, "empty": empty}


def choice(default: Any, meaning: str, least: float | None = None, empty: bool = False) -> Any:
    """A field with this default and `about` it."""
    return field(default=default, metadata=about(meaning, least, empty))


class _Wrong(Exception):
    """Raised with the expected value."""


def checked(kind: type, given: Table, complaints: list[str], where: str = "") -> dict[str, Any]:
    """The values of a table in the types of the fields of `kind`; what is wrong joins the
    complaints, by the name of its key.
    """
    known, hints, found = {f.name: f for f in fields(kind)}, get_type_hints(kind), {}
    for key, value in given.items():
        if key not in known:
            complaints.append(_unknown(f"{where}{key}", key, list(known)))
        elif is_dataclass(hints[key]) and isinstance(value, Mapping):
            found[key] = checked(hints[key], value, complaints, f"{where}{key}.")  # type: ignore[arg-type]
        else:
            try:
                found[key] = _converted(hints[key], value, known[key].metadata)
            except _Wrong as expected:
                complaints.append(f"{where}{key}: expected {expected}, got {_short(value)}")
    return found


def check(thing: Any) -> None:
    """Raises `InputError` with all that is wrong with the fields of this dataclass."""
    complaints: list[str] = []
    checked(type(thing), {f.name: getattr(thing, f.name) for f in fields(thing)}, complaints)
    if complaints:
        raise InputError("; ".join(complaints))


def toml(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str | Path):
        return json.dumps(str(value), ensure_ascii=False)
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key} = {toml(item)}' for key, item in value.items())}}}"
    if isinstance(value, float) and math.isfinite(value) and value.is_integer():
        return f"{value:.1f}" if abs(value) < 1e15 else repr(value)
    return str(value)


def entries(path: Path, verb: str, out: Path | None = None) -> dict[str, Any]:
    """Return the entries of a file of choices for this command. The folder `out`, by default this
    one, and files that exist are relative to it.

    Raises `InputError` for a file that is not there, or no TOML.
    """
    try:
        found = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(
            f"{path} does not exist; symheli {verb} --write-config {path} writes one with the"
            " defaults"
        ) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not a TOML file: {error}") from error
    if out is not None:
        found.setdefault("out", str(out))
    for name in ("out", *FILES):
        given = found.get(name)
        if isinstance(given, str) and (name == "out" or (path.parent / given).is_file()):
            found[name] = str(path.parent / given)
    return found


def beside(thing: Any, name: str, folder: Path) -> Any:
    """The value of a field as a file in this folder has it: paths relative to it where they can
    be.
    """
    value = getattr(thing, name)
    if name != "out" and not (name in FILES and value and Path(value).is_file()):
        return value
    try:
        return os.path.relpath(value, folder).replace(os.sep, "/")
    except ValueError:  # another drive
        return str(Path(value).absolute())


def sentence(kind: type, name: str) -> str:
    """Return the description of a field."""
    return next((f.metadata.get("meaning", "") for f in fields(kind) if f.name == name), "")


def commented(entry: str, meaning: str) -> tuple[str, ...]:
    """Return the lines of an entry of a file with its description, if any: beside it where there is
    room, else before it.
    """
    if not meaning:
        return (entry,)
    beside_it = f"{entry}  # {meaning}"
    return (beside_it,) if len(beside_it) <= WIDTH else (f"# {meaning}:", entry)


def default(kind: type, name: str) -> Any:
    """The default of a field."""
    own = next(f for f in fields(kind) if f.name == name)
    return own.default if own.default_factory is MISSING else own.default_factory()


def _unknown(path: str, key: str, known: list[str]) -> str:
    near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
    hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(known)}"
    return f"{path} is unknown; {hint}"


def _short(value: Any) -> str:
    return f"{value!r:.60}"


def _number(value: Any, limits: Mapping[str, Any], whole: bool) -> Any:
    least = limits.get("least")
    what = "a whole number" if whole else "a number"
    expected = what if least is None else f"{what} >= {least:g}"
    right = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
    if not right or math.isnan(value) or (least is not None and value < least):
        raise _Wrong(expected)
    return value if whole else float(value)


def _list(item: Any, value: Any, limits: Mapping[str, Any]) -> tuple[Any, ...]:
    least, what = limits.get("least"), _KINDS.get(item, "numbers")
    bound = "" if least is None else f" >= {least:g}"
    expected = f"a list of {what}{bound}{'' if limits.get('empty') else ', one at least'}"
    if not isinstance(value, list | tuple) or not (value or limits.get("empty")):
        raise _Wrong(expected)
    try:
        return tuple(_converted(item, v, limits) for v in value)
    except _Wrong:
        raise _Wrong(expected) from None


def _text(value: Any, limits: Mapping[str, Any]) -> str:
    if not isinstance(value, str) or not (value or limits.get("empty")):
        raise _Wrong("a text in quotes")
    return value


def _truth(value: Any) -> bool:
    if not isinstance(value, bool):
        raise _Wrong("true or false")
    return value


def _table(item: Any, value: Any, limits: Mapping[str, Any]) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise _Wrong("a table, NAME = value")
    found = {}
    for key, each in value.items():
        try:
            found[str(key)] = _converted(item, each, limits)
        except _Wrong as expected:
            raise _Wrong(f"of {key} {expected}") from None
    return found


_KINDS = {int: "whole numbers", str: "texts in quotes"}

_PLAIN: dict[Any, Callable[[Any, Mapping[str, Any]], Any]] = {
    bool: lambda value, _: _truth(value),
    int: lambda value, about: _number(value, about, whole=True),
    float: lambda value, about: _number(value, about, whole=False),
    str: _text,
    Path: lambda value, about: value if isinstance(value, Path) else Path(_text(value, about)),
}


def _converted(hint: Any, value: Any, limits: Mapping[str, Any]) -> Any:
    if hint in _PLAIN:
        return _PLAIN[hint](value, limits)
    if get_origin(hint) is tuple:
        return _list(get_args(hint)[0], value, limits)
    if get_origin(hint) is Mapping:
        return _table(get_args(hint)[1], value, limits)
    if is_dataclass(hint):
        if not isinstance(value, hint):  # type: ignore[arg-type]
            raise _Wrong(f"a table with any of {', '.join(f.name for f in fields(hint))}")
        return value
    return _either(get_args(hint), value, limits)


def _either(hints: tuple[Any, ...], value: Any, limits: Mapping[str, Any]) -> Any:
    """Convert a value of type int | tuple[int, ...] | None."""
    if value is None and type(None) in hints:
        return None
    expected = []
    for hint in hints:
        if hint is not type(None):
            try:
                return _converted(hint, value, limits)
            except _Wrong as wrong:
                expected.append(str(wrong))
    raise _Wrong(" or ".join(expected))
