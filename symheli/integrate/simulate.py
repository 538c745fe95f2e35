"""One flight from inputs and wind."""

from __future__ import annotations

import numpy as np

from symheli.codegen import Layout
from symheli.errors import InputError, SymheliError, UnknownNameError
from symheli.helicopter import Helicopter
from symheli.integrate import adaptive, radau
from symheli.integrate.adaptive import Adaptive, CashKarp, DormandPrince
from symheli.integrate.equations import Equations, equations
from symheli.integrate.feedback import Feedback
from symheli.integrate.problem import Problem, one_flight
from symheli.integrate.radau import Radau
from symheli.integrate.rk4 import IntegratedFlights, RungeKutta4
from symheli.integrate.trajectory import Trajectory
from symheli.integrate.validity import warn_of_flights
from symheli.values.arrays import Array

Method = RungeKutta4 | Adaptive | Radau
METHODS: dict[str, type[Method]] = {
    "rk4": RungeKutta4,
    "cash_karp": CashKarp,
    "dopri": DormandPrince,
    "radau": Radau,
}
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
    """Simulate the helicopter with given inputs, each held for a sample; the whole flight is one
    call of compiled code.

    For other numbers of the vehicle see `Helicopter.with_parameters`: nothing is compiled anew.

    Parameters
    ----------
    heli : Helicopter
        The model.
    x0 : TrimPoint or array (nx,)
        In quaternion form, or in Euler form (then heading north from the origin).
    u : array (n, 4)
        rad.
    wind : array (3,) or (n, 3)
        North east down, m/s.
    dt : float
        How long each row of u is held, s.
    method : {"rk4", "cash_karp", "dopri", "radau"}, RungeKutta4, CashKarp, DormandPrince or Radau
        Equal steps, steps by a tolerance (two pairs), implicit (for stiff equations), or one of
        these with options.
    feedback : Feedback, optional
        With "rk4" only.

    Returns
    -------
    Trajectory
        States at n + 1 times.

    Raises
    ------
    InputError
        Something does not fit.
    SymheliError
        The flight leaves the range of numbers, or the method gives up.

    Warns
    -----
    ValidityWarning
        The flight leaves what the equations are known to hold for.

    See Also
    --------
    symheli.fly : one closed-loop flight
    symheli.integrate.simulate_batch : many simulations at once

    References
    ----------
    Hairer, Norsett and Wanner (1993), Solving Ordinary Differential Equations I, II.4; Hairer and
    Wanner (1996), II, IV.8.

    Examples
    --------
    >>> point = symheli.trim(heli, airspeed=5.0)
    >>> flown = symheli.simulate(heli, point, np.tile(point.u.array, (50, 1)), dt=0.02)
    >>> bool(np.abs(flown["q"]).max() < 1e-6)
    True
    """
    made, problem, chosen = equations(heli), one_flight(heli, x0, u, wind, dt), _chosen(method)
    if feedback is not None:
        if not isinstance(chosen, RungeKutta4):
            raise InputError('feedback is flown by "rk4" only')
        feedback.check(heli, problem.samples)
    states, inputs, steps, per_sample, evaluations = _flown(made, problem, chosen, feedback)
    if not np.isfinite(states[-1]).all():  # what is lost stays lost
        lost = ~np.isfinite(states).all(axis=1)
        raise SymheliError(
            f"the states became NaN or infinite at {dt * int(lost.argmax()):.6g} s: use milder"
            " inputs or a shorter step"
        )
    warn_of_flights(heli, problem, states[None])
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
        evaluations=evaluations,
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
) -> tuple[Array, Array, Array, Array, int | None]:
    """States, inputs used, steps, steps of each sample, evaluations of the right-hand side."""
    n, u = problem.samples, problem.u[0]
    if isinstance(method, Adaptive):
        states, steps, per_sample, evaluations = adaptive.fly(made, problem, method)
        return states, u, steps, per_sample, evaluations
    substeps, step = problem.substeps(method.step)
    steps, per_sample = np.full(n * substeps, step), np.full(n, substeps)
    if isinstance(method, Radau):
        return radau.fly(made, problem, method), u, steps, per_sample, None
    flights = IntegratedFlights(made, problem, method, feedback, 1, False, Layout())
    flights.run(0, 1)
    return (
        flights.states[0],
        u if flights.inputs is None else flights.inputs[0, :-1],
        steps,
        per_sample,
        method.tableau.stages * len(steps),
    )
