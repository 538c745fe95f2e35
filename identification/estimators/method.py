"""Interface of an estimator to `fit`: validated options, and one call from regressors to
coefficients.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from identification.model.noise_model import NoiseModel
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Regression
from symheli.errors import ConvergenceWarning, InputError, UnknownNameError
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.named_subclasses import named_subclasses
from symheli.values.summary import summarized


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimate:
    """The result of a method: coefficients and diagnostics.

    Parameters
    ----------
    theta : array (n_regressors, ny)
        In the order of `LPVARX.regressor_names`.
    details : mapping
        Plain numbers and lists by name.
    remarks : tuple of Warning
        The warnings `fit` issues.
    residual_covariance : array (ny, ny), optional
        Of the one-step residuals; None: that of the batch of regressors.
    covariance : array (ny, n_regressors, ny, n_regressors), optional
        Of all coefficients together, equation by equation, where the method knows it; `fit` keeps
        it.
    noise : NoiseModel, optional
        Where the method finds one; None: white noise in the equations, or at the outputs.

    Examples
    --------
    >>> found = idn.methods.Estimate(theta=np.zeros((4, 1)), details={"iterations": 3})
    >>> found.details["iterations"]
    3
    """

    theta: Array
    details: Mapping[str, Any] = field(default_factory=dict)
    remarks: tuple[Warning, ...] = ()
    residual_covariance: Array | None = None
    covariance: Array | None = None
    noise: NoiseModel | None = None

    __repr__ = summarized


class Method(ABC):
    """An estimator with its options: the interface that `fit` needs, and nothing else.

    A subclass is known by its shorthand as soon as it is defined. One of the package is a file of
    its own whose class `identification.methods` exports.

    Attributes
    ----------
    shorthand : str
        Stands for the defaults, and is what a model says it was fitted by.
    least_squares : bool
        The coefficients minimise the squared residuals alone: `uncertainty` holds for them, and
        noise in the regressors biases them, which their covariance does not tell.
    needs_excitation : bool
        The data alone must determine every coefficient, `fit` refuses them otherwise. False where a
        penalty decides what they leave open.
    of_states : bool
        It finds the matrices of a `StateSpace`, and no coefficients of a difference equation.

    Examples
    --------
    >>> class Zero(idn.methods.Method):
    ...     shorthand, needs_excitation = "zero", False
    ...
    ...     def estimate(self, arx, records, data):
    ...         return idn.methods.Estimate(theta=np.zeros((arx.n_regressors, arx.ny)))
    >>> print(idn.fit(arx, record, method=Zero()).theta.T)
    [[0. 0. 0. 0.]]
    """

    shorthand: ClassVar[str]
    least_squares: ClassVar[bool] = False
    needs_excitation: ClassVar[bool] = True
    of_states: ClassVar[bool] = False

    @abstractmethod
    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """The coefficients of a structure; `data` are the regressors of `records` as measured."""

    @classmethod
    def default(cls) -> Method:
        """Return the method for the shorthand."""
        return cls()


def known_methods() -> dict[str, type[Method]]:
    """Return every estimator by its shorthand: the exports of `identification.methods`, then
    subclasses defined elsewhere.

    Raises `InputError` where two of them have one shorthand.
    """
    return named_subclasses(Method, "shorthand", "symheli.methods", exported_methods())


def exported_methods() -> list[type[Method]]:
    """Return the estimators that `identification.methods` exports; loads none from elsewhere."""
    from identification import methods

    exports = [getattr(methods, name) for name in dir(methods)]
    known = [each for each in exports if isinstance(each, type) and issubclass(each, Method)]
    return [each for each in known if "shorthand" in vars(each)]


def method_of(value: Method | str) -> Method:
    """A method, or the defaults of the one a shorthand names.

    Raises `UnknownNameError` for any other string, `InputError` for anything else.
    """
    if isinstance(value, Method):
        if not hasattr(value, "shorthand"):
            name = type(value).__name__
            raise InputError(f"method {name}: give the class a name, such as shorthand = {name!r}")
        return value
    known = known_methods()
    if not isinstance(value, str):
        raise InputError(
            f"method: expected one of {', '.join(known)}, or a method with its options such as"
            f" Ridge(weight=0.1), got {value!r:.80}"
        )
    if value not in known:
        raise UnknownNameError("method", value, tuple(known))
    return known[value].default()


def not_settled(method: Method, advice: str) -> ConvergenceWarning:
    """The remark of an iteration that stops early, with what to try."""
    return ConvergenceWarning(f"{method.shorthand!r} did not settle: {advice}")
