"""The recursive estimator's arithmetic: rls.c compiled, or its NumPy twin."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib
import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from identification.recursive.kernel import twin
from identification.recursive.kernel.configuration import KernelConfiguration
from symheli.errors import CompilerWarning

SOURCES = ("rls.h", "rls.c", "python.c")
"""Source files of the compiled kernel, in this folder; an autopilot needs only the first two."""


def kernel(configuration: KernelConfiguration) -> Any:
    """The compiled kernel, or, with one `CompilerWarning`, the NumPy one: the same numbers,
    slowly.
    """
    compiled = compiled_kernel("single" if configuration.dtype is np.float32 else "double")
    return twin.Kernel(configuration) if compiled is None else compiled(*configuration.arguments)


@functools.cache
def compiled_kernel(precision: str) -> Any | None:
    """Return the class in the compiled module; None, with a warning that gives the reason, where
    none is available.
    """
    if os.environ.get("SYMHELI_COMPILE") == "0":
        return _without("SYMHELI_COMPILE=0")
    kernels = compiled_kernels(precision)
    if not kernels:
        return _without(
            "the estimator is not compiled; with a C compiler there, install symheli again"
        )
    module = next(iter(kernels.values()))
    if module.SOURCE != source_digest():
        return _without("the compiled estimator is older than its source; install symheli again")
    return module.Kernel


def compiled_kernels(precision: str) -> dict[str, Any]:
    """Return {level: compiled module} of the modules built here that run on this processor, the
    fastest first; all give the same bits.
    """
    kernels: dict[str, Any] = {}
    for level in processor_levels():
        ending = "" if level == "baseline" else f"_{level}"
        with contextlib.suppress(ImportError):
            kernels[level] = importlib.import_module(
                f"identification.recursive.kernel._{precision}{ending}"
            )
    return kernels


def processor_levels() -> tuple[str, ...]:
    """Levels of vector instructions that processor and operating system can run, the fastest first;
    "baseline" runs everywhere.
    """
    try:
        return importlib.import_module("identification.recursive.kernel._processor").levels()
    except ImportError:
        return ("baseline",)


def source_digest() -> str:
    """Identifies the sources beside this file."""
    return hashlib.sha256(
        b"".join((Path(__file__).parent / name).read_bytes() for name in SOURCES)
    ).hexdigest()


@functools.cache
def _without(reason: str) -> None:
    warnings.warn(
        f"{reason}: recursive estimates run in NumPy, about a hundred times slower, same numbers",
        CompilerWarning,
        stacklevel=6,
    )
