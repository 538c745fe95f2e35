"""Gain of the study's loops against permitted acceleration and jerk: a proven upper bound, and the
gain of a computed trajectory as the lower one.

The loops do not depend on the acceleration a; with a as a second parameter, dV/dt = a, P(V, a) can
use that |da/dt| is bounded. P(V) at |dV/dt| <= a_max lets the acceleration jump.
"""

from __future__ import annotations

import argparse
import math
from functools import partial
from pathlib import Path
from typing import Any

from evidence.figures import save
from evidence.jerk.figure import plot
from evidence.jerk.flown import WINDOW, Fastest, fastest
from evidence.jerk.gains import Knots, Loop, carried_over, measure
from evidence.jerk.table import jerk_table, table_of_flights
from evidence.tables import DOCS, keep, parsed
from studies.loops.lateral import lateral_loop
from studies.loops.longitudinal import longitudinal_loop
from studies.output import as_json, progress
from studies.setup.flights import TransitionPlan, autopilot_for
from symheli import Helicopter, LPVStateSpace
from synthesis.analysis import LowerBoundSearch

ACCELERATIONS = (1.0, 2.0, 3.0, 4.5)
"""Largest |dV/dt|, m/s^2."""

JERKS = (1.0, 3.0, 10.0, math.inf)
"""Largest |d2V/dt2|, m/s^3."""

KNOTS = {"lateral": Knots((3, 2), 8), "longitudinal": Knots((2, 1), 4)}
"""The lateral loop needs fine knots near hover; the longitudinal gain is the frozen one."""

SEARCH = {
    "lateral": LowerBoundSearch(steps=100, samples=50_000, seconds=math.inf),
    "longitudinal": None,
}
"""Bounded by what it computes, not by time: the tables are the same on a busy machine. Where the
proven gain is the frozen one nothing is left to find.
"""


def flights(heli: Helicopter) -> dict[str, Fastest]:
    """The study's flights, without noise: how fast their airspeed changes."""
    autopilot, plan = autopilot_for(heli), TransitionPlan()
    return {
        "training": fastest(plan.training(heli, autopilot)),
        "test": fastest(plan.test(heli, autopilot)),
    }


def main() -> None:
    """Print, keep and draw the gains of both loops of the X-Cell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--quick",
        action="store_true",
        help="3 m/s^2 and 3 m/s^3 only, on fewer knots and without a search",
    )
    parser.add_argument("--json", action="store_true", help="print what a program would read")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="draw gain over acceleration")
    options = parsed(parser, "gains.md", timed=False)
    if options.quick and options.write:
        parser.error("--write keeps the whole tables: leave out --quick")
    heli = Helicopter.load("xcell60", governor="ideal")
    flown = flights(heli)
    loops = {
        "lateral": _found("lateral", lateral_loop(heli), options.quick),
        "longitudinal": _found("longitudinal", longitudinal_loop(heli), options.quick),
    }
    texts = {name: jerk_table(found) for name, found in loops.items()}
    fastest_of_each = table_of_flights(flown)
    if options.json:
        print(as_json(_data(loops, flown)))
    else:
        print("\n\n".join([*(f"{name}\n{text}" for name, text in texts.items()), fastest_of_each]))
    if options.write:
        for name, text in texts.items():
            keep(DOCS / "gains.md", name, text)
        keep(DOCS / "gains.md", "flights", fastest_of_each)
    for path in {options.figure, DOCS / "gain-against-jerk.png" if options.write else None} - {
        None
    }:
        save(
            [
                partial(plot, f"{name.capitalize()} loop", loop, flown)
                for name, loop in loops.items()
            ],
            path,
        )


def _found(name: str, loop: LPVStateSpace, quick: bool) -> Loop:
    """With progress."""
    knots, search = KNOTS[name], SEARCH[name]
    rates, jerks = ACCELERATIONS, JERKS
    if quick:
        rates, jerks, search = (3.0,), (3.0,), None
        knots = knots._replace(degree=(2, 1), segments=4)
    found: dict[str, Any] = {}
    for what, result in measure(loop, knots, rates, jerks, search):
        progress(f"{name}: {what}: {result}")
        found[what] = result
    summary = {key: found.pop(key) for key in ("frozen", "same_knots", "chosen_knots")}
    return Loop(**summary, cells=carried_over(list(found.values())))


def _data(loops: dict[str, Loop], flown: dict[str, Fastest]) -> dict[str, Any]:
    """What a program would read, SI."""
    return {
        "loops": {
            name: {**found._asdict(), "cells": [c._asdict() for c in found.cells]}
            for name, found in loops.items()
        },
        "flights": {
            "window_s": WINDOW,
            **{name: f._asdict() for name, f in flown.items()},
        },
    }
