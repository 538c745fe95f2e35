"""Flights, batches and sweeps of the X-Cell against the same work as others would write it (see
benchmarks/opponents).
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

# this folder holds scripts named like the packages they measure
sys.path[0] = str(Path(__file__).resolve().parents[1])

from studies.threads import one_thread  # noqa: E402

one_thread()

import numpy as np  # noqa: E402

import symheli  # noqa: E402
from benchmarks.opponents import scipy_flight  # noqa: E402
from benchmarks.peak import processor  # noqa: E402
from benchmarks.physical_limit import Flown, described, limits, work  # noqa: E402
from benchmarks.race import Ratio, present, readable, table  # noqa: E402
from benchmarks.sweep_steps import sweep_steps  # noqa: E402
from benchmarks.timing import arguments, medians  # noqa: E402
from symheli.codegen.numeric import Numeric  # noqa: E402
from symheli.integrate import CashKarp, RungeKutta4  # noqa: E402

DT, STEPS = 0.02, 4  # s; Runge-Kutta steps of 5 ms
STILL = np.zeros(3)
FLIGHTS, QUICK_FLIGHTS = 10_000, 128
# of solve_ivp's RK45: over these 30 s 1e-9 leaves 1.3e-5, twice what the Runge-Kutta steps leave,
# and this 2e-6
RTOL = 5e-10
# one step a sample but where a part switches: less error than either of them
ADAPTIVE = CashKarp(relative=1e-6, absolute=1e-6)

C, NUMBA = "C by hand, -O3 -march=native", "Numba, fastmath"
OURS, OURS_ADAPTIVE = "symheli.simulate", "symheli.simulate, CashKarp(1e-6, 1e-6)"

Fly = Callable[
    [np.ndarray, np.ndarray, np.ndarray], np.ndarray
]  # (x0, inputs (n, 4), wind) -> states (n + 1, 15)


@dataclass
class Race:
    """What was measured: rows of the tables, the ratios, and what could not be run here."""

    quick: bool
    tables: list[str] = field(default_factory=list)
    ratios: list[Ratio] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    alone: Flown | None = None
    batch: Flown | None = None


class Contestants:
    """Ways to fly, by name, with the start and the inputs of a recorded transition of 30 s."""

    def __init__(self, race: Race):
        self.heli = symheli.Helicopter.load("xcell60", governor="ideal")
        schedule = symheli.AirspeedSchedule.transition(0.0, 13.0, acceleration=3.0, hold=7.3)
        self.inputs = np.ascontiguousarray(
            symheli.fly(self.heli, schedule).columns(self.heli.inputs)[:1500]
        )
        self.x0 = symheli.simulate(
            self.heli, symheli.trim(self.heli, 0.0), self.inputs[:1], dt=DT
        ).states[0]
        self.on_the_way = self.symheli(self.x0, self.inputs, STILL)[200]  # after 4 s, accelerating
        self.compiled: dict[str, Fly] = {}
        self.numba_batch = None
        if cc := shutil.which("cc"):
            from benchmarks.opponents.c_flight import CFlight

            code = CFlight(cc)
            self.compiled[C] = lambda x, u, wind: code.fly(x, u, wind, DT, STEPS)
        else:
            race.notes.append("C by hand: left out, no C compiler")
        try:
            from benchmarks.opponents import numba_flight

            self.compiled[NUMBA] = lambda x, u, wind: numba_flight.fly(x, u, wind, DT, STEPS)
            if not race.quick:
                self.numba_batch = numba_flight.fly_many
        except ImportError:
            race.notes.append("Numba: left out, it is not installed (pip install numba)")

    def symheli(self, x0: np.ndarray, inputs: np.ndarray, wind: np.ndarray) -> np.ndarray:
        return symheli.simulate(self.heli, x0, inputs, wind, dt=DT).states

    def adaptive(self, x0: np.ndarray, inputs: np.ndarray, wind: np.ndarray) -> np.ndarray:
        return symheli.simulate(self.heli, x0, inputs, wind, dt=DT, method=ADAPTIVE).states

    def evaluations(self, x0: np.ndarray, inputs: np.ndarray) -> dict[Fly, int]:
        """Right-hand sides of each way to fly in still air, where they are known."""
        taken = symheli.simulate(self.heli, x0, inputs, STILL, dt=DT, method=ADAPTIVE).evaluations
        classical = dict.fromkeys((self.symheli, *self.compiled.values()), 4 * STEPS * len(inputs))
        return {**classical, self.adaptive: taken or 0}


def right_hand_side(race: Race, who: Contestants) -> None:
    """One evaluation of the Euler form through three of symheli's own doors."""
    heli, point, calls = who.heli, symheli.trim(who.heli, 7.0), 200
    x, u = point.x.array, point.u.array
    fast, machine, parameters = (
        heli.numeric("rhs"),
        Numeric(heli.rhs),
        heli.parameters.array.tolist(),
    )

    def plain() -> np.ndarray:
        """The component functions called with floats, no CasADi."""
        return np.array(heli.dynamics.accelerations(list(x), list(u), STILL, parameters)[:6], float)

    np.testing.assert_allclose(plain(), fast(x, u, STILL)[0][:6], atol=1e-9)
    many = {
        "compiled": lambda: [fast(x, u, STILL) for _ in range(calls)],
        "virtual machine": lambda: [machine(x, u, STILL) for _ in range(calls)],
    }
    times = medians({**many, "NumPy": plain}, 0.5 if race.quick else 5.0, time.thread_time)
    times |= {name: times[name] / calls for name in many}
    race.tables.append(
        table(
            "### One right-hand side of symheli, called from Python",
            [(n, readable(t)) for n, t in times.items()],
            ("", "median"),
        )
    )
    for name in ("virtual machine", "NumPy"):
        race.ratios.append(Ratio(f"compiled against {name}", times[name] / times["compiled"]))


def fly_one(race: Race, who: Contestants) -> None:
    """30 s of flight, the states kept every 20 ms; SciPy, a hundred times slower, takes its turns
    in a group of its own.
    """
    rows = []

    def take_turns(
        flyers: dict[str, Fly], x0: np.ndarray, inputs: np.ndarray, seconds: float
    ) -> dict[str, float]:
        exact = symheli.simulate(who.heli, x0, inputs, dt=DT, method=RungeKutta4(DT / 64)).states
        taken = who.evaluations(x0, inputs)
        times = medians(
            {name: partial(fly, x0, inputs, STILL) for name, fly in flyers.items()},
            seconds,
            time.thread_time,
        )
        for name, fly in flyers.items():
            error = np.abs(fly(x0, inputs, STILL) - exact).max()
            length = f"{len(inputs) * DT:g} s"
            rows.append(
                (name, length, readable(times[name]), f"{error:.1e}", str(taken.get(fly, "")))
            )
        return times

    times = take_turns(
        {OURS: who.symheli, **who.compiled, OURS_ADAPTIVE: who.adaptive},
        who.x0,
        who.inputs,
        1.0 if race.quick else 10.0,
    )
    ours = times[OURS]
    race.alone = Flown("one flight", STEPS * len(who.inputs), ours, 1)
    if (c := times.get(C)) is not None:
        race.ratios.append(
            Ratio(
                "30 s of flight: symheli's time over hand-written C's", ours / c, 1.0, at_most=True
            )
        )
    if (numba := times.get(NUMBA)) is not None:
        race.ratios.append(
            Ratio("30 s of flight: times faster than Numba (fastmath)", numba / ours, 1.1)
        )
    race.ratios.append(
        Ratio("30 s of flight: adaptive steps against equal ones", ours / times[OURS_ADAPTIVE])
    )

    part, start = who.inputs, who.x0
    if race.quick:
        part, start = who.inputs[200:300], who.on_the_way
        race.notes.append("SciPy and symheli beside it: 2 s of the acceleration in place of 30 s")
    arrays, floats = (
        "SciPy solve_ivp, state unpacked from NumPy",
        "SciPy solve_ivp, state unpacked to Python floats",
    )
    slow = {
        f"{OURS_ADAPTIVE}, beside SciPy": who.adaptive,
        arrays: lambda x, u, wind: scipy_flight.fly(x, u, wind, DT, RTOL, unpack=iter),
        floats: lambda x, u, wind: scipy_flight.fly(x, u, wind, DT, RTOL),
    }
    times = take_turns(slow, start, part, 0.0)
    ours = times[f"{OURS_ADAPTIVE}, beside SciPy"]
    for name, flyer in ((arrays, "NumPy equations"), (floats, "Python floats")):
        race.ratios.append(
            Ratio(
                f"30 s of flight: adaptive, times faster than SciPy on {flyer}",
                times[name] / ours,
                150.0,
            )
        )
    race.tables.append(
        table(
            "### One flight, Runge-Kutta steps of 5 ms or by tolerance, states every 20 ms",
            rows,
            ("", "flight", "median", "largest error of any state (SI)", "right-hand sides"),
        )
    )


def fly_many(race: Race, who: Contestants) -> None:
    """Monte Carlo: 10 s flights from scattered starts, each in its own steady wind; the last states
    are kept.
    """
    count = QUICK_FLIGHTS if race.quick else FLIGHTS
    if race.quick:
        race.notes.append(f"batch: {count} flights in place of {FLIGHTS:,}")
    rng = np.random.default_rng(0)
    inputs = who.inputs[200:700]
    starts = who.on_the_way + 0.05 * rng.standard_normal((count, 15)) * (np.arange(15) < 6)
    winds = rng.standard_normal((count, 3))

    def batch() -> np.ndarray:
        return symheli.integrate.simulate_batch(
            who.heli, starts, inputs, winds[:, None], dt=DT
        ).final

    def loop(fly: Fly) -> Callable[[], np.ndarray]:
        return lambda: np.stack(
            [fly(x, inputs, wind)[-1] for x, wind in zip(starts, winds, strict=True)]
        )

    candidates = {
        "symheli.integrate.simulate_batch": batch,
        "a loop of symheli.simulate": loop(who.symheli),
    }
    candidates |= {f"a loop of {name}": loop(fly) for name, fly in who.compiled.items()}
    if parallel := who.numba_batch:
        candidates["Numba, prange over the flights"] = lambda: parallel(
            starts, inputs, winds, DT, STEPS
        )
    ends = {name: call() for name, call in candidates.items()}
    # chaos does not build up in 10 s: what differs is rounding
    apart = {
        name: np.abs(end - ends["symheli.integrate.simulate_batch"]).max()
        for name, end in ends.items()
    }
    times = medians(candidates, 1.0 if race.quick else 0.0, warm=False)
    base = times["symheli.integrate.simulate_batch"]
    race.batch = Flown(
        f"{count:,} flights", STEPS * len(inputs) * count, base, len(os.sched_getaffinity(0))
    )
    race.tables.append(
        table(
            f"### {count:,} flights of 10 s, Runge-Kutta steps of 5 ms, last states",
            [(name, readable(t), f"{apart[name]:.1e}") for name, t in times.items()],
            ("", "median", "largest difference to the batch (SI)"),
        )
    )
    for name, t in times.items():
        if name != "symheli.integrate.simulate_batch":
            goal = 3.0 if name.startswith("a loop of") else None
            race.ratios.append(Ratio(f"flights of 10 s: batch against {name}", t / base, goal))


def physical_limit(race: Race, who: Contestants) -> None:
    """The flights before beside what this processor can do."""
    flown = [way for way in (race.alone, race.batch) if way is not None]
    processors = {way.threads: processor(way.threads) for way in flown}
    if None in processors.values():
        race.notes.append("the physical limit: left out, no C compiler")
        return
    states = who.symheli(who.x0, who.inputs, STILL)[:-1]
    done = work(who.heli, states, who.inputs, STEPS, processors[1].wait)
    text, ratios = limits(*flown, done, processors)
    race.tables.append(text)
    race.ratios += ratios
    for way, count in zip(flown, (done.alone, done.among_many), strict=True):
        race.notes.append(f"{way.name}, one step of four right-hand sides: {described(count)}")


def sweep(race: Race, who: Contestants) -> None:
    """200 trims with their linear models, hover to 13 m/s; and over acceleration too."""
    from benchmarks.opponents import python_control_sweep

    speeds = np.linspace(0.0, 13.0, 200)
    grid, pushes = np.linspace(0.0, 13.0, 27), [-4.0, -2.0, 0.0, 2.0, 4.0]
    ours, theirs = "symheli.sweep (exact derivatives, kinks found)", "python-control"
    both = "symheli.steady.sweep_grid, 27 airspeeds by 5 accelerations"
    candidates = {
        ours: lambda: symheli.sweep(who.heli, speeds),
        both: lambda: symheli.steady.sweep_grid(who.heli, grid, acceleration=pushes),
        theirs: lambda: python_control_sweep.sweep(speeds),
    }
    times = medians(candidates, 0.0 if race.quick else 5.0, time.thread_time)
    family, found = symheli.sweep(who.heli, speeds), python_control_sweep.sweep(speeds)
    trims = max(
        np.abs(x - t.x.array).max() for (x, _, _), t in zip(found, family.trims, strict=True)
    )
    smooth = [
        k
        for k, v in enumerate(speeds)
        if all(abs(v - kink) > 0.05 for kinks in family.kinks.values() for kink in kinks)
        and v > 0.05
    ]
    models = max(np.abs(found[k][2].A - family.A[k]).max() for k in smooth)
    race.tables.append(
        table(
            f"### Trim and linear model at {len(speeds)} airspeeds, 0 to 13 m/s",
            [
                (ours, readable(times[ours]), ""),
                (both, readable(times[both]), ""),
                (
                    "python-control, find_operating_point and linearize",
                    readable(times[theirs]),
                    f"trims {trims:.0e}, A {models:.0e}",
                ),
            ],
            ("", "median", "largest difference to symheli (SI; A away from the kinks)"),
        )
    )
    race.tables.append(sweep_steps(who.heli, speeds, 0.2 if race.quick else 2.0))
    race.ratios += [
        Ratio(
            "sweep of trims and linear models: times faster than python-control",
            times[theirs] / times[ours],
            30.0,
        ),
        Ratio(
            "grid of 27 airspeeds by 5 accelerations: its time over 30 ms",
            times[both] / 30e-3,
            1.0,
            at_most=True,
        ),
    ]


def main() -> None:
    options = arguments(__doc__, write=True)
    race = Race(options.quick)
    who = Contestants(race)
    for part in (fly_one, fly_many, physical_limit, sweep, right_hand_side):
        part(race, who)
    present("model", options, race.tables, race.ratios, race.notes)


if __name__ == "__main__":
    main()
