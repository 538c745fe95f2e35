"""Rate limits and ranges that a user gives for the parameters of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.scheduling import Rates, Scheduling, parameters
from symheli.values.units import ratio


def with_rates(given: Sequence[Scheduling], rate: Rates) -> tuple[Scheduling, ...]:
    """Return the same parameters with these rate limits; raise `InputError` for a wrong number of
    limits, `UnknownNameError` for an unknown parameter name.
    """
    names = [s.name for s in given]
    if isinstance(rate, Mapping):
        for name in rate:
            if name not in names:
                raise UnknownNameError("scheduling parameter", name, names)
        limits = [rate.get(s.name, s.rate) for s in given]
    elif isinstance(rate, Sequence | np.ndarray) and not isinstance(rate, str):
        limits = list(rate)
        if len(limits) != len(names):
            raise InputError(
                f"rate: expected one for each of {', '.join(names)}, got {len(limits)}"
            )
    else:
        limits = [rate] * len(names)
    limits = [limit if isinstance(limit, str) else float(limit) for limit in limits]
    return parameters([s.with_rate(limit) for s, limit in zip(given, limits, strict=True)])


def unit_sizes(known: Sequence[Scheduling], given: Sequence[Scheduling]) -> list[float]:
    """Return the size of one unit of each `given` parameter in units of the known one in its place.

    A parameter without a unit ("1") may be given any: it is named, not converted. Raises
    `InputError` for another number of parameters and for a unit of another quantity.
    """
    if len(known) != len(given):
        raise InputError(
            f"expected {len(known)} parameter(s), for {', '.join(s.name for s in known)}, got"
            f" {len(given)}"
        )
    sizes = []
    for old, new in zip(known, given, strict=True):
        size = ratio(new.unit, old.unit)
        if size is None and old.unit != "1":
            raise InputError(
                f"{old.name} is in {old.unit}, got a range in {new.unit}, which does not convert:"
                f" give it in {old.unit} or a unit of the same quantity; for another quantity build"
                " the model over that quantity"
            )
        sizes.append(1.0 if size is None else size)
    return sizes
