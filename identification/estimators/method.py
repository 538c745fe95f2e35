"""What an estimator is to `fit`: options that hold together, and one way from regressors to
coefficients.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Regression
from symheli.errors import ConvergenceWarning, InputError, UnknownNameError
from symheli.records import FlightRecord
from symheli.values.arrays import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimate:
    """Coefficients `theta` (n_regressors, ny) and what there is to say about them.

    `details` are plain numbers and lists by name, `remarks` the warnings `fit` issues.
    `residual_covariance` (ny, ny) of the one-step residuals; None: that of the batch of regressors.
    """

    theta: Array
    details: Mapping[str, Any] = field(default_factory=dict)
    remarks: tuple[Warning, ...] = ()
    residual_covariance: Array | None = None


class Method(ABC):
    """An estimator with its options: a subclass in a file of its own, exported, is all `fit` needs.

    `shorthand` is the string that stands for its defaults, and what a model says it was fitted by.
    `needs_excitation`: the data alone must determine every coefficient, `fit` refuses them
    otherwise. False where a penalty decides what they leave open.
    """

    shorthand: ClassVar[str]
    needs_excitation: ClassVar[bool] = True

    @abstractmethod
    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """The coefficients of a structure; `data` are the regressors of `records` as measured."""

    @classmethod
    def default(cls) -> Method:
        """What the shorthand stands for."""
        return cls()


def method_of(value: Method | str) -> Method:
    """A method, or the defaults of the one a shorthand names.

    Raises `UnknownNameError` for any other string, `InputError` for anything else.
    """
    if isinstance(value, Method):
        return value
    known = {method.shorthand: method for method in _subclasses(Method)}
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
