"""Element-wise interpolation: every entry of many linear models, and of their trims, as a function
of where they were taken.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.bases.basis import Basis
from symheli.lpv.bases.function_space import FunctionSpace, tensor_grid
from symheli.lpv.bases.interpolating import CubicSpline, PiecewiseLinear
from symheli.lpv.bases.polynomial import Polynomial
from symheli.lpv.bases.product import Product
from symheli.lpv.given_parameters import with_rates
from symheli.lpv.linear_models import LinearModels
from symheli.lpv.lpv_matrices import Matrices
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.scheduling import Rates, Scheduling
from symheli.lpv.trim_schedule import TrimSchedule
from symheli.values.arrays import Array
from symheli.values.signal import Signal

Kind = Literal["polynomial", "spline", "linear"]

AT_REST = 1e-8
"""Rates of a trim below this, in SI units, are the rounding of an equilibrium."""


def interpolated(
    models: LinearModels,
    axes: Sequence[Signal],
    values: Sequence[Array],
    kind: Kind,
    degree: int | Sequence[int],
    rate: Rates | None,
) -> LPVStateSpace:
    """The models at every combination of the `values` of the `axes`, the last running fastest, as
    one model; see `LinearFamily.interpolate`.
    """
    if any(len(nodes) < 2 for nodes in values):
        few = next(axis for axis, nodes in zip(axes, values, strict=True) if len(nodes) < 2)
        raise InputError(f"interpolation needs at least two values of {few}")
    degrees = np.broadcast_to(degree, len(axes)).tolist()
    basis = _product([_factor(kind, nodes, d) for nodes, d in zip(values, degrees, strict=True)])
    points = values[0] if len(axes) == 1 else tensor_grid(values)
    exact = Matrices(models.A, models.B, models.C, models.D)
    fitted = Matrices(*(basis.fit(points, M) for M in exact))
    parameters = [
        Scheduling(str(axis), axis.unit, float(nodes[0]), float(nodes[-1]))
        for axis, nodes in zip(axes, values, strict=True)
    ]
    model = LPVStateSpace(
        basis,
        *fitted,
        with_rates(parameters, _usual(axes) if rate is None else rate),
        models.states,
        models.inputs,
        models.outputs,
        dt=models.dt,
        trim=_schedule(models, values, points),
    )
    return model.with_residuals(points, exact)


def _usual(axes: Sequence[Signal]) -> dict[str, float | str]:
    """Arbitrarily fast, but an airspeed beside an acceleration: that is how fast it changes."""
    tied = "airspeed" in axes and "acceleration" in axes
    return {"airspeed": "acceleration" if tied else math.inf} if "airspeed" in axes else {}


def _factor(kind: Kind, nodes: Array, degree: int) -> Basis:
    if kind == "polynomial":
        if len(nodes) <= degree:
            raise InputError(
                f"a polynomial of degree {degree} needs {degree + 1} values of each parameter, got"
                f" {len(nodes)}: lower the degree (one for all, or one each) or add values"
            )
        return Polynomial(degree, float(nodes[0]), float(nodes[-1]))
    bases = {"spline": CubicSpline, "linear": PiecewiseLinear}
    if kind not in bases:
        raise UnknownNameError("interpolation kind", kind, ("polynomial", *bases))
    return bases[kind](tuple(nodes.tolist()))


def _schedule(models: LinearModels, values: Sequence[Array], points: Array) -> TrimSchedule | None:
    """Cubic splines through the trims, straight lines below four values; None without trims."""
    known = models.points
    if not len(known):
        return None
    x0, u0 = known.state(models.states), known.input(models.inputs)
    xdot = known.rate(models.states)
    basis = _product([_factor("spline" if len(n) >= 4 else "linear", n, 0) for n in values])
    rates = basis.fit(points, xdot) if np.abs(xdot).max(initial=0.0) > AT_REST else None
    return TrimSchedule(basis, basis.fit(points, x0), basis.fit(points, u0), rates)


def _product(factors: list[Basis]) -> FunctionSpace:
    return factors[0] if len(factors) == 1 else Product(tuple(factors))
