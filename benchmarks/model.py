"""One right-hand side and one flight step of the X-Cell: compiled, in the CasADi virtual machine, and the same component functions on NumPy."""

from __future__ import annotations

import numpy as np
from timing import arguments, medians, show

import symheli
from symheli import inflow
from symheli.integrate import runge_kutta
from symheli.numeric import Numeric

CALLS = 200


def main() -> None:
    options = arguments(__doc__)
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    point = symheli.trim(heli, 7.0)
    x, u, wind = point.x.array, point.u.array, np.zeros(3)
    fast, machine = heli.numeric("rhs"), Numeric(heli.rhs)

    def plain() -> np.ndarray:
        """What a user writes first: the component functions called with floats."""
        values, _ = heli._accelerations(  # the same equations, no CasADi
            list(x), tuple(x[:3]), symheli.rigid_body.gravity_euler(x[6], x[7]), {"a1": x[8], "b1": x[9]}, list(u), inflow.solve
        )[:2]
        return np.array(values, float)

    import symheli.rigid_body

    np.testing.assert_allclose(plain(), fast(x, u, wind)[0][:6], atol=1e-9)
    flight = np.concatenate([x[:6], [1.0, 0, 0, 0], np.zeros(3), x[8:]])
    step = Numeric(runge_kutta(heli, 0.02, 4))

    def repeated(call):
        return lambda: [call() for _ in range(CALLS)]

    times = medians(
        {
            "right-hand side, compiled": repeated(lambda: fast(x, u, wind)),
            "right-hand side, CasADi virtual machine": repeated(lambda: machine(x, u, wind)),
            "right-hand side, NumPy": plain,
            "20 ms of flight (4 Runge-Kutta steps), compiled": repeated(lambda: step(flight, u, wind)),
        },
        1.0 if options.quick else 5.0,
    )
    times = {name: t if name.endswith("NumPy") else t / CALLS for name, t in times.items()}
    base = times["right-hand side, compiled"]
    ratios = {
        "compiled against virtual machine": times["right-hand side, CasADi virtual machine"] / base,
        "compiled against NumPy": times["right-hand side, NumPy"] / base,
    }
    show(options, times, ratios)


if __name__ == "__main__":
    main()
