"""A controller with a constant scheduling input: the range of the true parameter with a stability
proof.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

from symheli import LPVStateSpace
from symheli.errors import InputError
from symheli.lazy import former_attribute
from symheli.lpv.linear_model import LinearModel
from symheli.threads import with_one_thread
from synthesis.certify.questions.questions import stability
from synthesis.certify.statement.rates import Rate, limits
from synthesis.design.plant.as_controller import as_controller
from synthesis.design.plant.plant import Plant, require_plant

MIN_TOLERANCE = 1e-6
"""Smallest permitted tolerance: twenty bisections, each with a proof; solvers are no more
accurate.
"""


class Largest(NamedTuple):
    """Result of a bisection: `bound`, the largest value with a proof, 0 where even the least tried
    had none; `failed`, the least without one, inf where all had one.
    """

    bound: float
    failed: float

    proven = former_attribute("proven", "bound")


def largest(
    proves: Callable[[float], bool], most: float, tolerance: float = 0.05, *, least: float = 1e-3
) -> Largest:
    """Search the largest value up to `most` for which `proves` returns True, to `tolerance` of
    `most`.

    What is proven for a value is taken to hold for all below it; each returned number was tried.

    Parameters
    ----------
    proves : callable
        value > 0 -> whether there is a proof.
    most : float
        > 0, tried first.
    tolerance : float
        Of the bisection, as a fraction of `most`.
    least : float
        Fraction of `most` below which nothing is tried.

    Returns
    -------
    Largest
        The two sides of the bisection.

    Raises
    ------
    InputError
        A `most` or `tolerance` that is not positive.

    Examples
    --------
    >>> print(largest(lambda b: b < 0.3, 1.0, 0.1))
    Largest(bound=0.25, failed=0.3125)
    """
    if not (most > 0 and tolerance > 0):
        raise InputError(f"expected most > 0 and tolerance > 0, got {most!r} and {tolerance!r}")
    if proves(most):
        return Largest(most, float("inf"))
    low, high = 0.0, float(most)
    while high - low > tolerance * most and high > least * most:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if proves(middle) else (low, middle)
    return Largest(low, high)


@with_one_thread
def proven_around(
    plant: Plant,
    controller: Any,
    at: float,
    rate: Rate = None,
    *,
    tolerance: float = 0.05,
    **options: Any,
) -> tuple[float, float]:
    """Find the interval of the parameter around `at` on which the loop of the constant controller
    K(at) is proven stable while the parameter moves there.

    Parameters
    ----------
    plant : Plant
        Over one parameter, in the sample period of the controller.
    controller : Controller, TableController, LPVStateSpace or what else `Plant.close` takes
        Read at `at` once and for all.
    at : float
        Where the reading froze, within the plant's range.
    rate : float, optional
        Largest |dp/dt|; by default the plant's own.
    tolerance : float
        Of the bisection towards each end, as a fraction of the way there.
    **options
        Of `stability`.

    Returns
    -------
    (float, float)
        The ends, first the lower: that one with `at` as the upper end, the other with the lower as
        it was found; (at, at) where nothing is proven.

    Raises
    ------
    InputError
        Several parameters, an `at` out of range, a tolerance below `MIN_TOLERANCE` or not below 1.

    Examples
    --------
    >>> import synthesis
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.1)
    >>> lag = LPVStateSpace.polynomial(
    ...     [[[0.9]], [[0.3]]], [[[0.1, 0.1]]], [[[1.0]]], [[[0.0, 0.0]]], p, dt=0.1,
    ...     inputs=("w", "u"), outputs=("y",))
    >>> plant = synthesis.Plant(lag, disturbances=["w"], performance=["y"], controls=["u"],
    ...                         measurements=["y"])
    >>> low, high = proven_around(plant, {("u", "y"): -1.2}, 0.5)  # stable below p = 0.733
    >>> print(low, round(high, 3))
    0.0 0.719
    """
    require_plant(plant)
    if not MIN_TOLERANCE <= tolerance < 1:
        raise InputError(f"tolerance: expected from {MIN_TOLERANCE:g} to below 1, got {tolerance}")
    (s,) = _one(plant, rate)
    if not s.low <= at <= s.high:
        raise InputError(f"at: expected {s.name} within [{s.low:g}, {s.high:g}] {s.unit}, got {at}")
    K = as_controller(controller, plant.controls, plant.measurements)
    frozen = K if isinstance(K, LinearModel) else LPVStateSpace.constant(K.at(at), s)

    def proven(low: float, high: float) -> bool:
        narrow = plant.with_scheduling(replace(s, low=low, high=high))
        return stability(narrow.close(_within(frozen, narrow)), **options).verified

    down, up = at - s.low, s.high - at
    below = largest(lambda d: proven(at - d, at), down, tolerance).bound if down > 0 else 0.0
    low = s.low if below == down else at - below
    above = largest(lambda d: proven(low, at + d), up, tolerance).bound if up > 0 else 0.0
    return low, s.high if above == up else at + above


def _one(plant: Plant, rate: Rate) -> tuple[Any, ...]:
    parameters = limits(plant.parameters, rate)
    if len(parameters) != 1:
        raise InputError(
            "a frozen reading needs a plant of one parameter, this one has"
            f" {', '.join(s.name for s in parameters)}"
        )
    return tuple(parameters)


def _within(frozen: LinearModel | LPVStateSpace, plant: Plant) -> Any:
    if isinstance(frozen, LinearModel):
        return frozen
    return frozen.with_scheduling(plant.parameters)
