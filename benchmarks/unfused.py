"""What a processor can do without fused operations, at a level of its vector instructions: what
code can reach that gives the same bits everywhere.
"""

from __future__ import annotations

import ctypes
import time
from pathlib import Path

from symheli.codegen.compile import library

WIDTH = {"avx512": 8, "avx2": 4, "baseline": 2}
"""Numbers in a vector, by level."""
ROUNDS, RUNS = 500_000, 12
"""Of the loop, some milliseconds, and how often it is run: the best counts."""


def unfused_peak(level: str) -> float | None:
    """FLOP/s of one thread at products and sums that wait for nothing; None without a C
    compiler.
    """
    source = Path(__file__).with_suffix(".c").read_text(encoding="utf-8")
    path = library(f"#define WIDTH {WIDTH[level]}\n{source}", "unfused")
    if path is None:
        return None
    code = ctypes.CDLL(str(path))
    code.unfused.argtypes, code.unfused.restype = [ctypes.c_long, ctypes.c_double], ctypes.c_double
    return code.operations() * ROUNDS / min(_seconds(code) for _ in range(RUNS))


def _seconds(code: ctypes.CDLL) -> float:
    begin = time.thread_time()
    code.unfused(ROUNDS, 1.0)
    return time.thread_time() - begin
