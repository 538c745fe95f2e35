"""Reading of a file, every value checked: numbers are the rationals that its doubles are.

The schema and the kind are read in `opened`, and nowhere else.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from itertools import product as combinations
from pathlib import Path
from typing import Any, NamedTuple

from .functions import BSplines, Cubics, Functions, Legendre, Powers
from .polynomials import Polynomial, combined, matrix, scalar

SCHEMAS = (("symheli certificate", 1), ("symheli set", 1), ("symheli statement", 2))
TUBE = "symheli tube"
INFINITE = {"float": "inf"}
MOST_FUNCTIONS, HIGHEST_DEGREE = 100_000, 60
"""Products of functions, and degree of a polynomial, beyond which nothing is read."""


class Unreadable(Exception):
    """The file is damaged, or not of a kind that is known; the message is a sentence."""


DAMAGED = (TypeError, ValueError, LookupError, ArithmeticError, AttributeError, RecursionError)
"""Errors that values of a damaged file raise beside."""


def opened(path: str) -> tuple[str, Mapping[str, Any]]:
    """Return (kind, fields) of a file."""
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"), parse_constant=_refused)
    except OSError as error:
        raise Unreadable(f"the file cannot be read: {error.strerror or error}") from None
    except (ValueError, RecursionError) as error:
        raise Unreadable(f"the file is no JSON: {error}") from None
    if not isinstance(content, dict):
        raise Unreadable("the file holds no statement")
    schema, version, kind = (content.get(name) for name in ("schema", "version", "kind"))
    if schema == TUBE:
        return TUBE, content
    if isinstance(version, bool) or (schema, version) not in SCHEMAS:
        raise Unreadable(f"the schema {schema!r:.40} in version {version!r:.20} is not known")
    return str(kind), content


def _refused(constant: str) -> None:
    raise ValueError(f"{constant} is not JSON")


def number(value: Any, name: str) -> Fraction:
    """Return a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise Unreadable(f"the file is damaged: {name} is no finite number")
    return Fraction(float(value))


def limit(value: Any, name: str) -> Fraction | None:
    """Return a number >= 0; None where it is infinite."""
    found = None if value == INFINITE else number(value, name)
    if found is not None and found < 0:
        raise Unreadable(f"the file is damaged: {name} is below zero")
    return found


def whole(value: Any, name: str, least: int, most: int = HIGHEST_DEGREE) -> int:
    """Return an integer within limits."""
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise Unreadable(f"the file is damaged: {name} is no integer from {least} to {most}")
    return value


def ascending(values: Any, name: str, least: int = 2) -> tuple[Fraction, ...]:
    """Return numbers that increase, of a list or an array."""
    own = array(values, name, None) if isinstance(values, dict) else values
    found = tuple(v if isinstance(v, Fraction) else number(v, name) for v in own)
    if len(found) < least or any(b <= a for a, b in pairwise(found)):
        raise Unreadable(f"the file is damaged: {name} do not increase, or are too few")
    return found


def array(value: Any, name: str, *shape: int | None) -> list[Any]:
    """Return an array (nested lists of numbers) of this shape; None: of any length there."""
    lengths, flat = list(value["shape"]), [number(v, name) for v in value["array"]]
    fits = len(lengths) == len(shape) and all(
        whole(n, "a shape", 0, 10**9) == (n if m is None else m)
        for n, m in zip(lengths, shape, strict=True)
    )
    if not fits or math.prod(lengths) != len(flat):
        expected = " x ".join("any" if m is None else str(m) for m in shape)
        raise Unreadable(f"the file is damaged: {name} is no array of {expected} numbers")

    def nested(values: list[Any], sizes: Sequence[int]) -> list[Any]:
        if len(sizes) < 2:
            return values
        step = math.prod(sizes[1:])
        return [nested(values[i * step : (i + 1) * step], sizes[1:]) for i in range(sizes[0])]

    return nested(flat, lengths)


def names(value: Any) -> tuple[str, ...]:
    """Return the names of signals, which are different."""
    found = tuple(str(each["signal"]) for each in value)
    if len(set(found)) < len(found):
        raise Unreadable("the file is damaged: two signals have one name")
    return found


def period(value: Any) -> Fraction | None:
    """Return a sample period, s; None for continuous time."""
    dt = None if value is None else number(value, "dt")
    if dt is not None and dt <= 0:
        raise Unreadable("the file is damaged: the sample period is not above zero")
    return dt


def bound_of(kind: str, content: Any) -> Fraction:
    """Return the bound that a certificate claims; 0 of stability, which has none."""
    if kind == "stability":
        return Fraction(0)
    bound = limit(content["alpha" if kind == "decay rate" else "gamma"], "the bound")
    if bound is None:
        raise Unreadable("the file claims no bound")
    return bound


class Parameter(NamedTuple):
    """Range of a parameter, and the limit of its rate, 1/s (None: any): or `tie`, the number of the
    parameter that is its rate.
    """

    low: Fraction
    high: Fraction
    rate: Fraction | None
    tie: int | None


def parameters(value: Any) -> tuple[Parameter, ...]:
    """Return the parameters of a model, with their own rates."""
    called, found = [str(each["name"]) for each in value], []
    for each in value:
        low, high = ascending([each["low"], each["high"]], "the ends of a range")
        tie = called.index(each["rate"]) if isinstance(each["rate"], str) else None
        rate = None if tie is not None else limit(each["rate"], "a rate")
        found.append(Parameter(low, high, rate, tie))
    if not found or len(set(called)) < len(called):
        raise Unreadable("the file is damaged: no parameters, or two of one name")
    if any(p.tie is not None and found[p.tie].tie is not None for p in found):
        raise Unreadable("the file is damaged: the rate of a rate is a parameter")
    return tuple(found)


def _functions(value: Any) -> Functions:
    kind = value["type"]
    if kind in ("Spline", "CubicSpline"):
        return Cubics(ascending(value["nodes"], "nodes", 4))
    if kind == "PiecewiseLinear":
        return BSplines(1, ascending(value["nodes"], "nodes"))
    degree = whole(value["degree"], "a degree", 1 if kind == "BSpline" else 0)
    if kind == "Polynomial":
        return Legendre(degree, *ascending([value["low"], value["high"]], "the ends of a range"))
    if kind == "BSpline":
        return BSplines(degree, ascending(value["breakpoints"], "breakpoints"))
    if kind == "Patches":
        return Powers(degree, ascending(value["breaks"], "breaks"))
    raise Unreadable(f"functions of the kind {kind!r:.40} are not known")


@dataclass(frozen=True)
class Model:
    """dx/dt = A x + B u (sampled: x(k+1)), y = C x + D u, each matrix the sum of f_j(p) M_j, f_j
    products of functions of each parameter (`indices`), the last one's fastest.
    """

    factors: Sequence[Functions]
    indices: Sequence[tuple[int, ...]]
    matrices: Mapping[str, tuple[Polynomial, ...]]
    parameters: tuple[Parameter, ...]
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    dt: Fraction | None

    @classmethod
    def read(cls, value: Any) -> Model:
        """Return the model that a file holds."""
        own, basis, total = parameters(value["parameters"]), value["basis"], None
        several = basis["type"] == "Product"
        factors = [_functions(each) for each in (basis["factors"] if several else [basis])]
        if several and basis["total_degree"] is not None:
            # of polynomials, just the products whose degrees add up to that at most
            total = whole(basis["total_degree"], "a total degree", 0)
        if total is not None and not all(isinstance(f, Legendre) for f in factors):
            raise Unreadable("the file is damaged: a total degree is for polynomials")
        if math.prod(f.size for f in factors) > MOST_FUNCTIONS:
            raise Unreadable("the products of functions are too many for this checker")
        every = combinations(*(range(f.size) for f in factors))
        indices = [k for k in every if total is None or sum(k) <= total]
        for f, p in zip(factors, own, strict=True):
            # the end polynomials go on where rounding takes p beyond them
            slack = (p.high - p.low) / 10**9
            if f.breaks[0] > p.low + slack or f.breaks[-1] < p.high - slack:
                raise Unreadable("the file is damaged: the functions do not cover the range")
        (x, u, y), matrices = (names(value[n]) for n in ("states", "inputs", "outputs")), {}
        for name, rows, columns in (("A", x, x), ("B", x, u), ("C", y, x), ("D", y, u)):
            each = array(value[name], name, len(indices), len(rows), len(columns))
            matrices[name] = tuple(matrix(M, len(columns)) for M in each)
        return cls(factors, indices, matrices, own, x, u, y, period(value["dt"]))

    def on(self, middle: Sequence[Fraction], p: Sequence[Polynomial]) -> tuple[Polynomial, ...]:
        """Return A, B, C, D on the box around `middle`, at the polynomials p."""
        each = [f.on(m, q) for f, m, q in zip(self.factors, middle, p, strict=True)]
        functions = []
        for k in self.indices:
            own = scalar(1)
            for of_one, i in zip(each, k, strict=True):
                own = own @ of_one[i]
            functions.append(own.reduced())
        return tuple(combined(functions, own) for own in self.matrices.values())

    @property
    def sizes(self) -> tuple[int, int, int, Fraction | None]:
        """Numbers of states, inputs and outputs, and the sample period."""
        return len(self.states), len(self.inputs), len(self.outputs), self.dt

    @property
    def ranges(self) -> list[tuple[Fraction, Fraction]]:
        """The range of each parameter."""
        return [(p.low, p.high) for p in self.parameters]
