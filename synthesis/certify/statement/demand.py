"""The property of a model that is to be proven, and how its parameters may move."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from symheli import Scheduling
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.scheduling import Rates, with_rates
from synthesis.certify.statement.kind import Kind
from synthesis.numerics.polynomial.motion import Motion


class Demand(NamedTuple):
    """The property to be proven: `kind`; how p moves; `shift`: alpha of a decay rate, 1/s, else 0.

    `time`: seconds in the unit of time of the model in continuous time.
    """

    kind: Kind
    motion: Motion
    shift: float = 0.0
    time: float = 1.0

    @property
    def of_gramian(self) -> bool:
        """Whether P bounds the inverse Gramian of the inputs, and a second inequality the
        outputs.
        """
        return self.kind in ("energy-to-peak gain", "h2 gain")

    def seen(self, outputs: int) -> int:
        """Return the number of rows of that second inequality in which g stands."""
        return 1 if self.kind == "h2 gain" else outputs

    @property
    def rates(self) -> tuple[float, ...]:
        """Largest rate of each parameter, in its unit per second."""
        return self.motion.rates

    def moving(self, degrees: Sequence[int]) -> list[bool]:
        """Return for each parameter whether its motion changes P."""
        return [bool(d) and rate > 0 for d, rate in zip(degrees, self.rates, strict=True)]

    def steps(self, dt: float | None, degrees: Sequence[int]) -> tuple[float, ...]:
        """Return the largest change of each parameter in a sample that changes P; 0 in continuous
        time.
        """
        return tuple(
            rate * dt if dt and d else 0.0 for rate, d in zip(self.rates, degrees, strict=True)
        )

    def meaningful(self, dt: float | None, degrees: Sequence[int]) -> bool:
        """Return False where P varies with a p that may jump in continuous time: dV/dt is unbounded
        then.
        """
        return dt is not None or all(
            math.isfinite(r) or d == 0 for r, d in zip(self.rates, degrees, strict=True)
        )


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
