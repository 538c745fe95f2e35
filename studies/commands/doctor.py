"""symheli doctor: what is installed, and what it means for the work."""

from __future__ import annotations

import argparse
import os
import platform
import tempfile
import warnings
from importlib.metadata import PackageNotFoundError, version

from studies.output import Output, columns

HELP = "versions, C compiler, solvers, cache: what works on this computer"

REQUIRED = (
    "casadi",
    "sympy",
    "mpmath",
    "numpy",
    "scipy",
    "control",
    "cvxpy",
    "clarabel",
    "threadpoolctl",
    "matplotlib",
    "jinja2",
    "markupsafe",
    "pillow",
    "rich",
)
OPTIONAL = {
    "pandas": "records from and to data frames",
    "xarray": "labelled arrays of families and campaigns",
    "pyulog": "reading PX4 logs",
    "pymavlink": "reading ArduPilot logs",
    "h5py": "reading MATLAB 7.3 files",
    "distributed": "campaigns on all cores and on clusters",
    "zarr": "datasets of campaigns",
    "shtab": "completion in a shell: symheli completion bash|zsh|tcsh",
    "ipywidgets": "sliders in notebooks",
    "python-flint": "balls over frequency and the stand-alone checker, in less time",
    "nicegui": "pages in a browser: symheli live --page, symheli synthesize --page",
    "scs": "a second solver to cross-check",
    "jsbsim": "flying the AH-1S, a helicopter from elsewhere",
}

ARGUMENTS = ()


def run(arguments: argparse.Namespace) -> Output:
    """Check the installation; exit with 1 where something required is missing."""
    from identification.recursive.kernel import compiled_kernel, compiled_kernels
    from symheli.codegen.compile import cache_directory, compiler
    from synthesis.analysis import installed_solvers

    required, optional = {n: _version(n) for n in REQUIRED}, {n: _version(n) for n in OPTIONAL}
    cc, cache, problem = compiler(), cache_directory(), _unwritable(str(cache_directory()))
    solvers = installed_solvers()
    rows = [
        ["python", platform.python_version(), ""],
        *([n, v or "MISSING", "required"] for n, v in required.items()),
    ]
    rows += [[n, v or "not installed", OPTIONAL[n]] for n, v in optional.items()]
    slower = (
        "models run in the CasADi virtual machine, several times slower, same numbers to rounding"
    )
    works = bool(cc) and _compiles()
    if works:
        compiling = f"C compiler: {cc}; models run as machine code"
    elif cc:
        compiling = f"C compiler: {cc} does NOT compile; {slower} (set CC to another)"
    elif os.environ.get("SYMHELI_COMPILE") == "0":
        compiling = f"C compiler: switched off by SYMHELI_COMPILE=0; {slower}"
    else:
        compiling = f"C compiler: none found; {slower} (install gcc or set CC)"
    level = next(iter(compiled_kernels("double"))) if compiled_kernel("double") else None
    lines = (
        f"machine code, level {level}"
        if level
        else (
            "NumPy, the same numbers, many times slower (reinstall with a C compiler: pip install"
            " -e .)"
        )
    )
    text = "\n".join(
        (
            columns(rows, left=3),
            compiling,
            f"recursive estimator: {lines}",
            f"solvers for matrix inequalities: {', '.join(solvers) or 'NONE'}; LYAPUNOV, of this"
            " package",
            f"cache of compiled models: {cache} ({problem or 'writable'})",
        )
    )
    missing = [n for n, v in required.items() if v is None]
    data = {
        "python": platform.python_version(),
        "required": required,
        "optional": optional,
        "compiler": cc if works else None,
        "compiled_estimator": level is not None,
        "estimator_level": level,
        "solvers": solvers,
        "cache": str(cache),
        "cache_writable": not problem,
        "missing": missing,
    }
    return Output(text, data, status=1 if missing or not solvers else 0)


def _compiles() -> bool:
    """Whether the compiler makes a library of one function."""
    from symheli.codegen.compile import library

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return library("int symheli_doctor(void) { return 0; }\n", "doctor") is not None


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _unwritable(folder: str) -> str:
    try:
        os.makedirs(folder, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder):
            return ""
    except OSError as error:
        return (
            f"NOT writable, models run uncompiled: {error.strerror}; set SYMHELI_CACHE to a folder"
            " that is"
        )
