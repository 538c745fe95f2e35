"""One right-hand side of the X-Cell: compiled, in the CasADi virtual machine, and the same component functions on floats."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path[0] = str(Path(__file__).resolve().parents[1])  # this folder holds scripts named like the packages they measure

import symheli  # noqa: E402
from benchmarks.timing import arguments, medians, show  # noqa: E402
from symheli.integrate import runge_kutta  # noqa: E402
from symheli.numeric import Numeric  # noqa: E402

CALLS = 200


def main() -> None:
    options = arguments(__doc__)
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    point = symheli.trim(heli, 7.0)
    x, u, wind = point.x.array, point.u.array, np.zeros(3)
    fast, machine = heli.numeric("rhs"), Numeric(heli.rhs)

    def plain() -> np.ndarray:
        """What a user writes first: the component functions called with floats."""
        return np.array(heli.dynamics.accelerations(list(x), list(u), wind, heli.parameters.array.tolist())[:6], float)  # no CasADi

    np.testing.assert_allclose(plain(), fast(x, u, wind)[0][:6], atol=1e-9)
    flight = np.concatenate([x[:6], [1.0, 0, 0, 0], np.zeros(3), x[8:]])
    step = Numeric(runge_kutta(heli, 0.02, 4))

    def repeated(call):
        return lambda: [call() for _ in range(CALLS)]

    times = medians(
        {
            "right-hand side, compiled": repeated(lambda: fast(x, u, wind)),
            "right-hand side, CasADi virtual machine": repeated(lambda: machine(x, u, wind)),
            "right-hand side, plain Python and NumPy": plain,
            "20 ms of flight (4 Runge-Kutta steps), compiled": repeated(lambda: step(flight, u, wind)),
        },
        1.0 if options.quick else 5.0,
    )
    times = {name: t if name.endswith("NumPy") else t / CALLS for name, t in times.items()}
    base = times["right-hand side, compiled"]
    ratios = {
        "compiled against virtual machine": times["right-hand side, CasADi virtual machine"] / base,
        "compiled against NumPy": times["right-hand side, plain Python and NumPy"] / base,
    }
    show(options, times, ratios)


if __name__ == "__main__":
    main()
