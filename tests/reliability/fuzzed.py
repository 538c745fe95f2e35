"""Every entry with one argument changed at a time, and what came of it."""

from __future__ import annotations

import faulthandler
from collections import Counter
from collections.abc import Iterable
from typing import Any, NamedTuple

import hypothesis
from altered_values import ANOTHER, altered, made
from entries import LARGER
from hypothesis import HealthCheck, Phase, assume, settings
from hypothesis import given as asked
from hypothesis import strategies as st
from meant import is_meant
from valid_calls import ValidCall
from verdict import SECONDS, judged


class Fault(NamedTuple):
    """An answer that is neither a result nor a refusal, and how to see it again."""

    entry: str
    argument: str
    kind: str
    changed: str
    fault: str

    def __str__(self) -> str:
        return f"{self.entry}({self.argument}: {self.kind}, {self.changed}): {self.fault}"


class Tally(NamedTuple):
    """How often each outcome, and the faults."""

    outcomes: Counter[str]
    faults: list[Fault]


def tally(calls: Iterable[ValidCall], inputs: int, seed: int | None = None) -> Tally:
    """`inputs` changed calls of one entry, the same ones every time, others with each `seed`.

    A good call that has no arguments, or fails by itself (an example of a refusal), is left out.
    """
    good, types = list[ValidCall](), list[type]()
    for call in calls:
        if call.arguments and judged(call.repeated, "").outcome == "result":
            types.append(type(call.repeated()))
            good.append(call)
    found = Tally(Counter(), [])
    if not good:
        return found

    @settings(
        max_examples=inputs,
        database=None,
        derandomize=seed is None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @asked(st.data())
    def ask(data: st.DataObject) -> None:
        call = data.draw(st.sampled_from(good))
        name = data.draw(st.sampled_from(list(call.arguments)))
        parameter = call.kinds[name]
        kind, new = data.draw(altered(call.arguments[name], 0, parameter.annotation))
        if parameter.kind is parameter.VAR_KEYWORD and kind == "unknown name":
            kind = ANOTHER  # an unexpected keyword, which is Python's to refuse
        assume(kind != "another count" or call.entry not in LARGER)
        # what hangs in compiled code hears no alarm
        faulthandler.dump_traceback_later(30 * SECONDS, exit=True)
        given = {"self": getattr(call.function, "__self__", None), **call.arguments}

        def changed() -> Any:
            given[name] = made(new)
            return call.repeated({name: given[name]})

        verdict = judged(
            changed,
            kind,
            call.arguments,
            tuple(types),
            meant=lambda found: is_meant(call.entry, found, given),
        )
        faulthandler.cancel_dump_traceback_later()
        found.outcomes[verdict.outcome] += 1
        if verdict.fault:
            found.faults.append(
                Fault(call.entry, name, kind, " ".join(repr(new).split())[:300], verdict.fault)
            )

    (ask if seed is None else hypothesis.seed(seed)(ask))()
    return found
