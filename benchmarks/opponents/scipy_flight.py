"""The hand-written equations in Python, integrated by scipy.integrate.solve_ivp."""

from collections.abc import Callable, Iterable

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.opponents.equations import build

derivatives = build().quaternion


def fly(
    x0: np.ndarray,
    inputs: np.ndarray,
    wind: np.ndarray,
    dt: float,
    rtol: float,
    unpack: Callable[[np.ndarray], Iterable] = np.ndarray.tolist,
) -> np.ndarray:
    """States (n + 1, 15) under inputs (n, 4) held for `dt` s each; the integrator starts afresh
    where the input jumps.

    `unpack` takes the state array apart: to Python floats, the fastest, or with `iter` to NumPy's,
    as it is mostly written.
    """
    states = np.empty((len(inputs) + 1, 15))
    states[0] = x0
    air = wind.tolist()
    for k, row in enumerate(inputs.tolist()):

        def rates(t, x, held=(*row, *air)):
            return derivatives(*unpack(x), *held)

        x = solve_ivp(rates, (0.0, dt), states[k], rtol=rtol, atol=rtol, first_step=dt).y[:, -1]
        x[6:10] /= np.linalg.norm(x[6:10])
        states[k + 1] = x
    return states
