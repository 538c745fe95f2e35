"""Exact linear models about an operating point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symheli.errors import InputError
from symheli.helicopter import Helicopter, require
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.linear_models import LinearModels
from symheli.steady.equations import numeric
from symheli.steady.equilibrium import TrimPoint, trim, warn_of_point
from symheli.steady.newton import TOLERANCE
from symheli.steady.steady_flights import SteadyFlights
from symheli.steady.trim_batch import TrimBatch
from symheli.values.signal import Signal, indices


def linearize(
    heli: Helicopter,
    point: TrimPoint | float | None = None,
    *,
    airspeed: float | None = None,
    inputs: Sequence[str] | None = None,
    allow_accelerating: bool = False,
) -> LinearModel:
    """Return the linear model of a helicopter about a trim, exact by algorithmic differentiation
    through the implicit inflow.

    A, B are of the Euler form; C = I, D = 0.

    The air is that of the point.

    Parameters
    ----------
    heli : Helicopter
        The model.
    point : TrimPoint or float
        Of that model; a number is an airspeed.
    airspeed : float
        In place of a point, m/s: about the trim of level flight.
    inputs : sequence of str, optional
        Default the four controls; gust velocities u_w v_w w_w (body axes, m/s) may be named too.
    allow_accelerating : bool
        Whether a point that is no equilibrium will do.

    Returns
    -------
    LinearModel
        In deviations from the point, SI and radians.

    Raises
    ------
    InputError
        A point that is no equilibrium, unless `allow_accelerating`; both or neither of point and
        airspeed.

    Warns
    -----
    ValidityWarning
        As in `trim`.

    See Also
    --------
    symheli.trim : one steady flight
    symheli.sweep : trims and linear models over airspeed

    Examples
    --------
    >>> model = symheli.linearize(heli, symheli.trim(heli, airspeed=5.0))
    >>> model.A.shape, model.B.shape, model.is_stable()
    ((10, 10), (10, 4), True)
    >>> np.array_equal(symheli.linearize(heli, airspeed=5.0).A, model.A)
    True
    """
    require(heli, "linearize(heli, trim(heli, airspeed=5.0))")
    if (point is None) is (airspeed is None):
        raise InputError(
            "give a trim or an airspeed: linearize(heli, trim(heli, airspeed=5.0)) or"
            " linearize(heli, airspeed=5.0)"
        )
    if not isinstance(point, TrimPoint):
        if not isinstance(point, int | float | None) or isinstance(point, bool):
            raise InputError(
                f"point: expected a TrimPoint or an airspeed in m/s, got {point!r:.80}; write"
                " linearize(heli, trim(heli, airspeed=5.0))"
            )
        return linearize(
            heli,
            trim(heli, float(airspeed if point is None else point)),  # type: ignore[arg-type]
            inputs=inputs,
            allow_accelerating=allow_accelerating,
        )
    if not allow_accelerating and not np.all(np.abs(point.xdot.array) < TOLERANCE):
        raise InputError(
            f"linearize needs an equilibrium: {point.outcome}; pass allow_accelerating=True for a"
            " model about a trajectory point"
        )
    if point.x.signals != heli.states:
        raise InputError(
            f"the point has states {', '.join(point.x.signals)}, the helicopter"
            f" {', '.join(heli.states)}: trim this helicopter"
        )
    heli = heli.in_air(point.density)
    warn_of_point(heli, point)
    found = numeric(heli, "slopes")(point.x.array, point.u.array, point.wind.array)
    n, (columns, names) = len(heli.states), _columns(heli, inputs)
    A, B, E = (matrix.reshape(n, -1) for matrix in found)
    return LinearModel(
        A,
        np.hstack([B, E])[:, columns],
        np.eye(n),
        np.zeros((n, len(columns))),
        heli.states,
        names,
        heli.states,
        point=point,
    )


def linear_models(
    flights: SteadyFlights, trims: TrimBatch, inputs: Sequence[str] | None
) -> LinearModels:
    """`linearize` at the trims of these flights, in machine code."""
    heli = flights.helis[0]
    A, B, E = flights.slopes(trims.x, trims.u, trims.wind)
    columns, names = _columns(heli, inputs)
    K, n = A.shape[:2]
    return LinearModels(
        A,
        np.concatenate([B, E], axis=2)[:, :, columns],
        np.broadcast_to(np.eye(n), (K, n, n)),
        np.zeros((K, n, len(columns))),
        heli.states,
        names,
        heli.states,
        points=trims,
    )


def _columns(
    heli: Helicopter, inputs: Sequence[str] | None
) -> tuple[list[int], tuple[Signal, ...]]:
    """Columns of the four controls and the three winds that these inputs are, and their names."""
    every = (*heli.inputs, *heli.wind)
    columns = indices(heli.inputs if inputs is None else inputs, every, "input")
    return columns, tuple(every[i] for i in columns)
