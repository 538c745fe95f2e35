"""Steps of a long computation for whoever watches: `symheli.progress` does, once it is imported."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

T = TypeVar("T")

_watch: list[Callable[[str, Iterable[Any], float | None], Iterator[Any]]] = []


def watch_by(reporter: Callable[[str, Iterable[Any], float | None], Iterator[Any]]) -> None:
    """Report the steps of every task by this function of its title, its items and their number."""
    _watch[:] = [reporter]


def tracked(title: str, items: Iterable[T], total: float | None = None) -> Iterator[T]:
    """Yield the items, each reported as a step of a task where somebody watches."""
    return iter(items) if not _watch else _watch[0](title, items, total)
