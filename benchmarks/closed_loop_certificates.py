"""Certificates of closed loops as they fly, 12 to 40 states: the proven gain beside the worst
frozen one, time of the search and of the exact verification, memory, growth, operations.

Each loop is certified and its file verified in rational arithmetic, in a process of its own with
one thread; building the loop is not counted. A general solver is given the smaller ones too. Goals
are for the clock on the wall, other ratios of times for the processor's.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path[0] = str(ROOT)  # this folder holds scripts named like the packages they measure

from studies.threads import one_thread  # noqa: E402

one_thread()

import numpy as np  # noqa: E402

from benchmarks.closed_loops import LOOPS, RATE, closed_loop, sampled_loop  # noqa: E402
from benchmarks.memory import alone, with_children  # noqa: E402
from benchmarks.race import Ratio, present, readable, table  # noqa: E402
from benchmarks.timing import arguments  # noqa: E402
from synthesis import Certificate, l2_gain  # noqa: E402
from synthesis.forms import Spline  # noqa: E402

PROOF = Spline(segments=4, degree=2)
"""Nine matrices."""
SAMPLED = Spline(segments=4, degree=1)
GOALS = {20: 60.0, 30: 300.0, 40: 900.0}
"""Seconds of search and exact verification together, by the number of states."""
MEMORY = 4096.0
"""MiB that no process may exceed."""
ROWS = 1000
"""Of the matrices whose product says what this processor can do."""


class Measured(NamedTuple):
    """The search (with the worst frozen gain) and the exact verification: seconds on the wall, and
    the processor's for the search; largest resident size, MiB; how the programs were answered.
    """

    states: int
    gamma: float
    frozen: float
    proven: bool
    search: float
    verification: float
    processor: float
    memory: float
    answers: tuple[str, ...]

    @property
    def whole(self) -> float:
        """Search and exact verification, s."""
        return self.search + self.verification


def certified(states: int, solver: str) -> Measured:
    """The loop of so many states, 0 for the sampled one, certified and verified from its file."""
    loop, form = (closed_loop(states), PROOF) if states else (sampled_loop(), SAMPLED)
    begin, own = time.perf_counter(), processor()
    certificate = l2_gain(loop, RATE, form=form, solver=solver, search=None)
    found, own = time.perf_counter(), processor() - own
    proven = False
    if certificate.verified:
        with tempfile.TemporaryDirectory() as folder:
            file = certificate.save(Path(folder) / "proof.json")
            proven = Certificate.load(file).verify(rigorous=True)
    return Measured(
        len(loop.states),
        certificate.gamma,
        certificate.frozen,
        proven,
        found - begin,
        time.perf_counter() - found,
        own,
        with_children(),
        tuple(attempt.answer for attempt in certificate.attempts),
    )


def processor() -> float:
    """Seconds at work of this process and of those it started and that have ended."""
    return sum(os.times()[:4])


def speed() -> float:
    """Operations a second that one thread makes in the product of two matrices."""
    A = np.random.default_rng(0).standard_normal((ROWS, ROWS))
    times = []
    for _ in range(4):
        begin = time.process_time()
        A @ A
        times.append(time.process_time() - begin)
    return 2.0 * ROWS**3 / min(times)


def operations(states: int, segments: int, degree: int) -> float:
    """Of one iteration for a cubic model: the products behind the normal equations, and their
    factorisation.

    Each segment has degree + 1 coefficients of P and degree + 4 blocks for each sign of the rate:
    for each pair of coefficients a product of two matrices of n^2 rows and two columns a block.
    """
    v, blocks = states * (states + 1) / 2, (degree + 4) * (2 if degree else 1)
    pairs = (degree + 1) * (degree + 2) / 2
    products = segments * pairs * 2.0 * states**4 * 2 * blocks
    # a pivot with `b` coefficients behind it in its segment: itself, these, and their products
    behind = list(range(degree, 0, -1)) * segments
    return products + v**3 / 3 + sum(v**3 / 3 + b * v**3 + b * (b + 1) * v**3 for b in behind)


def counted(m: Measured) -> float:
    """Operations of a whole search: that for P(p), then that for a constant P, whose blocks are
    cut in eight.
    """
    found = [int(re.search(r"after (\d+) iterations", answer)[1]) for answer in m.answers]  # type: ignore[index]
    each = (operations(m.states, 4, 2), operations(m.states, 8, 0))
    return sum(k * own for k, own in zip(found, each, strict=True))


def exponent(measured: Iterable[Measured]) -> float:
    """Slope of the logarithm of the processor's time against that of the states."""
    points = [(m.states, m.processor) for m in measured]
    return float(np.polyfit(*np.log(np.array(points)).T, 1)[0])


def main() -> None:
    options = arguments(__doc__, write=True)
    sizes = (12, 16, 20) if options.quick else tuple(LOOPS)
    general = (12,) if options.quick else (12, 16, 20)
    own = {n: alone(certified, n, "LYAPUNOV") for n in sizes}
    others = {n: alone(certified, n, "CLARABEL") for n in general}
    named = {f"{n} states": m for n, m in own.items()}
    if not options.quick:
        named["20 states, sampled at 50 Hz"] = alone(certified, 0, "LYAPUNOV")
    ratios = []
    for name, m in named.items():
        if m.states in GOALS:
            goal = GOALS[m.states]
            seconds = m.whole if m.proven else np.inf
            ratios.append(Ratio(f"{name}: seconds proven in / {goal:g}", seconds / goal, 1, True))
        above = 100 * (m.gamma / m.frozen - 1)
        ratios.append(Ratio(f"{name}: proven gain above the worst frozen one, %", above))
    rows = [
        (
            name,
            f"{m.gamma:.4f}" if m.proven else "not proven",
            f"{m.frozen:.4f}",
            readable(m.search),
            readable(m.processor),
            readable(m.verification),
            f"{m.memory:.0f} MiB",
            m.answers[0].partition(", verified")[0],
        )
        for name, m in (named | {f"{n} states, Clarabel": m for n, m in others.items()}).items()
    ]
    head = (
        *("", "gain proven", "worst frozen", "search", "of it the processor"),
        *("exact verification", "memory", "answer for P(p)"),
    )
    most = max(m.memory for m in named.values())
    ratios.append(Ratio(f"largest memory / {MEMORY / 1024:g} GiB", most / MEMORY, 1, True))
    for n, m in others.items():
        ratios.append(Ratio(f"{n} states: search, Clarabel / own", m.processor / own[n].processor))
    ratios.append(Ratio("exponent of time against states", exponent(own.values())))
    rate = speed()
    ratios += [
        Ratio(
            f"{n} states: search / its matrix products and factors alone at full speed",
            m.processor / (counted(m) / rate),
        )
        for n, m in own.items()
    ]
    notes = [f"one thread makes {rate / 1e9:.1f} 1e9 operations a second in a product of matrices"]
    present(
        "closed loops",
        options,
        [table("### Closed loops as they fly", rows, head)],
        ratios,
        notes,
    )


if __name__ == "__main__":
    main()
