"""The pair of Dormand and Prince, orders 5 and 4, with proportional-integral control of the
step.
"""

from __future__ import annotations

import ctypes
import math
from dataclasses import dataclass

import numpy as np

from symheli.errors import InputError, SymheliError
from symheli.integrate.equations import Equations
from symheli.integrate.kernel import structure
from symheli.integrate.problem import Problem
from symheli.integrate.tableau import DORMAND_PRINCE, DORMAND_PRINCE_ERROR, Tableau
from symheli.values.arrays import Array

SCALE = {"m/s": 1.0, "rad/s": 1.0, "1": 0.1, "m": 1.0, "rad": 0.1}
"""Size of a state by its unit: what `absolute` is a fraction of."""
NEAR = 0.01
"""How near, as a share of the step, it ends to the place of a switch. What is left of the error
that the switch makes is the square of that.
"""


@dataclass(frozen=True)
class DormandPrince:
    """Steps of order 5 whose estimated error stays below a tolerance.

    A step ends where a sample does, for inputs and wind jump there, and where a switching function
    of a part is zero (a fin begins to stall, the wake reaches the tail), for the derivative of the
    equations jumps there: elsewhere they are smooth, and one step of order 5 does for a sample of
    20 ms. The quaternion is brought back to unit length after each step.

    Parameters
    ----------
    relative : float
        Of the value of a state.
    absolute : float
        Of the usual size of a state (`SCALE`); the two are added.
    largest : float
        Longest step, s.
    most : int
        Steps before it gives up.

    Raises
    ------
    InputError
        A number that is not positive.

    References
    ----------
    Dormand and Prince (1980), A family of embedded Runge-Kutta formulae, J. Computational and
    Applied Mathematics 6.

    Examples
    --------
    >>> point = symheli.trim(heli, airspeed=5.0)
    >>> inputs = np.tile(point.u.array, (10, 1))
    >>> exact = symheli.DormandPrince(relative=1e-10, absolute=1e-10)
    >>> flown = symheli.simulate(heli, point, inputs, dt=0.02, method=exact)
    >>> bool(np.abs(flown["q"]).max() < 1e-6)
    True
    """

    relative: float = 1e-8
    absolute: float = 1e-8
    largest: float = math.inf
    most: int = 1_000_000

    def __post_init__(self) -> None:
        for name in ("relative", "absolute", "largest", "most"):
            if not getattr(self, name) > 0:
                raise InputError(f"{name} must be positive, got {getattr(self, name)}")

    @property
    def tableau(self) -> Tableau:
        """Coefficients of order 5."""
        return DORMAND_PRINCE


def fly(
    equations: Equations, problem: Problem, method: DormandPrince
) -> tuple[Array, Array, Array, int]:
    """States (n+1, nx), steps taken (m,) in s, their number in each sample (n,), and how often the
    right-hand side was evaluated.
    """
    n = problem.samples
    atol = np.array([method.absolute * SCALE[s.unit] for s in equations.states])
    switches = len(equations.hoisted("switched_rates")[1].outputs[1])
    library = equations.machine_code("dopri.c", ("switched_rates",), head=_head(switches))
    if library is None:
        return _in_python(equations, problem, method, atol)
    states, per_sample = np.empty((n + 1, len(atol))), np.zeros(n, ctypes.c_long)
    evaluations = np.zeros(1, ctypes.c_long)
    capacity = min(method.most, max(100 * n, 10_000))
    library.fly.restype = ctypes.c_long
    while True:
        steps = np.empty(capacity)
        arguments = structure(
            {
                "x0": problem.x0[0],
                "u": problem.u[0],
                "wind": problem.wind[0],
                "wind_sample": 3 if problem.wind.shape[1] > 1 else 0,
                "p": problem.p[0],
                "atol": atol,
                "states": states,
                "steps": steps,
                "per_sample": per_sample,
                "evaluations": evaluations,
                "samples": n,
                "capacity": capacity,
                "dt": problem.dt,
                "rtol": method.relative,
                "largest": method.largest,
            }
        )
        taken = library.fly(ctypes.byref(arguments))
        if taken >= 0:
            return states, steps[:taken].copy(), per_sample.astype(int), int(evaluations[0])
        if capacity == method.most or per_sample.sum() < 0.5 * capacity:
            raise _gave_up(-1 - taken, problem.dt, method)
        capacity = min(10 * capacity, method.most)


def _gave_up(sample: int, dt: float, method: DormandPrince) -> SymheliError:
    return SymheliError(
        f"the steps became too small or too many (most={method.most}) near {sample * dt:.6g} s: "
        'the flight is lost there, or the equations are stiff (try "radau")'
    )


def _head(switches: int) -> str:
    """The tableau as C, with the end of the step as seventh stage, and the number of switching
    functions.
    """
    a = np.zeros((7, 7))
    a[:6, :6], a[6, :6] = DORMAND_PRINCE.a, DORMAND_PRINCE.b
    rows = ", ".join("{" + ", ".join(map(repr, row.tolist())) + "}" for row in a)
    return (
        f"#define STAGES 7\n#define SWITCHES {switches}\n#define NEAR {NEAR!r}\n"
        f"static const double A[7][7] = {{{rows}}}, E[7] ="
        f" {{{', '.join(map(repr, DORMAND_PRINCE_ERROR.tolist()))}}};\n"
    )


def _first_switch(before: Array, after: Array) -> float:
    """As `first_switch` in dopri.c."""
    with np.errstate(all="ignore"):
        share = before / (before - after)
        share = share[(before * after < 0) & (share > NEAR) & (share < 1 - NEAR)]
    return min(share.tolist(), default=1.0)


def _in_python(
    equations: Equations, problem: Problem, method: DormandPrince, atol: Array
) -> tuple[Array, Array, Array, int]:
    """As dopri.c, operation by operation."""
    rates = equations.virtual_machine("switched_rates")
    rows = [*DORMAND_PRINCE.a, DORMAND_PRINCE.b]
    x, states, steps, per_sample = (
        problem.x0[0],
        [problem.x0[0]],
        [],
        np.zeros(problem.samples, int),
    )
    longest, previous, p, evaluations = min(problem.dt, method.largest), 1e-4, problem.p[0], 0
    wanted = longest

    def weighted(weights: Array, k: list[Array]) -> Array:
        total = np.zeros_like(x)
        for w, slope in zip(weights, k, strict=False):
            total = total + w * slope
        return total

    for sample in range(problem.samples):
        u, wind = problem.u[0, sample], problem.wind[0, min(sample, problem.wind.shape[1] - 1)]
        left, cut, rejected, first = problem.dt, math.inf, False, len(steps)
        start: list[Array] = []
        while left > 0:
            count = math.ceil(left / wanted * (1 - 1e-12))
            even, last = left / count, count <= 1 and cut >= left
            h = min(even, cut)
            if len(steps) == method.most or not h >= 1e-12 * problem.dt:
                raise _gave_up(sample, problem.dt, method)
            evaluations += 6 if start else 7
            start = start or rates(x, u, wind, p)
            k, end, after = [start[0]], x, start[1]
            for row in rows[1:]:
                end = x + h * weighted(row, k)
                slope, after = rates(end, u, wind, p)
                k.append(slope)
            scaled = (
                h
                * weighted(DORMAND_PRINCE_ERROR, k)
                / (atol + method.relative * np.maximum(np.abs(x), np.abs(end)))
            )
            error = math.sqrt(sum((scaled * scaled).tolist()) / len(x))
            if (share := _first_switch(start[1], after)) < 1:
                cut = h * share
                continue
            if not error <= 1:
                wanted = h * max(0.9 * math.pow(error, -0.17) if error < 1e300 else 0.1, 0.2)
                rejected = True
                continue
            grow = min(
                max(0.9 * math.pow(max(error, 1e-10), -0.17) * math.pow(previous, 0.04), 0.2), 5.0
            )
            grow = min(grow, 1.0) if rejected else grow
            previous, rejected = max(error, 1e-4), False
            if not (last or h < even) or wanted < h * grow:
                wanted = h * grow
            wanted = min(wanted, longest)
            end = end.copy()
            end[6:10] *= 1.0 / math.sqrt(
                end[6] * end[6] + end[7] * end[7] + end[8] * end[8] + end[9] * end[9]
            )
            x, left, cut, start = end, 0.0 if last else left - h, math.inf, []
            steps.append(h)
        per_sample[sample] = len(steps) - first
        states.append(x)
    return np.array(states), np.array(steps), per_sample, evaluations
