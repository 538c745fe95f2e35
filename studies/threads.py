"""Threads of the processes that start here."""

from __future__ import annotations

import os

BLAS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


def one_thread() -> None:
    """Ask for one BLAS thread where the environment does not say how many; to be called where a
    process starts, before NumPy is imported.

    The matrices here are small: one thread is fastest, and threads that wait for each other on a
    busy machine cost minutes.
    """
    for variable in BLAS:
        os.environ.setdefault(variable, "1")
