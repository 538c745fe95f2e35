"""Derivatives of explicit Runge-Kutta flights: each step differentiated as it is written, in
machine code or in NumPy.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from symheli.codegen import Layout
from symheli.errors import SymheliError
from symheli.integrate.equations import Equations
from symheli.integrate.kernel import structure
from symheli.integrate.tableau import Tableau
from symheli.integrate.trajectory import Trajectory
from symheli.values.arrays import Array

FUNCTIONS = ("rates", "tangent_rates", "adjoint_rates")
WITH_PARAMETERS = ("parameter_rates",)
SIDE_BY_SIDE = Layout(width=8)
"""Directions or functionals at a time; roots and quotients of eight take little longer than those
of one.
"""


def tangent(
    equations: Equations,
    flown: Trajectory,
    dx0: Array,
    du: Array,
    dwind: Array,
    dp: Array | None = None,
) -> Array:
    """Change of the states (n+1, nx, m) for dx0 (nx, m), du (n, 4, m), dwind (n, 3, m), and dp
    (parameters, m) where parameters move.
    """
    m = dx0.shape[-1]
    functions = FUNCTIONS if dp is None else WITH_PARAMETERS
    library = equations.machine_code("sensitivity.c", functions, SIDE_BY_SIDE)
    if library is None:
        return _tangent_in_numpy(equations, flown, dx0, du, dwind, dp)
    dx = np.empty((*flown.states.shape, m))
    _call(library.tangent, flown, m, dx0=dx0, du=du, dwind=dwind, dp=dp, dx=dx)
    return dx


def adjoint(equations: Equations, flown: Trajectory, weights: Array) -> tuple[Array, Array, Array]:
    """Gradients (nx, m), (n, 4, m), (n, 3, m) for weights (n+1, nx, m)."""
    m = weights.shape[-1]
    library = equations.machine_code("sensitivity.c", FUNCTIONS, SIDE_BY_SIDE)
    if library is None:
        return _adjoint_in_numpy(equations, flown, weights)
    bars = (
        np.empty((weights.shape[1], m)),
        np.empty((*flown.inputs.shape, m)),
        np.empty((*flown.wind.shape, m)),
    )
    _call(
        library.adjoint, flown, m, weights=weights, x_bar=bars[0], u_bar=bars[1], wind_bar=bars[2]
    )
    return bars


def _call(function: Callable[..., int], flown: Trajectory, m: int, **arrays: Array | None) -> None:
    tableau: Tableau = flown.method.tableau
    per_sample = np.asarray(flown.per_sample, ctypes.c_long)
    members = ("dx0", "du", "dwind", "dp", "dx", "weights", "x_bar", "u_bar", "wind_bar")
    flight = {
        "states": flown.states,
        "u": flown.inputs,
        "wind": flown.wind,
        "p": flown.parameters.array,
        "steps": flown.steps,
    }
    arguments = structure(
        {
            **{name: np.ascontiguousarray(array) for name, array in flight.items()},
            "per_sample": per_sample,
            "a": tableau.a,
            "b": tableau.b,
            "samples": len(per_sample),
            "stages": tableau.stages,
            "longest": int(per_sample.max()),
            "width": m,
            **{name: arrays.get(name) for name in members},
        }
    )
    if function(ctypes.byref(arguments)):
        raise SymheliError("not enough memory for the stages of one sample: use a smaller dt")


def _stages(
    equations: Equations, flown: Trajectory, sample: int, steps: Array
) -> list[list[Array]]:
    """For each step of a sample the states of its stages, and its end before the quaternion is
    normalised.
    """
    tableau: Tableau = flown.method.tableau
    x, out = flown.states[sample], []
    held = flown.inputs[sample], flown.wind[sample], flown.parameters.array
    for h in steps:
        k, stages = [], []
        for row in tableau.a:
            stages.append(
                x + h * sum((w * slope for w, slope in zip(row, k, strict=False)), np.zeros_like(x))
            )
            k.append(equations.rates(stages[-1], *held)[0])
        x = x + h * sum(w * slope for w, slope in zip(tableau.b, k, strict=True))
        out.append([*stages, x])
        x = x.copy()
        x[6:10] /= np.linalg.norm(x[6:10])
    return out


def _normalised(change: Array, end: Array) -> Array:
    """The derivative of q/|q| at the unnormalised `end` applied to `change` (nx, m); symmetric, so
    its own adjoint.
    """
    length = np.linalg.norm(end[6:10])
    unit = end[6:10, None] / length
    out = change.copy()
    out[6:10] = (change[6:10] - unit * (unit * change[6:10]).sum(axis=0)) / length
    return out


def _tangent_in_numpy(
    equations: Equations,
    flown: Trajectory,
    dx0: Array,
    du: Array,
    dwind: Array,
    dp: Array | None,
) -> Array:
    tableau: Tableau = flown.method.tableau
    m = dx0.shape[-1]
    rates = equations.virtual_machine("tangent_rates" if dp is None else "parameter_rates", m)
    moved = () if dp is None else (dp,)
    dx, out, ends = dx0, [dx0], np.cumsum(flown.per_sample)
    for sample, (count, end) in enumerate(zip(flown.per_sample, ends, strict=True)):
        held = [
            np.repeat(v[:, None], m, axis=1)
            for v in (flown.inputs[sample], flown.wind[sample], flown.parameters.array)
        ]
        steps = flown.steps[end - count : end]
        for h, stages in zip(steps, _stages(equations, flown, sample, steps), strict=True):
            dk: list[Array] = []
            for row, y in zip(tableau.a, stages, strict=False):
                dy = dx + h * sum(
                    (w * slope for w, slope in zip(row, dk, strict=False)), np.zeros_like(dx)
                )
                dk.append(
                    _matrix(
                        rates(
                            *map(
                                _vector,
                                (
                                    np.repeat(y[:, None], m, axis=1),
                                    *held,
                                    dy,
                                    du[sample],
                                    dwind[sample],
                                    *moved,
                                ),
                            )
                        )[1],
                        dx,
                    )
                )
            dx = _normalised(
                dx + h * sum(w * slope for w, slope in zip(tableau.b, dk, strict=True)), stages[-1]
            )
        out.append(dx)
    return np.array(out)


def _adjoint_in_numpy(
    equations: Equations, flown: Trajectory, weights: Array
) -> tuple[Array, Array, Array]:
    tableau: Tableau = flown.method.tableau
    m, n = weights.shape[-1], len(flown.inputs)
    rates = equations.virtual_machine("adjoint_rates", m)
    x_bar, u_bar, wind_bar = weights[n], np.zeros((n, 4, m)), np.zeros((n, 3, m))
    ends = np.cumsum(flown.per_sample)
    for sample in reversed(range(n)):
        held = [
            np.repeat(v[:, None], m, axis=1)
            for v in (flown.inputs[sample], flown.wind[sample], flown.parameters.array)
        ]
        steps = flown.steps[ends[sample] - flown.per_sample[sample] : ends[sample]]
        for h, stages in reversed(
            list(zip(steps, _stages(equations, flown, sample, steps), strict=True))
        ):
            x_bar = _normalised(x_bar, stages[-1])
            y_bar: dict[int, Array] = {}
            for s in reversed(range(tableau.stages)):
                k_bar = h * (
                    tableau.b[s] * x_bar + sum(tableau.a[j, s] * bar for j, bar in y_bar.items())
                )
                bars = rates(
                    *map(_vector, (np.repeat(stages[s][:, None], m, axis=1), *held, k_bar))
                )
                y_bar[s] = _matrix(bars[0], x_bar)
                u_bar[sample] += _matrix(bars[1], u_bar[sample])
                wind_bar[sample] += _matrix(bars[2], wind_bar[sample])
            x_bar = x_bar + sum(y_bar.values())
        x_bar = x_bar + weights[sample]
    return x_bar, u_bar, wind_bar


def _vector(a: Array) -> Array:
    """A single column as the vector that `Numeric` expects."""
    return a[:, 0] if a.shape[1] == 1 else a


def _matrix(a: Array, like: Array) -> Array:
    return a.reshape(like.shape)
