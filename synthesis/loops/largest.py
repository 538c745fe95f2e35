"""The largest number for which something is proven, by bisection."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from symheli.errors import InputError


class Largest(NamedTuple):
    """`proven`: the largest value with a proof, 0 where even the least that was tried had none;
    `failed`: the least without one, inf where all had one.
    """

    proven: float
    failed: float


def largest(
    proves: Callable[[float], bool], most: float, tolerance: float = 0.05, *, least: float = 1e-3
) -> Largest:
    """The largest value up to `most` for which `proves` says yes, to `tolerance` of `most`.

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
    Largest(proven=0.25, failed=0.3125)
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
