"""The prediction error method for state-space models with innovations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from identification.estimators.method import Estimate
from identification.estimators.prediction_error import PredictionError
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Regression
from symheli.errors import InputError
from symheli.records import FlightRecord


@dataclass(frozen=True)
class Innovations(PredictionError):
    """Prediction error method of a `StateSpace` in innovation form: K(p) e in the next state, e in
    the outputs. Consistent in closed loop, for noise of any colour that K can express.

    Parameters
    ----------
    evaluations, tolerance
        As in `PredictionError`; there are no instruments.

    Raises
    ------
    InputError
        A number out of range.

    References
    ----------
    Ljung (1999), System Identification, sec. 4.3 and 7.4.

    Examples
    --------
    >>> method = idn.methods.Innovations(evaluations=50)
    >>> found = idn.fit(idn.StateSpace("y", "u", order=2), record, method)
    >>> found.covariance.shape, found.predict(record, 5).shape
    ((1, 10, 1, 10), (800, 1))
    """

    tolerance: float = field(default=1e-8, kw_only=True)
    shorthand: ClassVar[str] = "innovations"
    of_states: ClassVar[bool] = True

    @property
    def noise(self) -> tuple[int, int, Literal["output", "equation"]]:
        """White, in the equations."""
        return 0, 0, "equation"

    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """Raise `InputError`: a difference equation has no states for the noise to enter."""
        raise InputError(
            f"method {self.shorthand!r} is of states: fit a StateSpace(...); of an LPVARX"
            ' "armax" is its counterpart'
        )
