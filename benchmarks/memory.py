"""Memory of a call, in a process of its own."""

from __future__ import annotations

import math
import multiprocessing
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any


def peak() -> float:
    """Largest resident size of this process so far, MiB; NaN where the system does not say (it is
    Linux that does).
    """
    status = Path("/proc/self/status")
    found = (
        re.search(r"VmHWM:\s*(\d+) kB", status.read_text(encoding="utf-8"))
        if status.exists()
        else None
    )
    return int(found.group(1)) / 1024 if found else math.nan


def with_children() -> float:
    """Largest resident size of this process or of one that it started and that has ended, MiB."""
    try:
        import resource
    except ImportError:
        return peak()
    unit = 1 if sys.platform == "darwin" else 1024
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * unit / 2**20
    return max(peak(), children)


def alone(call: Callable[..., Any], *args: Any) -> Any:
    """call(*args) in a process of its own, where nothing else has set the peak."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(call, args)
