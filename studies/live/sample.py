"""Samples as they come from a vehicle, and where they come from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

STICKS = ("stick_lon", "stick_lat", "stick_col", "stick_ped")
"""Controls of a vehicle whose deflections are not sent, each -1 to 1."""


EXCITATION = "excitation"
"""Whether a simulated vehicle excites itself, 1 or 0; set like a stick, it stays."""


class Sample(NamedTuple):
    """One set of values of a vehicle: `time` (s) on its own clock, `values` in SI by signal, and
    `sender`, by which another vehicle on the same port is told apart.
    """

    time: float
    values: Mapping[str, float]
    sender: str


class Source(Protocol):
    """Samples of a vehicle as they come: what `symheli live` asks for them.

    A source of one's own has these two methods and a `name`.
    """

    name: str
    """Name in messages."""

    def receive(self, timeout: float) -> Sequence[Sample]:
        """Return what has come, waiting for the first at most so long (s); empty if nothing did.

        Raises `EOFError` where nothing can come any more.
        """
        ...

    def close(self) -> None:
        """Give back sockets and files."""
