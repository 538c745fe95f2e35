"""One flight from inputs and wind."""

from __future__ import annotations

import numpy as np

from symheli.codegen import Layout
from symheli.errors import InputError, SymheliError, UnknownNameError
from symheli.helicopter import Helicopter
from symheli.integrate import dopri, radau
from symheli.integrate.dopri import DormandPrince
from symheli.integrate.equations import Equations, equations
from symheli.integrate.feedback import Feedback
from symheli.integrate.problem import Problem, one_flight
from symheli.integrate.radau import Radau
from symheli.integrate.rk4 import Flights, RungeKutta4
from symheli.integrate.trajectory import Trajectory
from symheli.values.arrays import Array

Method = RungeKutta4 | DormandPrince | Radau
METHODS: dict[str, type[Method]] = {"rk4": RungeKutta4, "dopri": DormandPrince, "radau": Radau}
"""Methods by their short name, with their default options."""


def simulate(
    heli: Helicopter,
    x0: object,
    u: object,
    wind: object = (0.0, 0.0, 0.0),
    *,
    dt: float,
    method: str | Method = "rk4",
    feedback: Feedback | None = None,
) -> Trajectory:
    """Fly from `x0` with each row of `u` (n, 4), rad, held for `dt` seconds; the whole flight is
    one call into machine code.

    x0: a `TrimPoint`, or (nx,) in quaternion form, or in Euler form (then heading north from the
    origin). wind: (3,) or (n, 3), north east down, m/s. feedback: with "rk4" only. For other
    numbers of the vehicle see `Helicopter.with_parameters`: nothing is compiled anew.

    method: "rk4" (equal steps), "dopri" (steps by a tolerance), "radau" (implicit, for stiff
    equations) or one of `RungeKutta4`, `DormandPrince`, `Radau` with options. Raises `InputError`
    where something does not fit, `SymheliError` where the flight leaves the range of numbers or the
    method gives up.
    """
    made, problem, chosen = equations(heli), one_flight(heli, x0, u, wind, dt), _chosen(method)
    if feedback is not None:
        if not isinstance(chosen, RungeKutta4):
            raise InputError('feedback is flown by "rk4" only')
        feedback.check(heli, problem.samples)
    states, inputs, steps, per_sample = _flown(made, problem, chosen, feedback)
    lost = ~np.isfinite(states).all(axis=1)
    if lost.any():
        raise SymheliError(
            f"the flight left the range of numbers at {dt * int(lost.argmax()):.6g} s: milder"
            " inputs, or a shorter step, please"
        )
    wind_flown = np.broadcast_to(problem.wind[0], (problem.samples, 3))
    times = problem.dt * np.arange(problem.samples + 1)
    return Trajectory(
        times=times,
        states=states,
        inputs=inputs,
        wind=wind_flown,
        signals=heli.flight_states,
        steps=steps,
        per_sample=per_sample,
        method=chosen,
        parameters=heli.parameters,
    )


def _chosen(method: str | Method) -> Method:
    if not isinstance(method, str):
        return method
    if method not in METHODS:
        raise UnknownNameError("method", method, METHODS)
    return METHODS[method]()


def _flown(
    made: Equations, problem: Problem, method: Method, feedback: Feedback | None
) -> tuple[Array, Array, Array, Array]:
    """States, inputs used, steps, steps of each sample."""
    n, u = problem.samples, problem.u[0]
    if isinstance(method, DormandPrince):
        states, steps, per_sample = dopri.fly(made, problem, method)
        return states, u, steps, per_sample
    substeps, step = problem.substeps(method.step)
    steps, per_sample = np.full(n * substeps, step), np.full(n, substeps)
    if isinstance(method, Radau):
        return radau.fly(made, problem, method), u, steps, per_sample
    flights = Flights(made, problem, method, feedback, 1, False, Layout())
    flights.run(0, 1)
    return (
        flights.states[0],
        u if flights.inputs is None else flights.inputs[0, :-1],
        steps,
        per_sample,
    )
