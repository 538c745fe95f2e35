"""How fast each scheduling parameter may move, in the forms a user writes it."""

from __future__ import annotations

from collections.abc import Sequence

from symheli.errors import InputError, UnknownNameError
from symheli.lpv import Scheduling
from symheli.lpv.scheduling import Rates, with_rates

Rate = Rates | None
"""In units of p per second: one for all parameters, one for each in order, or {name: rate}; the
name of a parameter says that it is the rate; the parameter's own where none is given.
"""


def asked(parameters: Sequence[Scheduling], rate: Rate) -> tuple[Scheduling, ...]:
    """The parameters with the limits asked for; raises `InputError` for a wrong number of them or
    one that is not >= 0, `UnknownNameError` for a name.
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
    """One number a parameter; raises `InputError` where it is another parameter."""
    return tuple(s.limit for s in asked(parameters, rate))
