"""Medians of repeated runs, interleaved so that a drifting machine treats both sides alike."""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from pathlib import Path

from evidence.tables import parsed


def medians(
    candidates: dict[str, Callable[[], object]],
    seconds: float,
    clock: Callable[[], float] = time.perf_counter,
    *,
    warm: bool = True,
    settled: bool = False,
) -> dict[str, float]:
    """Median time of one call of each, in s, over about `seconds` of interleaved runs each and at
    least three.

    `clock` time.thread_time counts what one thread works and not what others keep it from: for work
    of one thread on a busy machine. `warm`: each is called once before, so that nothing is compiled
    while the clock runs; without it the caller has done so. `settled`: each is called once more
    right before it is timed: it does not pay for caches and a clock frequency that others left.
    """
    spent: dict[str, list[float]] = {name: [] for name in candidates}
    for call in candidates.values() if warm else ():
        call()
    end = time.perf_counter() + seconds * len(candidates)
    while time.perf_counter() < end or min(len(t) for t in spent.values()) < 3:
        for name, call in candidates.items():
            if settled:
                call()
            begin = clock()
            call()
            spent[name].append(clock() - begin)
    return {name: statistics.median(times) for name, times in spent.items()}


def arguments(
    description: str | None, plot: bool = False, write: bool = False, *, timed: bool = True
) -> argparse.Namespace:
    """--quick and --json, as every benchmark has them; --plot where there is something to draw,
    --write to keep it in the documentation, on a busy machine too where it counts and nothing is
    `timed`.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--quick", action="store_true", help="shorter runs, under 40 s")
    parser.add_argument("--json", action="store_true", help="print each ratio by name")
    if plot:
        parser.add_argument(
            "--plot", type=Path, metavar="FILE", help="draw the result (needs matplotlib)"
        )
    return parsed(parser, "benchmarks.md", timed=timed) if write else parser.parse_args()


def lines(times: dict[str, float], ratios: dict[str, float]) -> list[str]:
    """A table of medians and ratios."""
    return [
        *(f"{name:60s}{1e6 * value:14.2f} us" for name, value in times.items()),
        *(f"{name:60s}{value:14.2f}" for name, value in ratios.items()),
    ]


def keep(section: str, text: str) -> None:
    """Put a plain text between the marks of `section` in docs/benchmarks.md."""
    from benchmarks import race

    race.keep(section, f"```text\n{text}\n```")
