"""Memory of a call, in a process of its own."""

from __future__ import annotations

import math
import multiprocessing
import re
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


def alone(call: Callable[..., Any], *args: Any) -> Any:
    """call(*args) in a process of its own, where nothing else has set the peak."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(call, args)
