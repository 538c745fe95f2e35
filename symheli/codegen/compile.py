"""Compilation of CasADi functions and C source to machine code, if a C compiler is installed,
cached by content.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
import platform
import shutil
import signal
import subprocess
import tempfile
import warnings
from pathlib import Path

import casadi

from symheli.errors import CompilerWarning

FLAGS = (
    "-O3",
    "-march=native",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-tree-slp-vectorize",
    "-fPIC",
    "-shared",
)
"""Flags given to the compiler; none changes a number: nothing is fused but what the source fuses,
only errno and exception flags are given up. Pairs of scalars are not packed into vectors:
one flight takes 1.3 times as long with that.
"""

LONGEST = 300.0
"""Seconds after which a compilation is given up."""


def cache_directory() -> Path:
    """Return the directory of compiled functions: $SYMHELI_CACHE, else symheli in $XDG_CACHE_HOME
    or ~/.cache.
    """
    given = os.environ.get("SYMHELI_CACHE")
    return (
        Path(given)
        if given
        else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "symheli"
    )


@functools.cache
def compiler() -> str | None:
    """Path of the C compiler ($CC, else cc, gcc or clang), None where there is none or
    SYMHELI_COMPILE=0.
    """
    if os.environ.get("SYMHELI_COMPILE") == "0":
        return None
    for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
        if name and (path := shutil.which(name)):
            return path
    return None


@functools.cache
def _warn_once(reason: str) -> None:
    warnings.warn(reason, CompilerWarning, stacklevel=5)


def _not_compiled(reason: str) -> None:
    _warn_once(
        f"{reason}: CasADi's virtual machine and NumPy are used, several times slower, with the"
        " same numbers to rounding"
    )


def compiled(function: casadi.Function) -> casadi.Function:
    """Return the same function as machine code, or unchanged (with one `CompilerWarning`) where
    that is not possible.
    """
    generator = casadi.CodeGenerator("symheli_code.c")
    generator.add(function)
    path = library(generator.dump(), function.name())
    if path is None:
        return function
    try:
        return casadi.external(function.name(), str(path))
    except RuntimeError as error:
        _not_compiled(f"loading the compiled {function.name()} failed ({str(error).strip()})")
        return function


def library(source: str, name: str) -> Path | None:
    """C source as a shared library, or None (with one `CompilerWarning`) where that is not
    possible.

    It is kept in `cache_directory()` under a hash of source, compiler, flags and processor, and
    written under a temporary name first: no half-written library is ever loaded.
    """
    cc = compiler()
    if cc is None:
        _not_compiled(
            "no C compiler is used (install gcc or clang, or set CC)"
            if os.environ.get("SYMHELI_COMPILE") != "0"
            else "SYMHELI_COMPILE=0"
        )
        return None
    key = hashlib.sha256(
        "\n".join((source, cc, *FLAGS, platform.processor(), platform.machine(), _cpu())).encode()
    ).hexdigest()[:32]
    kept = cache_directory() / f"{name}-{key}.so"
    try:
        if not kept.is_file():
            kept.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(prefix="symheli-") as scratch:
                code, built = Path(scratch) / "code.c", Path(scratch) / "code.so"
                code.write_text(source)
                _run([cc, *FLAGS, str(code), "-o", str(built), "-lm"])
                with tempfile.NamedTemporaryFile(dir=kept.parent, delete=False) as target:
                    target.write(built.read_bytes())
            os.replace(target.name, kept)
        return kept
    except (OSError, subprocess.SubprocessError) as error:
        detail = (
            error.stderr.decode(errors="replace")[-300:]
            if isinstance(error, subprocess.CalledProcessError)
            else str(error)
        )
        _not_compiled(f"compiling {name} failed ({detail.strip()})")
        return None


def _run(command: list[str]) -> None:
    """Run the compiler; where it takes too long, or is interrupted, end what it has started too.

    Raises `CalledProcessError` with what it said where it fails, `TimeoutExpired` after `LONGEST`.
    """
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True
    ) as made:
        try:
            _, said = made.communicate(timeout=LONGEST)
        except BaseException:
            os.killpg(made.pid, signal.SIGKILL)
            raise
    if made.returncode:
        raise subprocess.CalledProcessError(made.returncode, command, stderr=said)


def loaded(path: Path) -> ctypes.CDLL:
    """A library that begins with `Layout.prelude`, with one `CompilerWarning` where this processor
    has no fused multiply-add.
    """
    code = ctypes.CDLL(str(path))
    if not code.has_fma():
        _warn_once(
            "this processor, or the compiler for it, has no fused multiply-add: flights are a"
            " little slower, with the same numbers to rounding"
        )
    return code


@functools.cache
def _cpu() -> str:
    """Return model and features of this processor: -march=native code is not portable."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        command = [
            compiler() or "",
            "-march=native",
            "-dM",
            "-E",
            "-x",
            "c",
            os.devnull,
        ]  # what native means here, as macros
        return (
            platform.platform()
            + subprocess.run(command, capture_output=True, text=True, timeout=60).stdout
        )
    telling = ("model name", "flags", "Features", "CPU implementer", "CPU part")
    return "\n".join(sorted({line for line in lines if line.startswith(telling)}))
