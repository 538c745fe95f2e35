"""What this processor can do, measured in the same run as what is set beside it: its peak in
FLOP/s, the pace of roots and quotients, and how long an operation keeps the next one waiting.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from symheli.codegen import Layout
from symheli.codegen.compile import library

FLOATING = {"add": 1, "sub": 1, "mul": 1, "div": 1, "sqrt": 1, "fma": 2, "fms": 2, "fnma": 2}
"""Floating-point operations that one operation of a program counts for; comparisons, selections and
signs count for none.
"""
ROUNDS, RUNS = 500_000, 12
"""Of each loop, some milliseconds, and how often it is run: the best counts."""


def flop(count: Mapping[str, float]) -> float:
    """Floating-point operations in so many operations of each name (`Program.count`)."""
    return sum(FLOATING.get(name, 0) * n for name, n in count.items())


@dataclass(frozen=True)
class Processor:
    """`peak` FLOP/s of `workers` threads together, `wait` s until the result of an operation can be
    used, `pace` s for each root or quotient of a thread that computes nothing else.
    """

    workers: int
    peak: float
    wait: dict[str, float]
    pace: dict[str, float]

    def share(self, operations: float, seconds: float) -> float:
        """Of the peak: so many floating-point operations in so many seconds."""
        return operations / seconds / self.peak

    def divider(self, count: Mapping[str, float], seconds: float) -> float:
        """Share of the time of all threads that roots and quotients alone take."""
        busy = sum(count.get(name, 0) * each for name, each in self.pace.items())
        return busy / seconds / self.workers


def processor(workers: int = 1) -> Processor | None:
    """This processor, by the best run of each loop; None without a C compiler."""
    text = Layout(8).prelude + Path(__file__).with_name("peak.c").read_text(encoding="utf-8")
    path = library(text, "peak")
    if path is None:
        return None
    code = ctypes.CDLL(str(path))

    def seconds(name: str, threads: int = 1) -> float:
        return min(_threads(partial(_loop, code, name), threads) for _ in range(RUNS)) / ROUNDS

    side_by_side = code.side_by_side()
    return Processor(
        workers,
        2 * code.fused_per_round() * workers / seconds("fused", workers),
        {name: seconds(f"wait_{name}") for name in ("add", "mul", "fma", "div", "sqrt")},
        {"sqrt": seconds("roots") / side_by_side, "div": seconds("quotients") / side_by_side},
    )


def _loop(code: ctypes.CDLL, name: str) -> None:
    function = getattr(code, name)
    function.argtypes, function.restype = [ctypes.c_long, ctypes.c_double], ctypes.c_double
    function(ROUNDS, 1.0)


def _threads(work: Callable[[], None], workers: int) -> float:
    """Time of so many threads at once, by the clock on the wall; of one by its processor time."""
    if workers == 1:
        begin = time.thread_time()
        work()
        return time.thread_time() - begin
    with ThreadPoolExecutor(workers) as pool:
        begin = time.perf_counter()
        for future in [pool.submit(work) for _ in range(workers)]:
            future.result()
        return time.perf_counter() - begin
