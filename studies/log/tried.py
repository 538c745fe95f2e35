"""Flags that mend what a fit shows, each tried before it is advised."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from identification import LPVARX, fit
from identification.judge import slow_modes
from identification.judge.against_constant import LEAST, AgainstConstant, Scored
from identification.judge.scores import DIVERGES, percent
from identification.judge.slow_modes import SlowModes
from symheli.errors import SymheliError
from symheli.records import FlightRecord

Flags = Mapping[str, Any]
Again = Callable[[Flags], tuple[LPVARX, FlightRecord, FlightRecord | None]]
"""The structure, the data of the fit and those held out that identify makes with other flags."""

COARSER = (2, 3, 5)
"""How many steps are taken together where a fit diverges."""

SHOWN = 2
"""Flags that are advised, the best first."""


def diverging(result: AgainstConstant) -> list[str]:
    """The outputs that the judged model loses, 1 s ahead or in free run, held out or in sample."""
    fits = _fits(next(iter(result.models)))
    return [y for y in map(str, result.scheduled.outputs) if min(f[y] for f in fits) <= DIVERGES]


def mended(result: AgainstConstant, given: Flags, again: Again) -> str:
    """Name the outputs that the fit loses and the flags that keep them, as tried; empty where it
    loses nothing.
    """
    lost = diverging(result)
    if not lost:
        return ""
    found = []
    for flags in _simpler(result, given):
        scored = _again(result, flags, again)
        if scored is not None and all(min(f.values()) > DIVERGES for f in _fits(scored)):
            found.append((_worth(scored), flags, scored))
    better = sorted(found, key=lambda one: -one[0])[:SHOWN]
    head = f"the fit diverges: {', '.join(lost)} run away; "
    if not better or better[0][0] <= 0:
        return (
            f"{head}no lower order and no coarser step helps, nor does --method ls: record longer"
        )
    return f"{head}tried and better: " + ", or ".join(
        f"{_typed(flags)} ({_shown(scored)} % 1 s ahead)"
        for worth, flags, scored in better
        if worth > 0
    )


def seen_slowly(found: SlowModes, given: Flags, again: Again) -> str:
    """Describe the slow modes, and name means that show those that are lost, if tried ones do."""
    if not found.lost:
        return str(found)
    many = found.together
    tried = list(dict.fromkeys(max(n, 2) for n in (many // 4, many // 2, many, 2 * many)))
    for n in tried:
        flags = {"decimate": n * given["decimate"]}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                structure, training, _ = again(flags)
                seen = slow_modes(fit(structure, training), training)
            except SymheliError:
                continue
        if not seen.lost:
            return f"{found.statement}\n  tried: {_typed(flags)} leaves no mode unknown"
    return (
        f"{found.statement}\n  tried: --decimate {', '.join(map(str, tried))} show it no better:"
        " record longer, or with the external excitation logged, --method iv --instruments NAME"
    )


def _simpler(result: AgainstConstant, given: Flags) -> Iterator[Flags]:
    """Lower orders and coarser steps; by least squares too, where that was not asked for."""
    methods = [{}] if result.scheduled.least_squares else [{"method": "ls"}]
    if methods != [{}]:
        yield {"method": "ls"}
    for method in methods:
        for na in range(given["na"] - 1, 0, -1):
            yield {**method, "na": na, "nb": max(given["nb"] - given["na"] + na, 1)}
        for n in COARSER:
            yield {**method, "decimate": n * given["decimate"]}


def _again(result: AgainstConstant, flags: Flags, again: Again) -> Scored | None:
    """The model with other flags; None where it is refused."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            structure, training, test = again(flags)
            moving = result.scheduled.structure.offset_rate
            model = fit(replace(structure, offset_rate=moving), training)
            scored = Scored(
                label="", model=model, training=training, test=test, hold_p=result.hold_p
            )
            _fits(scored)
        except SymheliError:
            return None
    return scored


def _fits(scored: Scored) -> list[Mapping[str, float]]:
    """1 s ahead and in free run, of what is held out, else in sample."""
    found = scored.held_out or scored.in_sample
    return [found.ahead, found.free_run]


def _worth(scored: Scored) -> float:
    return float(np.mean([max(v, LEAST) for fits in _fits(scored) for v in fits.values()]))


def _shown(scored: Scored) -> str:
    return ", ".join(f"{y} {percent(v)}" for y, v in _fits(scored)[0].items())


def _typed(flags: Flags) -> str:
    return " ".join(f"--{name} {value}" for name, value in flags.items())
