"""Number of threads of linear algebra.

The matrices here are small: one thread is fastest, and threads that wait for each other on a busy
machine cost several times the work.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, wraps
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

BLAS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
"""Variables of the environment by which a user says how many."""


def with_one_thread(work: Callable[P, R]) -> Callable[P, R]:
    """Run `work` with one thread of BLAS, where the environment does not set a number."""

    @wraps(work)
    def limited(*arguments: P.args, **options: P.kwargs) -> R:
        with one_thread():
            return work(*arguments, **options)

    return limited


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit BLAS to one thread within the block, where the environment does not set a number;
    threads other than the main one do not change it, since the number is the process's.
    """
    main = threading.current_thread() is threading.main_thread()
    if not main or any(name in os.environ for name in BLAS):
        yield
        return
    limited = _libraries().limit(limits=1, user_api="blas")
    try:
        yield
    finally:
        limited.restore_original_limits()


@cache
def _libraries() -> Any:
    """Return the BLAS libraries of this process, once NumPy and SciPy are loaded."""
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
