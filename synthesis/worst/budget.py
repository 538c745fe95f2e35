"""How long a search may go on."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Budget:
    """So many `seconds` of wall time from when it was made."""

    seconds: float = math.inf
    start: float = field(default_factory=time.perf_counter)

    @property
    def left(self) -> float:
        """Seconds left, 0 at least."""
        return max(self.seconds - (time.perf_counter() - self.start), 0.0)

    @property
    def over(self) -> bool:
        """Whether it is used up."""
        return self.left <= 0.0


UNLIMITED = Budget()


def said(seconds: float | None, spent: float) -> tuple[str, ...]:
    """The budget of a search as a hypothesis of the bound it gave; None: nothing was searched."""
    if seconds is None:
        return ("no trajectory was looked for: what no proof can beat is the worst frozen model",)
    ended = ", which ended the search" if spent >= seconds else ""
    return (
        (
            f"bad trajectories were looked for during at most {seconds:g} s{ended}: the bound they"
            " give can only become sharper"
        ),
    )
