"""Recursive least squares as a method of `fit`: the coefficients at the end of the records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from identification.estimators.least_squares import least_squares_covariance
from identification.estimators.method import Estimate, Method
from identification.estimators.self_check import check_least_squares, check_recursion
from identification.recursive.forgetting import Constant, Forgetting, forgetting_of
from identification.recursive.recursive_least_squares import RecursiveLeastSquares
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Regression
from symheli.progress import tracked
from symheli.records import FlightRecord


@dataclass(frozen=True)
class Recursion(Method):
    """Least squares with exponential forgetting: `RecursiveLeastSquares` over whole records.

    Parameters
    ----------
    forgetting : float or Forgetting
        A factor in (0, 1] (the weight of a sample is the factor to the power of its age), or one of
        `Constant`, `Variable`, `Directional` of `identification.forgetting`.

    Raises
    ------
    InputError
        For anything else.

    Examples
    --------
    >>> recent = idn.fit(arx, record, method=idn.methods.Recursion(forgetting=0.99))
    >>> print(recent.coefficients.at(0.0).A.round(1))
    [[[-0.5]]]
    """

    forgetting: float | Forgetting = 1.0
    shorthand: ClassVar[str] = "rls"
    least_squares: ClassVar[bool] = True

    def __post_init__(self) -> None:
        forgetting_of(self.forgetting)

    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """Return the coefficients after the last sample; their covariance if the recursion does not
        forget, since the change of varying coefficients is unknown.
        """
        forgetting = forgetting_of(self.forgetting)
        online = RecursiveLeastSquares(arx, forgetting).online()
        samples = zip(data.phi, data.y, strict=True)
        for phi, y in tracked("recursive least squares", samples, len(data.y)):
            online.absorb(phi, y)
        state = online.state
        check_recursion(state, data.phi, data.y)
        theta, covariance = state.solve(), None
        if forgetting == Constant(1.0):
            check_least_squares(arx, data.phi, data.y, theta, self.shorthand)
            covariance = least_squares_covariance(arx, data, theta)
        return Estimate(
            theta=theta, residual_covariance=state.residual_covariance, covariance=covariance
        )
