"""Threads of the processes that start here."""

from __future__ import annotations

import os

from symheli.threads import BLAS


def one_thread() -> None:
    """Ask for one thread of BLAS where the environment does not say how many; to be called where a
    process starts, before NumPy is imported.
    """
    for variable in BLAS:
        os.environ.setdefault(variable, "1")
