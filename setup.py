"""The compiled estimator, optional: where it cannot be built, NumPy computes the same numbers.
Everything else is in pyproject.toml.

Each precision is built once for every processor of this kind and once more for each level of vector
instructions the compiler knows: the fastest that the processor can run is taken when the kernel is
first used. SYMHELI_COMPILE=0 does not build.
"""

import hashlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

FOLDER = "identification/recursive/kernel"
SOURCES = [f"{FOLDER}/{name}" for name in ("rls.h", "rls.c", "python.c")]
DIGEST = hashlib.sha256(
    b"".join((Path(__file__).parent / source).read_bytes() for source in SOURCES)
)
LEVELS = {
    "": [],
    "_avx2": ["-mavx2"],
    "_avx512": ["-mavx512f", "-mavx512bw", "-mavx512dq", "-mavx512vl"],
}
"""Compiler flags by ending of the module's name; processor.c says which a processor can run."""


def kernel(precision, level):
    """One precision (double, single) for one of `LEVELS`."""
    module = f"_{precision}{level}"
    return Extension(
        f"identification.recursive.kernel.{module}",
        [f"{FOLDER}/{precision}_precision.c"],
        depends=SOURCES,
        define_macros=[("RLS_MODULE", module), ("RLS_SOURCE", f'"{DIGEST.hexdigest()}"')],
        extra_compile_args=list(LEVELS[level]),
        py_limited_api=True,
        optional=True,
    )


PROCESSOR = Extension(
    "identification.recursive.kernel._processor",
    [f"{FOLDER}/processor.c"],
    py_limited_api=True,
    optional=True,
)
KERNELS = [kernel(precision, level) for precision in ("double", "single") for level in LEVELS]


class BuildKernel(build_ext):
    """Optimised, in IEEE arithmetic without contraction, for the levels the compiler knows.

    Python's own -fwrapv keeps a compiler from seeing how far a loop runs: without it an update
    takes a quarter to a third less.
    """

    def build_extensions(self):
        """Leave out the levels this compiler does not know, add the flags it takes, then build."""
        if self.compiler.compiler_type == "msvc":
            self.extensions = [
                extension for extension in self.extensions if not extension.extra_compile_args
            ]
        else:
            self.extensions = [
                extension
                for extension in self.extensions
                if self._accepts(extension.extra_compile_args)
            ]
            for extension in self.extensions:
                extension.extra_compile_args += ["-O3", "-g0", "-ffp-contract=off"]
                extension.extra_compile_args += (
                    ["-fno-wrapv"] if self._accepts(["-fno-wrapv"]) else []
                )
        super().build_extensions()

    def build_extension(self, extension):
        """Each in a folder of its own: all levels come from one source."""
        folder, self.build_temp = self.build_temp, os.path.join(self.build_temp, extension.name)
        try:
            super().build_extension(extension)
        finally:
            self.build_temp = folder

    def _accepts(self, flags):
        with tempfile.TemporaryDirectory() as folder:
            source = Path(folder) / "empty.c"
            source.write_text("int nothing;\n")
            command = [
                *self.compiler.compiler,
                *flags,
                "-c",
                str(source),
                "-o",
                str(source.with_suffix(".o")),
            ]
            try:
                return subprocess.run(command, capture_output=True, timeout=60).returncode == 0
            except (OSError, subprocess.SubprocessError):
                return False


setup(
    ext_modules=(
        []
        if os.environ.get("SYMHELI_COMPILE") == "0" or sys.implementation.name != "cpython"
        else [PROCESSOR, *KERNELS]
    ),
    cmdclass={"build_ext": BuildKernel},
    options={"bdist_wheel": {"py_limited_api": "cp311"}},
)
