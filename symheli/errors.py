"""Exceptions and warnings: every message states the expected value, the given value and a
remedy.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

MAX_LISTED_NAMES = 8
"""Largest number of known names that are all listed besides the nearest ones."""


class SymheliError(Exception):
    """Root of every error this project raises on purpose."""


class InputError(SymheliError, ValueError):
    """A value, shape, unit or file is invalid as given."""


class UnknownNameError(InputError):
    """A name is not among the known ones; the message lists the nearest."""

    def __init__(self, kind: str, name: object, known: Iterable[str]):
        known = [str(k) for k in known]
        near = difflib.get_close_matches(str(name), known, n=3, cutoff=0.4)
        every = "known: " + ", ".join(known)
        hint = f"did you mean {' or '.join(repr(str(n)) for n in near)}?" if near else every
        if near and len(known) <= MAX_LISTED_NAMES:
            hint += f" ({every})"
        super().__init__(f"unknown {kind} {str(name)!r}; {hint}")
        self._given = kind, str(name), known

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._given


class TrimError(SymheliError):
    """No equilibrium was found; `result` holds the best point and the residual of every equation,
    `reason` the message without its advice.
    """

    def __init__(self, message: str, result: Any = None, advice: str = ""):
        super().__init__(f"{message}; {advice}" if advice else message)
        self.result = result
        self.reason = message


class FlightLostError(SymheliError):
    """A flight ended upside down, or in NaN or infinity; `record` holds the flight up to that time
    (None if shorter than two samples).
    """

    def __init__(self, message: str, record: Any = None):
        super().__init__(message)
        self.record = record


class SynthesisError(SymheliError):
    """No controller was found; `reasons` are sentences on the mode, direction or weight that
    decides.
    """

    def __init__(self, message: str, reasons: tuple[str, ...] = ()):
        super().__init__(message)
        self.reasons = reasons


class NotFitError(SymheliError):
    """An identified model must not carry a design; `reasons` are the criteria that decide it."""

    def __init__(self, message: str, reasons: tuple[str, ...] = ()):
        super().__init__(
            "\n  ".join([f"{message}:", *reasons]) + "\nforce=True designs on it nevertheless"
        )
        self.reasons = reasons


class ExcitationError(SymheliError):
    """The data do not determine the quantities to be identified; `report` names the undetermined
    directions.
    """

    def __init__(self, message: str, report: Any = None):
        super().__init__(message)
        self.report = report


class CertificateError(SymheliError):
    """A certificate contradicts another result with which it must agree."""


class SolverError(SymheliError):
    """A numerical solver is missing, or is not one of the supported ones."""


class AccuracyError(SymheliError):
    """A result is less accurate than required by the check of its own computation, and is not
    returned.
    """


class ConvergenceWarning(UserWarning):
    """An iteration stopped before it converged; the result is its last iterate, and may be worse
    than its initial value.
    """


class PrecisionWarning(UserWarning):
    """The result has few significant digits: rounding errors take most of them."""


class CompilerWarning(UserWarning):
    """Compiled code is not available; the same numbers, to rounding, are computed more slowly."""


class DataWarning(UserWarning):
    """Data, or a model made from them, may be misleading; the message gives the finding and a
    remedy.
    """


class ValidityWarning(DataWarning):
    """The helicopter is outside the validity range of its equations; the message gives by how much,
    and the source of the limit.
    """
