"""A claim by a polynomial V: {V <= rho} is a region of attraction of x = 0."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from symheli.errors import InputError
from symheli.values.summary import summarized
from synthesis.claims.monomials import Monomials, monomials, rational, written


@dataclass(frozen=True, eq=False)
class RegionClaim:
    """The claim that every motion of x' = f(x) that starts in {V <= rho} tends to zero.

    Parameters
    ----------
    V : str or {exponents: number}
        A polynomial in the states of the plant, zero at zero.
    rho : float or str
        The level; a text such as "1/20" is that rational.

    Raises
    ------
    InputError
        For a level that is not above zero.

    Examples
    --------
    >>> RegionClaim("x^2", 0.5).sentence
    'every motion from V <= 0.5 tends to zero'
    """

    V: str | Mapping[tuple[int, ...], Any]
    rho: Any
    kind: ClassVar[str] = "region of attraction"

    __repr__ = summarized

    def __post_init__(self) -> None:
        rho = rational(self.rho)
        if rho <= 0:
            raise InputError(f"rho: expected a number > 0, got {self.rho!r:.60}")
        object.__setattr__(self, "rho", rho)

    @property
    def sentence(self) -> str:
        """The claim in words."""
        exact = f" ({self.rho})" if self.rho.denominator < 10**6 < self.rho.numerator else ""
        return f"every motion from V <= {float(self.rho)!r}{exact} tends to zero"

    def function(self, states: tuple[str, ...]) -> Monomials:
        """Return V as a polynomial in these states; raises `InputError` where V(0) is not 0."""
        V = monomials(self.V, states)
        if (0,) * len(states) in V or not V:
            raise InputError(f"V: expected a polynomial with V(0) = 0, got {written(V, states)}")
        return V

    def at_level(self, rho: Any) -> RegionClaim:
        """Return the claim at another level."""
        return replace(self, rho=rho)
