"""Where a sweep of trims and linear models spends its time, beside what this processor can do."""

from __future__ import annotations

import time
from collections import Counter

import numpy as np

import symheli
from benchmarks.peak import flop, processor
from benchmarks.race import readable, table
from benchmarks.timing import medians
from symheli.codegen import program
from symheli.steady.equations import SIDE_BY_SIDE
from symheli.steady.equilibrium import Equilibrium
from symheli.steady.flight_conditions import FlightConditions
from symheli.steady.kinks import kink_speeds
from symheli.steady.newton import newton
from symheli.steady.steady_flights import SteadyFlights
from symheli.steady.trim_batch import hover, one_after_another, trimmed, unknowns


def sweep_steps(heli: symheli.Helicopter, speeds: np.ndarray, seconds: float) -> str:
    """A table of the steps of a sweep, each alone: its time, the evaluations of generated code it
    makes, and the share of the peak that they reach.
    """
    flights = SteadyFlights([heli], np.zeros(len(speeds), int), FlightConditions(speeds))
    start, after = hover(flights), one_after_another(len(speeds))
    trims = trimmed(flights, start, after)
    z = unknowns(heli, trims)
    steps = {
        "Newton's method": lambda: flights.solved(start, after),
        "residuals, switching functions": lambda: flights.points(z),
        "A, B, E": lambda: flights.slopes(trims.x, trims.u, trims.wind),
        "kinks": lambda: kink_speeds(heli, trims),
        "all of it": lambda: symheli.sweep(heli, speeds),
    }
    lanes = SIDE_BY_SIDE.lanes
    once = -(-len(speeds) // lanes)
    work = {
        "Newton's method": ("system", _evaluations(flights, start, z, after)),
        "residuals, switching functions": ("point", once),
        "A, B, E": ("slopes", once),
    }
    times, machine, rows = medians(steps, seconds, time.thread_time), processor(), []
    for step, spent in times.items():
        done = share = ""
        if step in work and machine:
            name, evaluations = work[step]
            count = program(flights.equations.function(name)).count()
            done = f"{evaluations} of {sum(count.values())} operations"
            share = f"{100 * machine.share(lanes * evaluations * flop(count), spent):.0f} %"
        rows.append((step, readable(spent), done, share))
    return table(
        f"### Where a sweep of {len(speeds)} airspeeds spends its time",
        rows,
        ("", "median", f"evaluations, {lanes} flights at once", "of the peak in FLOP/s"),
    )


def _evaluations(
    flights: SteadyFlights, start: np.ndarray, z: np.ndarray, after: np.ndarray
) -> int:
    """How often the system is evaluated: of the flights side by side, that started from the same
    one, as often as the slowest asks for.
    """
    most: Counter[int] = Counter()
    for k, before in enumerate(after.tolist()):
        alone = Equilibrium(flights.heli(k), flights.conditions[k])
        asked = []

        def system(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            asked.append(z)  # noqa: B023
            return alone.system(z)  # noqa: B023

        newton(system, alone.equations.balanced, z[before] if before >= 0 else start[k])
        most[before] = max(most[before], len(asked))
    return most.total()
