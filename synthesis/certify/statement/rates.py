"""Rate limits that a question states: what is given, checked against the parameters."""

from __future__ import annotations

from collections.abc import Sequence

from symheli import Scheduling
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.given_parameters import with_rates
from symheli.lpv.scheduling import Rates

Rate = Rates | None
"""Rate limit, in units of p per second: one for all parameters, one for each in order, or {name:
rate}; the name of a parameter states that it is the rate; None: the parameter's own.
"""


def limits(parameters: Sequence[Scheduling], rate: Rate) -> tuple[Scheduling, ...]:
    """Return the parameters with the requested limits; raise `InputError` for a wrong number of
    them or one that is not >= 0, `UnknownNameError` for a name.
    """
    if rate is None:
        return tuple(parameters)
    try:
        return with_rates(parameters, rate)
    except UnknownNameError:
        raise
    except (TypeError, ValueError) as error:
        units = ", ".join(f"{s.name} ({s.unit}/s)" for s in parameters)
        raise InputError(
            "rate must be >= 0 (math.inf: arbitrarily fast), one for all, one for each of"
            f" {units}, or by name, got {rate!r} ({error})"
        ) from error


def rates(parameters: Sequence[Scheduling], rate: Rate) -> tuple[float, ...]:
    """Return one number a parameter; raise `InputError` where the rate is another parameter."""
    return tuple(s.limit for s in limits(parameters, rate))
