"""Radau IIA collocation for stiff equations, by CasADi's integrator."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np

from symheli.codegen.numeric import Numeric
from symheli.errors import InputError, SymheliError
from symheli.integrate.equations import Equations
from symheli.integrate.problem import Problem
from symheli.values.arrays import Array


@dataclass(frozen=True)
class Radau:
    """Implicit Radau collocation method with equal steps, stable for stiff equations.

    The quaternion is brought back to unit length after each sample.

    Parameters
    ----------
    step : float
        At most, s.
    stages : int
        Of order 2 stages - 1.

    Raises
    ------
    InputError
        A step that is not positive, or a number of stages that is not offered.

    References
    ----------
    Hairer and Wanner (1996), Solving Ordinary Differential Equations II, IV.5 and IV.8.

    Examples
    --------
    >>> point = symheli.trim(heli, airspeed=5.0)
    >>> inputs = np.tile(point.u.array, (5, 1))
    >>> method = symheli.integrate.Radau(step=0.02)
    >>> flown = symheli.simulate(heli, point, inputs, dt=0.02, method=method)
    >>> bool(np.abs(flown["q"]).max() < 1e-6)
    True
    """

    step: float = 0.01
    stages: int = 3

    def __post_init__(self) -> None:
        if not self.step > 0:
            raise InputError(f"step must be a positive number of seconds, got {self.step}")
        if not 1 <= self.stages <= 9:
            raise InputError(f"stages must be 1 to 9, got {self.stages}")


def sample_function(equations: Equations, dt: float, method: Radau) -> casadi.Function:
    """(x, u, wind, p) -> x after one sample of `dt` seconds; CasADi differentiates it through the
    implicit function theorem.
    """
    rates = equations.function
    x, u, wind, p = (casadi.MX.sym(f"z{i}", rates.size1_in(i)) for i in range(4))
    held = casadi.vertcat(u, wind, p)
    steps = max(int(np.ceil(dt / method.step - 1e-9)), 1)
    options = {
        "number_of_finite_elements": steps,
        "interpolation_order": method.stages,
        "collocation_scheme": "radau",
        "rootfinder": "newton",
        "rootfinder_options": {"abstol": 1e-12, "error_on_fail": False},
    }
    integrator = casadi.integrator(
        "radau", "collocation", {"x": x, "p": held, "ode": rates(x, u, wind, p)}, 0.0, dt, options
    )
    end = integrator(x0=x, p=held)["xf"]
    quaternion = end[6:10]
    end = casadi.vertcat(end[:6], quaternion / casadi.norm_2(quaternion), end[10:])
    return casadi.Function(
        "radau_sample", [x, u, wind, p], [casadi.densify(end)], ["x", "u", "wind", "p"], ["x_next"]
    )


def fly(equations: Equations, problem: Problem, method: Radau) -> Array:
    """States (n+1, nx)."""
    sample, states = Numeric(sample_function(equations, problem.dt, method)), [problem.x0[0]]
    for k in range(problem.samples):
        states.append(
            sample(
                states[-1],
                problem.u[0, k],
                problem.wind[0, min(k, problem.wind.shape[1] - 1)],
                problem.p[0],
            )[0]
        )
        if not np.isfinite(states[-1]).all():
            raise SymheliError(
                f"the implicit equations were not solved near {k * problem.dt:.6g} s: the flight is"
                " lost there"
            )
    return np.array(states)
