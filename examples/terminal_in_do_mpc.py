"""A predictive controller of do-mpc that ends in a proven terminal set.

    pip install do-mpc
    python examples/terminal_in_do_mpc.py

The optimal cost falls by the stage cost at least, sample by sample. The set is there for that.
"""

from __future__ import annotations

from typing import Any

import casadi
import do_mpc
import numpy as np
import sympy

import synthesis
from synthesis.regions import TerminalSet

DT, HORIZON = 0.1, 20


def cart(x: Any, y: Any, u: Any) -> list[Any]:
    """Return position x and speed y a sample later: a cart on a spring that pushes near x = 0."""
    return [x + DT * y, y + DT * (u - x**3 + x / 2)]


def terminal_set() -> TerminalSet:
    """Prove a terminal set of the cart, for costs 10 x^2 + y^2 + u^2 and |u| <= 1."""
    x, y, u = sympy.symbols("x y u")
    after = dict(zip((x, y), cart(x, y, u), strict=True))
    costs = np.diag([10.0, 1.0]), [[1.0]]
    return synthesis.regions.terminal(after, *costs, controls=[u], dt=DT, input_bounds={"u": 1.0})


def controller(end: TerminalSet) -> Any:
    """Return do-mpc's controller with the set as its terminal cost and constraint."""
    model = do_mpc.model.Model("discrete", "SX")
    x, y = (model.set_variable("_x", name) for name in "xy")
    u = model.set_variable("_u", "u")
    for name, after in zip("xy", cart(x, y, u), strict=True):
        model.set_rhs(name, after)
    model.setup()
    mpc = do_mpc.controller.MPC(model)
    mpc.settings.n_horizon, mpc.settings.t_step = HORIZON, DT
    mpc.settings.store_full_solution = False
    mpc.settings.supress_ipopt_output()
    state = casadi.vertcat(x, y)
    terms = end.do_mpc(state, casadi.vertcat(u))
    mpc.set_objective(mterm=terms["mterm"], lterm=terms["lterm"])
    mpc.set_rterm(u=0.0)
    mpc.bounds["lower", "_u", "u"], mpc.bounds["upper", "_u", "u"] = -1.0, 1.0
    mpc.prepare_nlp()
    inside = casadi.Function("inside", [state], [terms["terminal"]])
    mpc.nlp_cons.append(inside(mpc.opt_x["_x", HORIZON, 0, -1]))
    mpc.nlp_cons_lb.append(-np.inf * np.ones((1, 1)))
    mpc.nlp_cons_ub.append(np.zeros((1, 1)))
    mpc.create_nlp()
    return mpc


def flight(mpc: Any, start: tuple[float, float], samples: int) -> np.ndarray:
    """Return x, y, u and the optimal cost of each sample, one row each."""
    cost = casadi.Function("cost", [mpc.opt_x, mpc.opt_p], [mpc.nlp_obj])
    state, rows = np.array(start), []
    mpc.x0 = state.reshape(2, 1)
    mpc.set_initial_guess()
    for _ in range(samples):
        u = float(mpc.make_step(state.reshape(2, 1)).item())
        if not mpc.solver_stats["success"]:
            raise RuntimeError(f"do-mpc: {mpc.solver_stats['return_status']}")
        rows.append([*state, u, float(cost(mpc.opt_x_num, mpc.opt_p_num))])
        state = np.array(cart(*state, u))
    return np.array(rows)


if __name__ == "__main__":
    made = terminal_set()
    flown = flight(controller(made), (1.0, 1.0), 60)
    print(made.claim)
    for k in range(0, 60, 10):
        print(
            f"{k * DT:4.1f} s  x {flown[k, 0]:8.4f}  u {flown[k, 2]:8.4f}  cost {flown[k, 3]:9.4f}"
        )
