"""Which stages a run computes, and which it takes as they are stored."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from studies.transition.stages import Stage
from symheli.errors import InputError, UnknownNameError


@dataclass(frozen=True)
class Selection:
    """Stages to compute `again`, whatever is stored, and those that are `wanted` in the end; what
    these need is taken from the store, or computed where it is not there.
    """

    again: frozenset[str]
    wanted: frozenset[str]

    @classmethod
    def of(cls, stages: Sequence[Stage], only: Iterable[str] = (), since: str = "") -> Selection:
        """All stages, those of these names `only`, or `since` one: it and all that need it.

        Raises `InputError` for both, `UnknownNameError` for a stage there is not.
        """
        named, every = frozenset(only), frozenset(stage.name for stage in stages)
        for name in (*named, *filter(None, [since])):
            if name not in every:
                raise UnknownNameError("stage", name, (stage.name for stage in stages))
        if named and since:
            raise InputError("stages: give either those to run alone, or the one to run from")
        if named:
            return cls(named, named)
        return cls(_following(stages, since) if since else every, every)

    def open(self, stages: Sequence[Stage], there: Iterable[str]) -> list[Stage]:
        """What is to be computed beside those that are there, in order."""
        there, wanted = frozenset(there), set(self.wanted)
        for stage in reversed(stages):
            if stage.name in wanted and stage.name not in there:
                wanted.update(stage.needs)
        return [stage for stage in stages if stage.name in wanted - there]


def _following(stages: Sequence[Stage], name: str) -> frozenset[str]:
    found = {name}
    for stage in stages:
        if found & set(stage.needs):
            found.add(stage.name)
    return frozenset(found)
