"""One control interval as a CasADi function, for loops that decide something at every sample."""

from __future__ import annotations

import casadi

from symheli.codegen.compile import compiled
from symheli.errors import InputError
from symheli.helicopter import Helicopter


def runge_kutta(heli: Helicopter, dt: float, steps: int) -> casadi.Function:
    """Return the function (x, u, wind) -> x after `dt` seconds with u and wind held, by `steps`
    classical Runge-Kutta steps (order 4).

    x is the quaternion form (`heli.flight_states`); wind in earth axes. The quaternion is brought
    back to unit length after each step; its drift there is of the order of the integration error.
    """
    if not dt > 0 or steps < 1:
        raise InputError(f"expected dt > 0 s and at least one step, got dt={dt}, steps={steps}")
    f, h = heli.flight_rhs, dt / steps
    x, u, wind = (
        casadi.MX.sym("x", len(heli.flight_states)),
        casadi.MX.sym("u", 4),
        casadi.MX.sym("wind", 3),
    )
    k1 = f(x, u, wind)
    k2 = f(x + h / 2 * k1, u, wind)
    k3 = f(x + h / 2 * k2, u, wind)
    k4 = f(x + h * k3, u, wind)
    end = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    quaternion = end[6:10]
    end = casadi.vertcat(end[:6], quaternion / casadi.norm_2(quaternion), end[10:])
    step = casadi.Function("rk4_step", [x, u, wind], [end], ["x", "u", "wind"], ["x_next"])
    if steps > 1:
        # one step after the other with the same input: a loop in the generated code
        chain = step.mapaccum("chain", steps, ["x"], ["x_next"])
        ends = chain(x, casadi.repmat(u, 1, steps), casadi.repmat(wind, 1, steps))
        step = casadi.Function(
            "rk4_flight", [x, u, wind], [ends[:, -1]], ["x", "u", "wind"], ["x_next"]
        )
    return compiled(step)
