"""The compiled estimator, optional: where it cannot be built, NumPy computes the same numbers. Everything else is in pyproject.toml.

SYMHELI_NATIVE=0 builds for every processor of this kind instead of this one; SYMHELI_COMPILE=0 does not build.
"""

import hashlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

FOLDER = "identification/kernel"
SOURCES = [f"{FOLDER}/{name}" for name in ("rls.h", "rls.c", "python.c")]
DIGEST = hashlib.sha256(b"".join((Path(__file__).parent / source).read_bytes() for source in SOURCES))
KERNELS = [
    Extension(
        f"identification.kernel._{precision}",
        [f"{FOLDER}/{precision}_precision.c"],
        depends=SOURCES,
        define_macros=[("RLS_SOURCE", f'"{DIGEST.hexdigest()}"')],
        py_limited_api=True,
        optional=True,
    )
    for precision in ("double", "single")
]


class BuildKernel(build_ext):
    """Optimised, in IEEE arithmetic without contraction, for this processor where the compiler knows it.

    Python's own -fwrapv keeps a compiler from seeing how far a loop runs: without it an update takes a quarter to a third less.
    """

    def build_extensions(self):
        """Add the flags this compiler takes, then build."""
        if self.compiler.compiler_type != "msvc":
            native = ["-march=native"] if os.environ.get("SYMHELI_NATIVE", "1") != "0" and self._accepts("-march=native") else []
            for extension in self.extensions:
                extension.extra_compile_args = [
                    "-O3",
                    "-ffp-contract=off",
                    *native,
                    *(["-fno-wrapv"] if self._accepts("-fno-wrapv") else []),
                ]
        super().build_extensions()

    def _accepts(self, flag):
        with tempfile.TemporaryDirectory() as folder:
            source = Path(folder) / "empty.c"
            source.write_text("int nothing;\n")
            command = [*self.compiler.compiler, flag, "-c", str(source), "-o", str(source.with_suffix(".o"))]
            try:
                return subprocess.run(command, capture_output=True, timeout=60).returncode == 0
            except (OSError, subprocess.SubprocessError):
                return False


setup(
    ext_modules=[] if os.environ.get("SYMHELI_COMPILE") == "0" or sys.implementation.name != "cpython" else KERNELS,
    cmdclass={"build_ext": BuildKernel},
    options={"bdist_wheel": {"py_limited_api": "cp311"}},
)
