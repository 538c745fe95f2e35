"""Registry of classes by a name that each has: a subclass is known once it is defined."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import entry_points
from inspect import isabstract
from typing import TypeVar

from symheli.errors import InputError

T = TypeVar("T")


def named_subclasses(
    parent: type[T], name: str, group: str, first: Iterable[type[T]] = ()
) -> dict[str, type[T]]:
    """Return every subclass with an attribute `name` of its own by its value: those of `first`,
    then those defined elsewhere, as by packages with entry points of this group.

    Where a class is defined once more, as in a notebook, the latest counts. Raises `InputError`
    where two classes have one name.
    """
    _loaded(group)
    known: dict[str, type[T]] = {}
    for each in (*first, *_below(parent)):
        if isabstract(each) or name not in vars(each):
            continue
        own = vars(each)[name]
        other = known.setdefault(own, each)
        if (other.__module__, other.__qualname__) != (each.__module__, each.__qualname__):
            raise InputError(
                f"{other.__qualname__} and {each.__qualname__} have one {name}, {own!r}: give one"
                " of them another"
            )
        known[own] = each
    return known


@cache
def _loaded(group: str) -> None:
    for point in entry_points(group=group):
        point.load()


def _below(parent: type[T]) -> Iterator[type[T]]:
    for child in parent.__subclasses__():
        yield child
        yield from _below(child)
