"""Time limit of a search."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Budget:
    """A limit of `seconds` of wall time, from when it was made."""

    seconds: float = math.inf
    start: float = field(default_factory=time.perf_counter)

    @property
    def left(self) -> float:
        """Remaining time, at least 0, s."""
        return max(self.seconds - (time.perf_counter() - self.start), 0.0)

    @property
    def over(self) -> bool:
        """Whether no time is left."""
        return self.left <= 0.0


UNLIMITED = Budget()


def search_hypothesis(seconds: float | None, spent: float) -> tuple[str, ...]:
    """Return the budget of a search as a hypothesis of its bound; None: nothing was searched."""
    if seconds is None:
        return ("no trajectory was searched: the lower bound is that of the worst frozen model",)
    ended = ", which ended the search" if spent >= seconds else ""
    return (
        (
            f"worst trajectories were searched for at most {seconds:g} s{ended}: a longer search"
            " can only increase their lower bound"
        ),
    )
