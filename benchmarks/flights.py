"""Flights under feedback by the thousand, beside a loop of single ones, the same loop written in
Python, and flights whose inputs are known.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

# this folder holds scripts named like the packages they measure
sys.path[0] = str(Path(__file__).resolve().parents[1])

from studies.threads import one_thread  # noqa: E402

one_thread()

import numpy as np  # noqa: E402

import symheli  # noqa: E402
from benchmarks.opponents.flight_in_python import FlightInPython  # noqa: E402
from benchmarks.peak import processor  # noqa: E402
from benchmarks.physical_limit import Flown, limits, work  # noqa: E402
from benchmarks.race import Ratio, present, readable, table  # noqa: E402
from benchmarks.timing import arguments, medians  # noqa: E402
from symheli.flight import XCELL_SERVOS  # noqa: E402
from symheli.physics.attitude import flight_state  # noqa: E402

DT = 0.02
FLIGHTS, QUICK_FLIGHTS, ALONE = 1000, 128, 5
SCHEDULE = symheli.AirspeedSchedule.transition(0.0, 13.0, acceleration=3.0, hold=12.2)
EXCITATION = symheli.Excitation({"d_lon": 0.006, "d_lat": 0.006, "d_col": 0.005, "d_ped": 0.01})
NOISE = np.array([0.05, 0.05, 0.05, 0.01, 0.01, 0.01, 0.003, 0.003])
MEASURED = ("u", "v", "w", "p", "q", "r", "phi", "theta")
STORM = symheli.Wind((-2.0, 1.0, 0.0), turbulence=symheli.environment.Dryden(7.7, 20.0))


def main() -> None:
    options = arguments(__doc__, write=True)
    count = QUICK_FLIGHTS if options.quick else FLIGHTS
    notes = [f"{count} flights in place of {FLIGHTS:,}"] if options.quick else []
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    pilot = symheli.flight.gain_scheduled_lqr(heli, 0.0, 13.0, DT)
    sensors = {n: symheli.Sensor(noise=float(s)) for n, s in zip(MEASURED, NOISE, strict=True)}
    kit = {"controller": pilot, "excitation": EXCITATION, "sensors": sensors}
    rough = {**kit, "wind": STORM, "servos": XCELL_SERVOS, "delay": 0.02}
    record = symheli.fly(heli, SCHEDULE, **kit)
    n, inputs = len(record), record.columns(heli.inputs)
    python = FlightInPython(heli, pilot, DT, 4)
    states = python.fly(SCHEDULE, EXCITATION, NOISE, 0)[0]
    apart = np.abs(states - record.columns(heli.states)).max()
    x0 = np.tile(symheli.trim(heli, 0.0).x.array, (count, 1))
    replayed = np.broadcast_to(inputs, (count, n, 4)).copy()
    plans = [symheli.FlightPlan(SCHEDULE, **kit).seeded(seed) for seed in range(ALONE)]

    def campaign() -> None:
        with tempfile.TemporaryDirectory() as folder:
            symheli.flight.fly_campaign(
                heli, SCHEDULE, Path(folder) / "flights.zarr", seeds=range(count), **kit
            )

    batch, one, by_hand, known, final = (
        f"symheli.flight.fly_batch, {count:,} flights",
        "symheli.fly, one flight",
        "one flight in Python around a compiled step",
        f"symheli.integrate.simulate_batch, inputs known, {count:,} flights, every sample kept",
        f"symheli.integrate.simulate_batch, inputs known, {count:,} flights, last states",
    )
    stormy, kept = (
        f"symheli.flight.fly_batch, turbulence, servos and delay, {count:,} flights",
        f"symheli.flight.fly_campaign to disk, {count:,} flights",
    )
    candidates = {
        batch: lambda: symheli.flight.fly_batch(heli, SCHEDULE, seeds=range(count), **kit),
        known: lambda: symheli.integrate.simulate_batch(heli, x0, replayed, dt=DT, keep=1),
        final: lambda: symheli.integrate.simulate_batch(heli, x0, replayed, dt=DT),
        stormy: lambda: symheli.flight.fly_batch(heli, SCHEDULE, seeds=range(count), **rough),
        kept: campaign,
        one: lambda: [symheli.fly(heli, plan) for plan in plans],
        by_hand: lambda: [python.fly(SCHEDULE, EXCITATION, NOISE, seed) for seed in range(ALONE)],
    }
    times = medians(candidates, 0.0)
    for name in (one, by_hand):
        times[name] /= ALONE
    rows = [
        (name, readable(t), readable(t / (1 if name in (one, by_hand) else count)))
        for name, t in times.items()
    ]
    notes.append(f"the flight in Python differs from symheli.fly by {apart:.0e} at most (SI)")
    notes.append(f"flights of {SCHEDULE.duration:.0f} s, steps of 5 ms, noise, excitation")
    steps = 4 * n
    ours = (
        Flown(one, steps, times[one], 1),
        Flown(batch, steps * count, times[batch], len(os.sched_getaffinity(0))),
    )
    limit, shares = physical_limit(heli, record, ours, notes)
    title = "### Flights under feedback, hover to 13 m/s and back in 40 s, recorded at 50 Hz"
    ratios = [
        Ratio(
            "flights under feedback: batch against a loop of flights in Python",
            count * times[by_hand] / times[batch],
            100.0,
        ),
        Ratio(
            "flights under feedback: batch against a loop of symheli.fly",
            count * times[one] / times[batch],
        ),
        Ratio(
            "flights under feedback: time over that with known inputs, every sample kept",
            times[batch] / times[known],
            2.0,
            at_most=True,
        ),
        Ratio(
            "flights under feedback: time over that with known inputs, last states",
            times[batch] / times[final],
            2.0,
            at_most=True,
        ),
        Ratio("flights under feedback: to disk over in memory", times[kept] / times[batch]),
    ]
    tables = [table(title, rows, ("", "median", "each")), *limit]
    present("flights", options, tables, [*ratios, *shares], notes)


def physical_limit(
    heli: symheli.Helicopter,
    record: symheli.FlightRecord,
    flown: tuple[Flown, Flown],
    notes: list[str],
) -> tuple[list[str], list[Ratio]]:
    """The helicopter's own operations in these flights, beside what this processor can do."""
    processors = {way.threads: processor(way.threads) for way in flown}
    if None in processors.values():
        notes.append("the physical limit: left out, no C compiler")
        return [], []
    inputs = record.columns(heli.inputs)
    states = flight_state(record.columns(heli.states))
    done = work(heli, states, inputs, 4, processors[1].wait)
    text, ratios = limits(*flown, done, processors)
    notes.append(
        "operations counted: the helicopter's; trims, sensors, gains and noise come on top"
    )
    return [text], ratios


if __name__ == "__main__":
    main()
