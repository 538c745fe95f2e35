"""Trial of a campaign: a function of its parameters that returns named numbers."""

from __future__ import annotations

import inspect
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from symheli.errors import InputError, UnknownNameError

SECONDS = "seconds"
"""Quantity of every trial: its computing time, s."""

RESERVED = frozenset({SECONDS, "case", "quantity", "unit", "values", "reason"})
"""Names that a dataset reserves."""

LONGEST_REASON = 240
"""Characters that are kept of why a case failed."""

Value = bool | int | float | str
"""Value of a parameter."""


@dataclass(frozen=True, eq=False)
class Trial:
    """`run(**parameters)` gives {quantity: number}; `quantities` are their units by name.

    `run` is a pure function of its parameters, each with a default that says of which kind it is;
    what is random in it is drawn from its parameter `seed`, where it has one. A quantity that is
    not given is NaN: one that does not apply. An exception is a failed case.

    Examples
    --------
    >>> def pendulum(*, length: float = 1.0, seed: int = 0) -> dict[str, float]:
    ...     rng = np.random.default_rng(seed)
    ...     return {"period": 2 * np.pi * np.sqrt(length / rng.normal(9.81, 0.01))}
    >>> Trial(pendulum, {"period": "s"}).kinds
    {'length': <class 'float'>, 'seed': <class 'int'>}
    """

    run: Callable[..., Mapping[str, float]]
    quantities: Mapping[str, str]

    def __post_init__(self) -> None:
        for name in (*self.quantities, *self.defaults):
            taken = name in self.quantities and name in self.defaults
            if taken or name in RESERVED or not name:
                raise InputError(
                    f"{self.name}: {name!r} is already a name in the dataset; choose another"
                )
        lacking = [p.name for p in self._signature if p.default is inspect.Parameter.empty]
        if lacking:
            raise InputError(
                f"{self.name}: give {', '.join(lacking)} a default value, which sets its type"
            )
        object.__setattr__(self, "quantities", dict(self.quantities))

    @property
    def name(self) -> str:
        """Module and name of the function."""
        return f"{self.run.__module__}:{self.run.__qualname__}"

    @property
    def defaults(self) -> dict[str, Value]:
        """Every parameter with its default."""
        return {p.name: p.default for p in self._signature}

    @property
    def kinds(self) -> dict[str, type]:
        """Every parameter with its type."""
        return {name: type(value) for name, value in self.defaults.items()}

    @property
    def units(self) -> dict[str, str]:
        """Units of all quantities of a case, in order."""
        return {**self.quantities, SECONDS: "s"}

    def of_kind(self, name: str, value: Any) -> Value:
        """`value` as the parameter `name` takes it."""
        if name not in self.kinds:
            raise UnknownNameError(f"parameter of {self.name}", name, self.kinds)
        kind = self.kinds[name]
        if kind is float and isinstance(value, int) and not isinstance(value, bool):
            return float(value)
        if type(value) is not kind:
            raise InputError(
                f"{name} of {self.name} is a {kind.__name__}, such as {self.defaults[name]!r}; got"
                f" {value!r}"
            )
        return value

    def call(self, parameters: Mapping[str, Value]) -> Callable[[], TrialOutcome]:
        """Return the call for a worker."""
        return partial(outcome, self.run, tuple(self.quantities), dict(parameters))

    @property
    def _signature(self) -> list[inspect.Parameter]:
        return list(inspect.signature(self.run).parameters.values())


@dataclass(frozen=True)
class TrialOutcome:
    """Outcome of one case: its quantities in order, the time last; or the reason of its failure."""

    values: tuple[float, ...]
    reason: str = ""


def outcome(
    run: Callable[..., Mapping[str, float]],
    quantities: tuple[str, ...],
    parameters: Mapping[str, Value],
) -> TrialOutcome:
    """Run one case; what goes wrong is its reason."""
    begin = time.perf_counter()
    try:
        row = run(**parameters)
        unknown = [name for name in row if name not in quantities]
        if unknown:
            raise UnknownNameError("quantity", unknown[0], quantities)
        values = tuple(float(row.get(name, math.nan)) for name in quantities)
        reason = ""
    except Exception as error:
        values, reason = (math.nan,) * len(quantities), reason_of(error)
    return TrialOutcome((*values, time.perf_counter() - begin), reason)


def reason_of(error: BaseException) -> str:
    """Return the reason of a failure in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:LONGEST_REASON]
