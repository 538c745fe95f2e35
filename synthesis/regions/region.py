"""Regions of attraction: level sets of V from which every motion tends to 0."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any, ClassVar

from symheli.errors import InputError
from symheli.threads import with_one_thread
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import whole
from symheli.values.summary import summarized
from synthesis.certify.questions.certificate_file import decoded, encoded
from synthesis.certify.statement.proven_statement import ProvenStatement
from synthesis.numerics.polynomial.multivariate import SparsePolynomial
from synthesis.numerics.program.cone_program import Solver, general_solver
from synthesis.regions.coordinates import (
    rises_at,
)
from synthesis.regions.equations import equations, function_of
from synthesis.regions.files import read_proof, read_terms, written_proof, written_terms
from synthesis.regions.growth import grown, quadratic
from synthesis.regions.levels import NOTHING, LevelSearch
from synthesis.regions.proof import RegionProof, why_not


@dataclass(frozen=True, eq=False)
class RegionOfAttraction(ProvenStatement):
    """The set V(x) <= level, from which every motion of dx/dt = f(x) tends to 0 and never leaves.

    Made by `region_of_attraction`; `verify` proves it again from these fields alone.

    Attributes
    ----------
    states : tuple of str
        Names of x.
    f : tuple of SparsePolynomial
        dx/dt, with the rationals that the coefficients given are.
    V : SparsePolynomial
        The Lyapunov function.
    level : float
        The proven level, in units of V; inf: all of them, 0: none.
    point : array (n,) or None
        A state other than 0 where dV/dt >= 0 in exact arithmetic; None where none was found.
    proof : RegionProof or None
        Coordinates and sums of squares; see `synthesis.regions.proof`.
    verified : bool
        The sums of squares hold in rational arithmetic.
    why : str
        Why there is no proof; empty where there is one.

    Raises
    ------
    InputError
        `save` of a region without a proof, `load` of a file that is damaged or another.

    Examples
    --------
    >>> import sympy
    >>> x = sympy.Symbol("x")
    >>> found = synthesis.regions.region_of_attraction({x: -x + x**3}, x**2)
    >>> found.verified, bool(0.999 < found.level < 1), found.contains([0.9])
    (True, True, True)
    """

    states: tuple[str, ...]
    f: tuple[SparsePolynomial, ...]
    V: SparsePolynomial
    level: float
    point: Array | None
    proof: RegionProof | None
    verified: bool
    why: str = ""
    reader: ClassVar[str] = "region-of-attraction"

    __repr__ = summarized

    def verify(self, rigorous: bool = True) -> bool:
        """Check the sums of squares again, in rational arithmetic always."""
        return not self._refused()

    def _refused(self) -> str:
        if self.proof is None:
            return self.why or NOTHING
        if any((0,) * len(self.states) in p.terms for p in (self.V, *self.f)):
            return "f and V are not 0 at 0"
        return why_not(self.V, self.V.along(self.f), self.level, self.proof)

    @cached_property
    def ceiling(self) -> float:
        """V at `point`, rounded up: this V proves no higher level; inf without a point."""
        if self.point is None:
            return math.inf
        exact = self.V.value([Fraction(float(v)) for v in self.point])
        value = float(exact)
        return value if Fraction(value) >= exact else math.nextafter(value, math.inf)

    def values(self, x: Any) -> Array:
        """V of states (..., n)."""
        x = frozen(x, "x")
        if x.shape[-1:] != (len(self.states),):
            raise InputError(f"x: expected {len(self.states)} states along the last axis, got"
                             f" shape {x.shape}")  # fmt: skip
        return self.V.values(x)

    def contains(self, x: Any) -> bool:
        """Whether the state x (n,) lies in the proven region, in exact arithmetic."""
        x = frozen(x, "x", (len(self.states),))
        value = self.V.value([Fraction(float(v)) for v in x])
        return self.verified and (math.isinf(self.level) or value <= Fraction(self.level))

    @property
    def bound(self) -> float:
        """The proven level."""
        return self.level

    @property
    def claim(self) -> str:
        """The claim in one sentence, with numbers."""
        if math.isinf(self.level):
            return "every motion tends to 0, wherever it starts"
        return f"every motion from V(x) <= {self.level!r} stays there and tends to 0"

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, each a sentence made from the numbers of the proof."""
        own = zip(self.states, self.f, strict=True)
        return (
            *(f"d{name}/dt = {each.text(self.states)}" for name, each in own),
            f"V = {self.V.text(self.states)}",
        )

    @property
    def facts(self) -> Mapping[str, Any]:
        """Kind, bounds and conditions as data that JSON holds."""
        level = self.level if math.isfinite(self.level) else "inf"
        return {"kind": "region of attraction", "level": level, "states": list(self.states)}

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file: equations, V and the sums of squares."""
        if not self.verified or self.proof is None:
            raise InputError(f"only a proven region is saved; here {self.why}")
        return {
            "kind": "region of attraction",
            "states": list(self.states),
            "f": [written_terms(p) for p in self.f],
            "V": written_terms(self.V),
            "level": encoded(self.level),
            "point": encoded(self.point),
            **written_proof(self.proof),
        }

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> RegionOfAttraction:
        """Return the region of a file, proven anew."""
        states = tuple(map(str, content["states"]))
        n, level = len(states), decoded(content["level"])
        if len(set(states)) < n or len(content["f"]) != n or not isinstance(level, float | int):
            raise InputError("states: expected different names, one for each of f, and a level")
        f = tuple(read_terms(each, n) for each in content["f"])
        V, point = read_terms(content["V"], n), decoded(content["point"])
        if point is not None:
            point = frozen(point, "point", (n,))
            if not rises_at(V.along(f), point):
                raise InputError("point: dV/dt is negative there")
        made = cls(
            states, f, V, float(level), point, read_proof(content, n), False, NOTHING
        )  # fmt: skip
        why = made._refused()
        return replace(made, verified=not why, why=why)

    def __str__(self) -> str:
        if not self.verified:
            return f"no region proven: {self.why}"
        beside = f"; V proves none above {self.ceiling:.6g}" if self.point is not None else ""
        return f"proven: {self.claim}{beside}"


@with_one_thread
def region_of_attraction(
    f: Any,
    V: Any = None,
    *,
    states: Any = None,
    degree: int = 2,
    multiplier_degree: int | None = None,
    solver: Solver | str = "CLARABEL",
) -> RegionOfAttraction:
    """The largest proven level of V from which every motion of a polynomial system tends to 0.

    Sums of squares are found in floating point, rounded, and checked in rational arithmetic:
    a level that is returned holds for the equations as given, without a tolerance.

    Parameters
    ----------
    f : mapping, sequence or casadi.Function
        {state: dx/dt} in SymPy; a list of SymPy or CasADi expressions, with their states; or a
        casadi.Function x -> dx/dt. Polynomials with f(0) = 0; a float is the rational that it is.
    V : expression, casadi.Function or array (n, n), optional
        Lyapunov function with V(0) = 0, or P of x'P x. Default: A'P + PA = -I of the linearization
        A where it is stable, else P = I.
    states : sequence, optional
        Symbols of SymPy, or the CasADi column in which f is written.
    degree : int
        Of V where none is given: 2, or 4, 6, ... for a V that grows from the quadratic one.
    multiplier_degree : int, optional
        Degree of the multiplier of level - V; default: the least one, raised where that pays.
    solver : Solver or str
        For the search; nothing of its answer is believed.

    Returns
    -------
    RegionOfAttraction
        `verified` says whether there is one, `why` why not; `ceiling` limits what V can prove.

    Raises
    ------
    InputError
        Equations that are no polynomials, f(0) or V(0) other than 0, degrees that are odd.

    References
    ----------
    Parrilo (2000), Structured semidefinite programs and semialgebraic geometry methods; Tan and
    Packard, IEEE Transactions on Automatic Control 53 (2008).

    Examples
    --------
    The Van der Pol oscillator in reversed time, with the V of its linearization.

    >>> import sympy
    >>> x, y = sympy.symbols("x y")
    >>> found = synthesis.regions.region_of_attraction({x: -y, y: x - (1 - x**2) * y})
    >>> print(f"{found.level:.4f} of {found.ceiling:.4f}")
    2.3045 of 2.3045
    """
    own, solver = equations(f, states), general_solver(solver)
    degree = _even(degree, "degree", 2)
    if multiplier_degree is not None:
        multiplier_degree = _even(multiplier_degree, "multiplier_degree", 0)
    if V is not None and degree != 2:
        raise InputError("degree: of a V that is not given; leave V or the degree out")
    function = quadratic(own.f) if V is None else function_of(V, own)
    if degree > 2:
        function = grown(own.f, function, degree, solver)
    found = LevelSearch(function, function.along(own.f), multiplier_degree, solver).found()
    level, proof, point, why = found
    return RegionOfAttraction(
        own.states, own.f, function, level, point, proof, proof is not None, why
    )


def _even(value: Any, name: str, least: int) -> int:
    degree = whole(value, name, least)
    if degree % 2:
        raise InputError(f"{name}: expected an even number, got {degree}")
    return degree
