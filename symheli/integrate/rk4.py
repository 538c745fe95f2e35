"""The classical Runge-Kutta method of order 4, for one flight or many side by side."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from symheli.codegen import Layout, evaluate
from symheli.errors import InputError
from symheli.integrate.equations import Equations
from symheli.integrate.feedback import Feedback
from symheli.integrate.kernel import structure
from symheli.integrate.problem import Problem
from symheli.integrate.tableau import CLASSICAL, Tableau
from symheli.values.arrays import Array


@dataclass(frozen=True)
class RungeKutta4:
    """Classical Runge-Kutta method of order 4 with equal steps that divide dt; the quaternion is
    normalised after each step.

    Parameters
    ----------
    step : float
        At most, s.

    Raises
    ------
    InputError
        A step that is not positive.

    References
    ----------
    Hairer, Norsett and Wanner (1993), Solving Ordinary Differential Equations I, II.1.

    Examples
    --------
    >>> point = symheli.trim(heli, airspeed=5.0)
    >>> inputs = np.tile(point.u.array, (10, 1))
    >>> method = symheli.integrate.RungeKutta4(0.002)
    >>> flown = symheli.simulate(heli, point, inputs, dt=0.02, method=method)
    >>> len(flown.steps), int(flown.per_sample[0])
    (100, 10)
    """

    step: float = 0.005

    def __post_init__(self) -> None:
        if not self.step > 0:
            raise InputError(f"step must be a positive number of seconds, got {self.step}")

    @property
    def tableau(self) -> Tableau:
        """Coefficients of the method."""
        return CLASSICAL


class IntegratedFlights:
    """Flights of a problem, run in any order: states (N, kept, nx) and, under feedback, the inputs
    used (N, kept, 4).

    Every `every`-th sample is kept, the first one not where `skip_start`. The bits of a flight
    depend neither on the layout nor on its neighbours; machine code with fused multiply-adds and
    NumPy differ by rounding.
    """

    def __init__(
        self,
        equations: Equations,
        problem: Problem,
        method: RungeKutta4,
        feedback: Feedback | None,
        every: int,
        skip_start: bool,
        layout: Layout,
    ):
        self.equations, self.problem, self.feedback = equations, problem, feedback
        self.every, self.skip_start = every, int(skip_start)
        self.substeps, self.step = problem.substeps(method.step)
        kept = problem.samples // every + 1 - self.skip_start
        self.states = np.full((problem.count, kept, problem.x0.shape[1]), np.nan)
        self.inputs = np.full((problem.count, kept, 4), np.nan) if feedback else None
        self._stop = np.zeros(1, np.intc)
        self._library = equations.machine_code("rk4.c", layout=layout)
        self._arguments = structure(self._members())

    def _members(self) -> dict[str, object]:
        p, f = self.problem, self.feedback
        flight = {
            name: math.prod(a.shape[1:]) if len(a) > 1 else 0
            for name, a in (("u", p.u), ("wind", p.wind), ("p", p.p))
        }
        return {
            "x0": p.x0,
            "u": p.u,
            "u_flight": flight["u"],
            "u_sample": 4,
            "wind": p.wind,
            "wind_flight": flight["wind"],
            "wind_sample": 3 if p.wind.shape[1] > 1 else 0,
            "p": p.p,
            "p_flight": flight["p"],
            "gains": f and f.gains,
            "reference": f and f.reference,
            "travel": f and f.travel,
            "states": self.states,
            "inputs": self.inputs,
            "samples": p.samples,
            "substeps": self.substeps,
            "every": self.every,
            "skip_start": self.skip_start,
            "step": self.step,
            "stop": self._stop,
        }

    def run(self, first: int, last: int) -> None:
        """Fly flights first <= i < last; releases the interpreter's lock in machine code."""
        if self._library is not None:
            self._library.fly(
                ctypes.byref(self._arguments), ctypes.c_long(first), ctypes.c_long(last)
            )
        else:
            self._in_numpy(slice(first, last))

    def stop(self) -> None:
        """Ask every running flight to end at its next sample."""
        self._stop[0] = 1

    def _in_numpy(self, part: slice) -> None:
        p = self.problem
        x = p.x0[part].T.copy()
        u_all, wind_all, parameters = (a[part] if len(a) > 1 else a for a in (p.u, p.wind, p.p))
        for k in range(p.samples + 1):
            slot = k // self.every - self.skip_start
            keep = k % self.every == 0 and slot >= 0
            if keep:
                self.states[part, slot] = x.T
            if k == p.samples or self._stop[0]:
                return
            u, wind = u_all[:, k].T, wind_all[:, min(k, wind_all.shape[1] - 1)].T
            if self.feedback is not None and self.inputs is not None:
                u = _fed_back(self.feedback, k, x, u)
                if keep:
                    self.inputs[part, slot] = u.T
            rates = self._rates(u, wind, parameters.T, x.shape[1])
            with np.errstate(all="ignore"):  # a lost flight ends in NaN or infinity
                for _ in range(self.substeps):
                    x = runge_kutta_step(rates, x, self.step)

    def _rates(self, u: Array, wind: Array, p: Array, count: int) -> Callable[[Array], Array]:
        if count == 1:  # the virtual machine is far quicker on one point
            evaluate_one = self.equations.rates
            return lambda x: evaluate_one(x[:, 0], u[:, 0], wind[:, 0], p[:, 0])[0][:, None]
        held, rest = self.equations.hoisted("rates")
        kept = evaluate(held, u, wind, p)[0]
        return lambda x: np.stack([np.broadcast_to(v, count) for v in evaluate(rest, x, kept)[0]])


def runge_kutta_step(rates: Callable[[Array], Array], x: Array, h: float) -> Array:
    """x after one step of h seconds, in quaternion form; the operations of rk4.c."""
    k = rates(x)
    total, y = k, x + h / 2 * k
    for following in (h / 2, h):
        k = rates(y)
        total, y = total + 2 * k, x + following * k
    x = x + h / 6 * (total + rates(y))
    x[6:10] *= 1.0 / np.sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8] + x[9] * x[9])
    return x


def _fed_back(feedback: Feedback, k: int, x: Array, u: Array) -> Array:
    """The twin of `feed_back` in rk4.c."""
    q0, q1, q2, q3 = x[6:10]
    sine, over, under = (
        2 * (q0 * q2 - q3 * q1),
        2 * (q0 * q1 + q2 * q3),
        1 - 2 * (q1 * q1 + q2 * q2),
    )
    phi = np.array([math.atan2(a, b) for a, b in zip(over, under, strict=True)])
    theta = np.array([math.asin(-1.0 if s < -1 else 1.0 if s > 1 else s) for s in sine])
    euler = [*x[:6], phi, theta, *x[13:]]
    command = np.array(np.broadcast_to(u, (4, x.shape[1])))
    for j, state in enumerate(euler):
        command -= feedback.gains[k, :, j, None] * (state - feedback.reference[k, j])
    travel = feedback.travel[:, None]
    return np.where(command < -travel, -travel, np.where(command > travel, travel, command))
