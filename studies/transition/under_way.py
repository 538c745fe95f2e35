"""The part of report.html on a run that has not ended, and on one that was stopped."""

from __future__ import annotations

import datetime
from dataclasses import dataclass, field

from studies.progress import duration

RELOAD = 10
"""Seconds after which a browser loads the page of a running study again."""


def _now() -> str:
    return datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


@dataclass(frozen=True, kw_only=True)
class UnderWay:
    """How far a run is: titles of what is `working` and of what is `coming`, and about the seconds
    that are left.

    `stopped` says why a run ended early; `again` is the command that goes on from it.
    """

    working: tuple[str, ...]
    coming: tuple[str, ...]
    again: str
    left: float | None = None
    stopped: str = ""
    written: str = field(default_factory=_now)
    every: int = RELOAD

    @property
    def remaining(self) -> str:
        """The time that is left, in words."""
        return "" if self.left is None else f", about {duration(self.left)} left"

    @property
    def missing(self) -> str:
        """The word for a finding that is not there."""
        return "not reached" if self.stopped else "still to come"

    @property
    def lists(self) -> list[tuple[str, tuple[str, ...]]]:
        """Stages under way and to come, each list with its heading, where there is any."""
        if self.stopped:
            given = [("Not finished", tuple(dict.fromkeys((*self.working, *self.coming))))]
        else:
            given = [("Under way", self.working), ("Still to come", self.coming)]
        return [one for one in given if one[1]]
