"""Reader of TOML files written by hand: all invalid lines are found at once, and one message lists
all errors, line by line.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from symheli.errors import InputError

UNREADABLE: Mapping[str, Any] = {"unreadable": True}
"""Stands for the value of an entry whose line is no TOML."""

Problem = tuple[int, str]
"""Line (0: of none) and what is wrong, with its place."""

_MAX_BROKEN_LINES = 50
"""Largest number of invalid lines that are reported."""


def readable(text: str) -> tuple[dict[str, Any], list[tuple[int, str]]]:
    """The tables of a TOML text without the lines that are no TOML, and (line, what is wrong) of
    each of those; the entry of such a line is `UNREADABLE`.
    """
    lines, wrong = text.splitlines(), []
    for _ in range(_MAX_BROKEN_LINES):
        try:
            return tomllib.loads("\n".join(lines) + "\n"), wrong
        except tomllib.TOMLDecodeError as error:
            found = re.search(r"^(.*) \(at line (\d+), column (\d+)\)$", str(error), re.DOTALL)
            number = int(found[2]) if found else len(lines)
            while number > 1 and (number > len(lines) or not lines[number - 1].strip()):
                number -= 1
            line = lines[number - 1]
            what = f"{found[1]} (column {found[3]})" if found else str(error)
            if number not in [earlier for earlier, _ in wrong]:
                wrong.append((number, f"{what}{_hint(line, what)}"))
            lines[number - 1] = _stand_in(line)
    return {}, wrong


def _stand_in(line: str) -> str:
    """Return a replacement of an invalid line: the section, or the entry without its value."""
    if line.rstrip().endswith("{ unreadable = true }"):
        return ""
    if header := re.match(r"\s*\[+\s*([\w.]+)\s*[^\]]*$", line):
        return f"[{header[1]}]"
    key = re.match(r"\s*([\w.]+)\s*[=:]", line)
    return f"{key[1]} = {{ unreadable = true }}" if key else ""


def _hint(line: str, what: str) -> str:
    """Return the usual cause of an invalid line."""
    if "overwrite" in what or "twice" in what:
        return ": it stands there already, keep one of the two"
    if re.search(r"\d,\d", line):
        return ": write numbers with a point, as 8.2"
    if re.search(r"=\s*-?\.\d|\d\.\s*[,}]", line):
        return ": write a digit before and behind the point, as 0.5"
    if re.search(r"\b(unit|source)\s*=\s*[^\s\"'{]", line):
        return ': texts stand in quotes, as unit = "kg"'
    if re.match(r"\s*\w+\s*:", line):
        return ": write = in place of :"
    if line.count("{") != line.count("}"):
        return ": an entry stands on one line and ends in }"
    if line.count('"') % 2:
        return ": a text ends with its quote"
    if line.lstrip().startswith("[") and "]" not in line:
        return ": a section is named as in [body]"
    return ': write NAME = { value = ..., unit = "...", source = "..." }'


def broken_lines(unread: list[tuple[int, str]]) -> list[Problem]:
    """Return the errors that `readable` found, with their place."""
    return [(line, f"line {line}, not valid TOML: {wrong}") for line, wrong in unread]


def problem(lines: Sequence[str], section: str, entry: str, wrong: str, name: str = "") -> Problem:
    """Describe an error of an entry of a section, or of the section; `name`: the name of the
    section as written, if misspelt.
    """
    line = _line(lines, section, entry) or _line(lines, section, "")
    called = f"{name or section}.{entry}" if entry else f"[{name or section}]"
    return line or 0, f"line {line}, {called}: {wrong}" if line else f"{called}: {wrong}"


def refuse(path: str, problems: list[Problem]) -> None:
    """Raise one `InputError` with everything that is wrong, in the order of the file, where there
    is anything.
    """
    messages = [text for _, text in sorted(problems, key=lambda problem: problem[0])]
    if len(messages) == 1:
        raise InputError(f"{path}, {messages[0]}")
    if messages:
        raise InputError("\n  ".join([f"{path}: {len(messages)} things to put right", *messages]))


def _line(lines: Sequence[str], section: str, entry: str) -> int | None:
    """Line of `entry =` below [section], of `section.entry =`, or of [section.entry]; of [section]
    without an entry.
    """
    wanted = [section, entry] if entry else [section]
    header: list[str] = []
    for number, line in enumerate(lines, 1):
        if found := re.match(r"\s*\[+([^\[\]]+)\]+\s*(#.*)?$", line):
            header = _keys(found[1])
            path = header
        elif found := re.match(r"\s*([\w\-.\"' ]+?)\s*=", line):
            path = header + _keys(found[1])
        else:
            continue
        if path[: len(wanted)] == wanted:
            return number
    return None


def _keys(dotted: str) -> list[str]:
    return [key.strip().strip("\"'") for key in dotted.split(".")]
