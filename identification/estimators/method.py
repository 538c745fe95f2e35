"""Interface of an estimator to `fit`: validated options, and one call from regressors to
coefficients.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from inspect import isabstract
from typing import Any, ClassVar

from identification.model.noise_model import NoiseModel
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Regression
from symheli.errors import ConvergenceWarning, InputError, UnknownNameError
from symheli.records import FlightRecord
from symheli.values.arrays import Array
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
    """An estimator with its options; a subclass in a file of its own, exported, is all that `fit`
    needs.

    Attributes
    ----------
    shorthand : str
        Stands for the defaults, and is what a model says it was fitted by.
    needs_excitation : bool
        The data alone must determine every coefficient, `fit` refuses them otherwise. False where a
        penalty decides what they leave open.

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
    needs_excitation: ClassVar[bool] = True

    @abstractmethod
    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """The coefficients of a structure; `data` are the regressors of `records` as measured."""

    @classmethod
    def default(cls) -> Method:
        """Return the method for the shorthand."""
        return cls()


def method_of(value: Method | str) -> Method:
    """A method, or the defaults of the one a shorthand names.

    Raises `UnknownNameError` for any other string, `InputError` for anything else.
    """
    if isinstance(value, Method):
        return value
    known = {m.shorthand: m for m in _subclasses(Method) if not isabstract(m)}
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


def _subclasses(parent: type[Method]) -> Iterator[type[Method]]:
    for child in parent.__subclasses__():
        yield child
        yield from _subclasses(child)
