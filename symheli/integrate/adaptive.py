"""Pairs of explicit Runge-Kutta methods, orders 5 and 4, with proportional-integral control of the
step, which ends where the equations change their form.
"""

from __future__ import annotations

import ctypes
import functools
import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from symheli.errors import InputError, SymheliError
from symheli.integrate.equations import Equations
from symheli.integrate.kernel import structure
from symheli.integrate.problem import Problem
from symheli.integrate.tableau import CASH_KARP, DORMAND_PRINCE, EmbeddedTableau
from symheli.values.arrays import Array

SCALE = {"m/s": 1.0, "rad/s": 1.0, "1": 0.1, "m": 1.0, "rad": 0.1}
"""Typical size of a state by its unit; `absolute` is a fraction of it."""
SWITCH_TOLERANCE = 0.01
"""Accuracy of the location of a switch, as a fraction of the step. The remaining error of the
switch is the square of that.
"""


@dataclass(frozen=True)
class Adaptive:
    """Steps of order 5 whose estimated error stays below a tolerance: `DormandPrince` and
    `CashKarp`, which see.
    """

    relative: float = 1e-8
    absolute: float = 1e-8
    largest: float = math.inf
    most: int = 1_000_000

    tableau: ClassVar[EmbeddedTableau]

    def __post_init__(self) -> None:
        for name in ("relative", "absolute", "largest", "most"):
            if not getattr(self, name) > 0:
                raise InputError(f"{name} must be positive, got {getattr(self, name)}")


class DormandPrince(Adaptive):
    """Adaptive Runge-Kutta method of order 5 with an error tolerance, seven evaluations a step.

    A step ends where a sample does, for inputs and wind jump there, and where a switching function
    of a part is zero (a fin begins to stall, the wake reaches the tail), for the derivative of the
    equations jumps there: elsewhere they are smooth, and one step does for a sample of 20 ms. The
    quaternion is brought back to unit length after each step.

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
    >>> exact = symheli.integrate.DormandPrince(relative=1e-10, absolute=1e-10)
    >>> flown = symheli.simulate(heli, point, inputs, dt=0.02, method=exact)
    >>> bool(np.abs(flown["q"]).max() < 1e-6)
    True
    """

    tableau = DORMAND_PRINCE


class CashKarp(Adaptive):
    """Adaptive Runge-Kutta method of order 5 like `DormandPrince`, with six evaluations a step;
    preferable for inputs that are held for about 20 ms, where the last evaluation of
    `DormandPrince` cannot be reused.

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
    Cash and Karp (1990), A variable order Runge-Kutta method for initial value problems with
    rapidly varying right-hand sides, ACM Transactions on Mathematical Software 16.

    Examples
    --------
    >>> point = symheli.trim(heli, airspeed=5.0)
    >>> inputs = np.tile(point.u.array, (10, 1))
    >>> quick = symheli.integrate.CashKarp(relative=1e-6, absolute=1e-6)
    >>> flown = symheli.simulate(heli, point, inputs, dt=0.02, method=quick)
    >>> len(flown.steps), flown.evaluations
    (10, 60)
    """

    tableau = CASH_KARP


def fly(
    equations: Equations, problem: Problem, method: Adaptive
) -> tuple[Array, Array, Array, int]:
    """States (n+1, nx), steps taken (m,) in s, their number in each sample (n,), and how often the
    right-hand side was evaluated.
    """
    n = problem.samples
    atol = np.array([method.absolute * SCALE[s.unit] for s in equations.states])
    switches = len(equations.hoisted("switched_rates")[1].outputs[1])
    head = _head(method.tableau, switches)
    library = equations.machine_code("adaptive.c", ("switched_rates",), head=head)
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


def _gave_up(sample: int, dt: float, method: Adaptive) -> SymheliError:
    return SymheliError(
        f"the steps became too small or too many (most={method.most}) near {sample * dt:.6g} s: "
        'the flight is lost there, or the equations are stiff (try "radau")'
    )


@functools.cache
def _head(pair: EmbeddedTableau, switches: int) -> str:
    """The tableau as C, and the number of switching functions."""

    def values(row: Array) -> str:
        return "{" + ", ".join(map(repr, row.tolist())) + "}"

    stages = pair.stages
    rows = ", ".join(map(values, pair.a))
    return (
        f"#define STAGES {stages}\n#define AT_END {pair.at_end}\n#define SWITCHES {switches}\n"
        f"#define NEAR {SWITCH_TOLERANCE!r}\n"
        f"static const double A[{stages}][{stages}] = {{{rows}}},"
        f" B[{stages}] = {values(pair.b)}, E[{stages}] = {values(pair.error)};\n"
    )


def _first_switch(before: Array, after: Array) -> float:
    """The twin of `first_switch` in adaptive.c."""
    with np.errstate(all="ignore"):
        share = before / (before - after)
        share = share[
            (before * after < 0) & (share > SWITCH_TOLERANCE) & (share < 1 - SWITCH_TOLERANCE)
        ]
    return min(share.tolist(), default=1.0)


def _in_python(
    equations: Equations, problem: Problem, method: Adaptive, atol: Array
) -> tuple[Array, Array, Array, int]:
    """As adaptive.c, operation by operation."""
    rates = equations.virtual_machine("switched_rates")
    pair = method.tableau
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
            evaluations += pair.stages - bool(start)
            start = start or rates(x, u, wind, p)
            stages = [start]
            k = [start[0]]
            for row in pair.a[1:]:
                stages.append(rates(x + h * weighted(row, k), u, wind, p))
                k.append(stages[-1][0])
            end, after = x + h * weighted(pair.b, k), stages[pair.at_end][1]
            scaled = (
                h
                * weighted(pair.error, k)
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
