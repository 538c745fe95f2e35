"""The hand-written C compiled at -O3 -march=native and called through ctypes."""

import ctypes
import subprocess
import tempfile
from pathlib import Path

import numpy as np

FLAGS = ("-std=c99", "-O3", "-march=native", "-Wall", "-Wextra", "-fPIC", "-shared")
_ARRAY = np.ctypeslib.ndpointer(float, flags="C_CONTIGUOUS")


class CFlight:
    """`flight.c`, built with `compiler`."""

    def __init__(self, compiler: str):
        source = Path(__file__).with_name("flight.c")
        with tempfile.TemporaryDirectory() as folder:
            library = Path(folder) / "flight.so"
            subprocess.run([compiler, *FLAGS, str(source), "-o", str(library), "-lm"], check=True)
            code = ctypes.CDLL(str(library))
        self._rates, self._fly = code.rates, code.fly
        self._rates.argtypes, self._rates.restype = [_ARRAY] * 4, None
        self._fly.argtypes, self._fly.restype = (
            [ctypes.c_int, ctypes.c_int, ctypes.c_double, _ARRAY, _ARRAY, _ARRAY],
            None,
        )

    def rates(self, x: np.ndarray, u: np.ndarray, wind: np.ndarray) -> np.ndarray:
        """Derivatives (15,)."""
        out = np.empty(15)
        self._rates(x, u, wind, out)
        return out

    def fly(
        self, x0: np.ndarray, inputs: np.ndarray, wind: np.ndarray, dt: float, steps: int
    ) -> np.ndarray:
        """States (n + 1, 15) under inputs (n, 4) held for `dt` s each, by `steps` classical
        Runge-Kutta steps an input.
        """
        states = np.empty((len(inputs) + 1, 15))
        states[0] = x0
        self._fly(len(inputs), steps, dt, inputs, wind, states)
        return states
