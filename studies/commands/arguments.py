"""Arguments of commands as tables: each command lists its own, `add` puts them into its parser."""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

Entry = "Argument | Group"


@dataclass(frozen=True)
class Argument:
    """Arguments of argparse: the name, and its settings."""

    name: str
    settings: Mapping[str, Any]


@dataclass(frozen=True)
class ArgumentGroup:
    """Arguments under a `title` in the help; without one, those of which one may be given."""

    arguments: tuple[Argument, ...]
    title: str = ""
    about: str | None = None


@dataclass(frozen=True)
class Listed:
    """Choices that a registry lists when they are asked for, not when the command line is made."""

    names: Callable[[], Iterable[str]]

    def __iter__(self) -> Iterator[str]:
        return iter(self.names())


def option(
    name: str,
    values: str | tuple[str, ...],
    help: str,
    kind: Callable[[str], Any] | None = None,
    default: Any = None,
    **settings: Any,
) -> Argument:
    """An argument with a value: `values` is how its help names it, or what may be chosen; a default
    that the help does not mention is added there.
    """
    shown = {"choices": values} if isinstance(values, tuple) else {"metavar": values}
    if isinstance(default, str | int | float) and default != "" and "(default" not in help:
        help = f"{help} (default: %(default)s)"
    kinds = {} if kind is None else {"type": kind}
    return Argument(name, {**shown, **kinds, "default": default, "help": help, **settings})


def several(name: str, values: tuple[str, ...], help: str, **settings: Any) -> Argument:
    """An option with several values, each named in the help."""
    return Argument(name, {"nargs": len(values), "metavar": values, "help": help, **settings})


def flag(name: str, help: str) -> Argument:
    """An option that is given or not."""
    return Argument(name, {"action": "store_true", "help": help})


def positional(name: str, help: str, **settings: Any) -> Argument:
    """An argument known by its place."""
    return Argument(name, {"help": help, **settings})


def renamed(former: Mapping[str, str], command: str) -> Callable[[str], str]:
    """Return what replaces a word of the last release by the new one, with a note on stderr."""

    def now(word: str) -> str:
        if word not in former:
            return word
        print(
            f"symheli: note: {command} {word} is {command} {former[word]} now; the old word goes"
            " with the next release",
            file=sys.stderr,
        )
        return former[word]

    return now


def one_of(*arguments: Argument) -> ArgumentGroup:
    """Options of which one may be given."""
    return ArgumentGroup(arguments)


def group(title: str, about: str | None, *arguments: Argument) -> ArgumentGroup:
    """Arguments that belong together in the help."""
    return ArgumentGroup(arguments, title, about)


def add(parser: ArgumentParser, table: Iterable[Argument | ArgumentGroup]) -> None:
    """Put the arguments of a table into a parser."""
    for entry in table:
        if isinstance(entry, Argument):
            parser.add_argument(entry.name, **entry.settings)
            continue
        inside = (
            parser.add_argument_group(entry.title, entry.about)
            if entry.title
            else parser.add_mutually_exclusive_group()
        )
        for argument in entry.arguments:
            inside.add_argument(argument.name, **argument.settings)
