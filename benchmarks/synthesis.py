"""Gain-scheduled output feedback of the X-Cell: time, memory and gain against states, degree and
divisions, beside the same conditions on a grid in cvxpy; the sampled loop of the reduced controller
in 32 bits, proven; point designs beside SLICOT's.

Each design is made in a process of its own with one thread; building the plant is not counted.
"""

from __future__ import annotations

import statistics
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path[0] = str(ROOT)  # this folder holds scripts named like the packages they measure

from studies.threads import one_thread  # noqa: E402

one_thread()

import numpy as np  # noqa: E402

import symheli  # noqa: E402
from benchmarks.design_plants import (  # noqa: E402
    DESIGNS,
    DT,
    HIGH,
    LOW,
    RATE,
    design_plant,
    flying_plant,
)
from benchmarks.memory import alone, with_children  # noqa: E402
from benchmarks.race import Ratio, present, readable, table  # noqa: E402
from benchmarks.timing import arguments, medians  # noqa: E402
from symheli.errors import SymheliError  # noqa: E402
from synthesis import certify_sampled, hinf, output_feedback  # noqa: E402
from synthesis.forms import Spline  # noqa: E402

BACK_OFF = 1.3
LARGE = 18
"""States of the design that is reduced and flown."""
KEPT, KNOTS = 10, 5
DESIGN_GOAL, PROOF_GOAL = 120.0, 300.0
"""Seconds."""
SAMPLED = Spline(degree=1, segments=4)
GRIDDED = {True: (7,), False: (7, 14)}
"""States of the plants that cvxpy is given, quick or not: 18 take it many minutes."""


class Made(NamedTuple):
    """A design: gamma, order, seconds, largest resident size in MiB, pole of largest modulus in
    rad/s; gamma is inf where none was found.
    """

    gamma: float
    seconds: float
    memory: float
    fastest: float
    misfit: float


class Flight(NamedTuple):
    """Of a reduced controller, sampled and tabulated: states of it and of the loop, frozen gains of
    the continuous design loop before and after the reduction, what is proven, seconds.
    """

    order: int
    states: int
    design: float
    full: float
    reduced: float
    frozen: float
    proven: float
    loss: float
    seconds: float
    memory: float


def made(states: int, degree: int, moving: int, divisions: int) -> Made:
    """The controller of one plant."""
    plant = design_plant(states, degree)
    begin = time.perf_counter()
    try:
        found = output_feedback(plant, Y=moving, back_off=BACK_OFF, divisions=divisions)
    except SymheliError:
        return Made(np.inf, time.perf_counter() - begin, with_children(), np.nan, np.nan)
    spent = time.perf_counter() - begin
    A = found.model.matrices(np.linspace(LOW, HIGH, 27)).A
    fastest = float(np.abs(np.linalg.eigvals(A)).max())
    return Made(found.promised, spent, with_children(), fastest, found.misfit)


def flown(states: int, kept: int, prove: bool) -> Flight:
    """The design of so many states reduced to `kept`, and its loop as it flies."""
    from synthesis import frozen_gain

    controller = output_feedback(design_plant(states), Y=2, back_off=BACK_OFF)
    full = frozen_gain(controller.closed(), points=14).gain
    small = controller.reduce(kept)
    less = frozen_gain(small.closed(), points=14).gain
    flies = symheli.TableController.of(small.discretize(DT).model, KNOTS)
    plant = flying_plant(DESIGNS[states][0])
    begin = time.perf_counter()
    if not prove:
        loop = plant.close(flies)
        frozen = frozen_gain(loop, points=14).gain
        spent = time.perf_counter() - begin
        return Flight(
            small.order,
            len(loop.states),
            controller.promised,
            full,
            less,
            frozen,
            np.nan,
            np.nan,
            spent,
            with_children(),
        )
    found = certify_sampled(
        flies, plant, RATE, promised=controller.promised, cover=False, form=SAMPLED, search=None
    )
    return Flight(
        small.order,
        len(found.loop.states),
        controller.promised,
        full,
        less,
        found.certificate.frozen,
        found.gamma,
        found.loss,
        time.perf_counter() - begin,
        with_children(),
    )


def gridded(states: int) -> Made:
    """The conditions on eleven points in cvxpy."""
    from benchmarks.opponents import gridded_synthesis

    plant = design_plant(states)
    begin = time.perf_counter()
    gamma = gridded_synthesis.gain(lambda p: plant.at(p), LOW, HIGH, RATE)
    return Made(gamma, time.perf_counter() - begin, with_children(), np.nan, np.nan)


def points(states: int, seconds: float) -> list[tuple[str, float, float, float]]:
    """At three airspeeds: own and SLICOT's gamma and median seconds."""
    from symheli import LinearModel

    axes = DESIGNS[states][0]
    plant = design_plant(states)
    rows = []
    for p in (LOW, 0.5 * (LOW + HIGH), HIGH):
        at = plant.at(p)
        A, B = at.A, np.hstack([at.B1, at.B2])
        C = np.vstack([at.C1, at.C2])
        D = np.block([[at.D11, at.D12], [at.D21, at.D22]])
        nu, ny = len(axes.controls), len(axes.measured)
        names = [f"w{i}" for i in range(B.shape[1] - nu)] + list(axes.controls)
        shown = [f"z{i}" for i in range(len(C) - ny)] + list(axes.measured)
        model = LinearModel(A, B, C, D, [f"x{i}" for i in range(len(A))], names, shown)
        own = hinf(model, axes.controls, axes.measured)

        def theirs(blocks: Any = (A, B, C, D, nu, ny)) -> float:
            import control

            a, b, c, d, controls, measured = blocks
            return float(control.hinfsyn(control.ss(a, b, c, d), measured, controls)[2])

        times = medians(
            {
                "own": lambda m=model: hinf(m, axes.controls, axes.measured),
                "slicot": theirs,
            },
            seconds,
        )
        rows.append((f"{p:g} m/s", own.hinf_norm / theirs(), times["own"], times["slicot"]))
    return rows


Case = tuple[int, int, int, int]
"""States of the plant, degrees of its entries and of Y, divisions."""


def usual(states: int) -> Case:
    """The case of so many states that sizes are compared by."""
    return states, 3, 2, 1


class Results(NamedTuple):
    """Of all that was made, by case or by states."""

    designs: dict[Case, Made]
    others: dict[int, Made]
    flights: dict[int, Flight]
    beside: list[tuple[str, float, float, float]]

    @property
    def ratios(self) -> list[Ratio]:
        """With their goals."""
        found = []
        for n, other in self.others.items():
            own = self.designs[usual(n)]
            found += [
                Ratio(f"{n} states: cvxpy on 11 points / own, time", other.seconds / own.seconds),
                Ratio(
                    f"{n} states: own least gamma / that on the grid",
                    own.gamma / BACK_OFF / other.gamma,
                ),
            ]
        if (large := self.designs.get(usual(LARGE))) is not None:
            name = f"{LARGE} states: seconds of the design / {DESIGN_GOAL:g}"
            seconds = large.seconds if np.isfinite(large.gamma) else np.inf
            found.append(Ratio(name, seconds / DESIGN_GOAL, 1, at_most=True))
        for n, f in self.flights.items():
            if f.order < n:
                name = f"{n} states: frozen gain with {f.order} states of the controller / all"
                found.append(Ratio(name, f.reduced / f.full))
            name = f"{n} states: frozen gain as it flies / gamma of the synthesis"
            found.append(Ratio(name, f.frozen / f.design))
            if n == LARGE:
                name = f"{f.states} states as they fly: seconds proven in / {PROOF_GOAL:g}"
                seconds = f.seconds if np.isfinite(f.proven) else np.inf
                found.append(Ratio(name, seconds / PROOF_GOAL, 1, at_most=True))
        gamma = max(gamma for _, gamma, _, _ in self.beside)
        found.append(Ratio("point designs: own gamma / SLICOT's, the largest", gamma))
        times = statistics.median(theirs / own for _, _, own, theirs in self.beside)
        found.append(Ratio("point designs: SLICOT's time / own, median", times))
        sizes = sorted({n for n, *_ in self.designs})
        spent = [self.designs[usual(n)].seconds for n in sizes]
        slope = np.polyfit(np.log(sizes), np.log(spent), 1)[0]
        found.append(Ratio("exponent of time against states", float(slope)))
        return found

    @property
    def tables(self) -> list[str]:
        """Designs, flights, point designs."""
        rows = [
            (
                f"{n} states, entries of degree {degree}, Y of {moving}, {divisions} divisions",
                *(f"{m.gamma:.4f}", readable(m.seconds), f"{m.memory:.0f} MiB"),
                *(f"{m.fastest:.0f} rad/s", f"{m.misfit:.1g}"),
            )
            for (n, degree, moving, divisions), m in self.designs.items()
        ]
        rows += [
            (
                f"{n} states, cvxpy on 11 points",
                *(f"{m.gamma:.4f}", readable(m.seconds), f"{m.memory:.0f} MiB"),
                *("no controller", ""),
            )
            for n, m in self.others.items()
        ]
        loops = [
            (
                f"{n} states designed for, {f.order} kept",
                *(f"{f.states}", f"{f.design:.4f}", f"{f.full:.4f}", f"{f.reduced:.4f}"),
                *(f"{f.frozen:.4f}", "not tried" if np.isnan(f.proven) else f"{f.proven:.4f}"),
                *(readable(f.seconds), f"{f.memory:.0f} MiB"),
            )
            for n, f in self.flights.items()
        ]
        at = [(at, f"{g:.6f}", readable(o), readable(t)) for at, g, o, t in self.beside]
        return [
            table(
                f"### Output feedback for every acceleration within {RATE:g} m/s^2",
                rows,
                ("", "gamma", "time", "memory", "fastest pole", "misfit"),
            ),
            table(
                "### As they fly: tables of 32 bits at 50 Hz, true servos, one sample of delay",
                loops,
                (
                    *("", "states of the loop", "gamma promised", "frozen, whole"),
                    *("frozen, reduced", "frozen, flown", "proven, flown", "time", "memory"),
                ),
            ),
            table(
                "### Point designs of 7 states", at, ("", "own gamma / SLICOT's", "own", "SLICOT's")
            ),
        ]


def main() -> None:
    options = arguments(__doc__, write=True)
    cases = [usual(n) for n in ((7, 14) if options.quick else DESIGNS)]
    if not options.quick:
        cases += [(7, 3, 1, 1), (7, 3, 3, 1), (7, 2, 2, 1), (7, 3, 2, 2), (7, 3, 2, 4)]
    flights = {7: (7, False)} if options.quick else {7: (7, True), LARGE: (KEPT, True)}
    results = Results(
        {case: alone(made, *case) for case in cases},
        {n: alone(gridded, n) for n in GRIDDED[options.quick]},
        {n: alone(flown, n, *how) for n, how in flights.items()},
        points(7, 0.5 if options.quick else 5.0),
    )
    note = f"gamma is {BACK_OFF:g} times the least, where the controllers have no fast poles"
    present("synthesis", options, results.tables, results.ratios, [note])


if __name__ == "__main__":
    main()
