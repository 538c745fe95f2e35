"""The lamp: whether what is identified now, and the controller on it, may be relied on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from studies.live.stream import Row


class Lamp(NamedTuple):
    """Green where nothing speaks against it; `reasons` say what does."""

    reasons: tuple[str, ...]

    @property
    def green(self) -> bool:
        """Whether it is."""
        return not self.reasons

    def __str__(self) -> str:
        return "GREEN" if self.green else f"not green: {'; '.join(self.reasons)}"


class Pilot(Protocol):
    """Who flies the vehicle that is watched."""

    alarm: str | None
    """Change of the vehicle that was noticed, in words; None without one."""

    def take(self, row: Row) -> bool:
        """Take in a row, and command; return whether it is another vehicle from now on."""
        ...

    def reasons(self) -> Sequence[str]:
        """Return why its controller may not be relied on now."""
        ...

    def data(self) -> Mapping[str, Any]:
        """Return the numbers for a program: among them what it is `doing`, in words, and `events`,
        each with `time` (s) and `what`.
        """
        ...
