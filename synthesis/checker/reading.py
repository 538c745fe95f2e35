"""What a file holds, with every value checked: numbers are the rationals that its doubles are.

The schema and the kind are read in `opened`, and nowhere else.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from .functions import Basis, BSplines, Cubics, Functions, Legendre, Powers
from .polynomials import Polynomial, combined, matrix

MOST_FUNCTIONS = 100_000
"""Products of functions that a basis may have before those of too large a degree are left out."""
HIGHEST_DEGREE = 60
"""Highest degree of a polynomial that is read."""


class Unreadable(Exception):
    """The file is damaged, or not of a kind that is known; the message is a sentence."""


def opened(path: str) -> tuple[str, Mapping[str, Any]]:
    """Return (kind, fields) of a file."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise Unreadable(f"the file cannot be read: {error.strerror or error}") from None
    except ValueError:
        raise Unreadable("the file is not a text in UTF-8") from None
    try:
        content = json.loads(text, parse_constant=_refused)
    except (ValueError, RecursionError) as error:
        raise Unreadable(f"the file is no JSON: {error}") from None
    if not isinstance(content, dict):
        raise Unreadable("the file holds no statement")
    known = {("symheli certificate", 1), ("symheli set", 1), ("symheli statement", 2)}
    schema, version = content.get("schema"), content.get("version")
    if schema == "symheli tube":
        return "tube", content
    if isinstance(version, bool) or (schema, version) not in known:
        raise Unreadable(f"the schema {schema!r:.40} in version {version!r:.20} is not known")
    return text_of(content, "kind"), content


def _refused(constant: str) -> None:
    raise ValueError(f"{constant} is not JSON")


def field(content: Any, name: str) -> Any:
    """Return a field of an object."""
    if not isinstance(content, dict) or name not in content:
        raise Unreadable(f"the file is damaged: there is no {name} where one is expected")
    return content[name]


def text_of(content: Any, name: str) -> str:
    """Return a field that is a text."""
    value = field(content, name)
    if not isinstance(value, str):
        raise Unreadable(f"the file is damaged: {name} is no text")
    return value


def kind_of(value: Any) -> str:
    """Return the type of an object."""
    return text_of(value, "type")


def items(value: Any, name: str) -> list[Any]:
    """Return a list."""
    if not isinstance(value, list):
        raise Unreadable(f"the file is damaged: {name} is no list")
    return value


def number(value: Any, name: str) -> Fraction:
    """Return a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise Unreadable(f"the file is damaged: {name} is no finite number")
    try:
        return Fraction(float(value))
    except (OverflowError, ValueError):
        raise Unreadable(f"the file is damaged: {name} is no finite number") from None


def limit(value: Any, name: str) -> Fraction | None:
    """Return a number >= 0; None where it is infinite."""
    if value == {"float": "inf"}:
        return None
    found = number(value, name)
    if found < 0:
        raise Unreadable(f"the file is damaged: {name} is below zero")
    return found


def whole(value: Any, name: str, least: int, most: int = HIGHEST_DEGREE) -> int:
    """Return an integer within limits."""
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise Unreadable(f"the file is damaged: {name} is no integer from {least} to {most}")
    return value


def ascending(values: Any, name: str, least: int = 2) -> tuple[Fraction, ...]:
    """Return numbers that increase."""
    if isinstance(values, dict):
        found = tuple(array(values, name, None))
    else:
        found = tuple(number(v, name) for v in items(values, name))
    if len(found) < least or any(b <= a for a, b in pairwise(found)):
        raise Unreadable(f"the file is damaged: {name} do not increase, or are too few")
    return found


def array(value: Any, name: str, *shape: int | None) -> list[Any]:
    """Return an array (nested lists of numbers) of this shape; None: of any length there."""
    lengths = items(field(value, "shape"), f"the shape of {name}")
    flat = [number(v, name) for v in items(field(value, "array"), name)]
    fits = len(lengths) == len(shape) and all(
        not isinstance(n, bool) and isinstance(n, int) and n >= 0 and (m is None or n == m)
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


def names(value: Any, name: str) -> tuple[str, ...]:
    """Return the names of signals, which are different."""
    found = tuple(text_of(each, "signal") for each in items(value, name))
    if len(set(found)) < len(found):
        raise Unreadable(f"the file is damaged: two {name} have one name")
    return found


class Parameter(NamedTuple):
    """Range of a parameter, and the limit of its rate, 1/s (None: any): or `tie`, the number of the
    parameter that is its rate.
    """

    low: Fraction
    high: Fraction
    rate: Fraction | None
    tie: int | None

    @property
    def width(self) -> Fraction:
        """Length of the range."""
        return self.high - self.low


def parameters(value: Any) -> tuple[Parameter, ...]:
    """Return the parameters of a model, with their own rates."""
    every = items(value, "parameters")
    called = [text_of(each, "name") for each in every]
    found = []
    for each in every:
        low, high = number(field(each, "low"), "low"), number(field(each, "high"), "high")
        rate, tie = field(each, "rate"), None
        if isinstance(rate, str):
            if rate not in called or called.index(rate) == len(found):
                raise Unreadable("the file is damaged: a rate is no other parameter")
            rate, tie = {"float": "inf"}, called.index(rate)
        if not low < high:
            raise Unreadable("the file is damaged: the range of a parameter is empty")
        found.append(Parameter(low, high, limit(rate, "a rate"), tie))
    if not found or len(set(called)) < len(called):
        raise Unreadable("the file is damaged: no parameters, or two of one name")
    if any(p.tie is not None and found[p.tie].tie is not None for p in found):
        raise Unreadable("the file is damaged: a rate is a parameter whose rate is another")
    return tuple(found)


def basis(value: Any) -> Basis:
    """Return the functions of a model."""
    if kind_of(value) != "Product":
        return Basis([_functions(value)])
    factors = [_functions(each) for each in items(field(value, "factors"), "factors")]
    total = field(value, "total_degree")
    if total is not None:
        total = whole(total, "total_degree", 0)
    if total is not None and not all(isinstance(f, Legendre) for f in factors):
        raise Unreadable("the file is damaged: a total degree is for polynomials")
    if len(factors) < 2 or math.prod(f.size for f in factors) > MOST_FUNCTIONS:
        raise Unreadable("the products of functions are fewer than two or too many")
    return Basis(factors, total)


def _functions(value: Any) -> Functions:
    kind = kind_of(value)
    if kind == "Polynomial":
        low, high = number(field(value, "low"), "low"), number(field(value, "high"), "high")
        if not low < high:
            raise Unreadable("the file is damaged: the range of a polynomial is empty")
        return Legendre(whole(field(value, "degree"), "degree", 0), low, high)
    if kind == "BSpline":
        degree = whole(field(value, "degree"), "degree", 1)
        return BSplines(degree, ascending(field(value, "breakpoints"), "breakpoints"))
    if kind == "PiecewiseLinear":
        return BSplines(1, ascending(field(value, "nodes"), "nodes"))
    if kind in ("Spline", "CubicSpline"):
        return Cubics(ascending(field(value, "nodes"), "nodes", 4))
    if kind == "Patches":
        degree = whole(field(value, "degree"), "degree", 0)
        return Powers(degree, ascending(field(value, "breaks"), "breaks"))
    raise Unreadable(f"functions of the kind {kind!r:.40} are not known")


@dataclass(frozen=True)
class Model:
    """dx/dt = A x + B u (sampled: x(k+1)), y = C x + D u, each matrix the sum of f_j(p) M_j."""

    basis: Basis
    matrices: Mapping[str, tuple[Polynomial, ...]]
    parameters: tuple[Parameter, ...]
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    dt: Fraction | None

    @classmethod
    def read(cls, value: Any) -> Model:
        """Return the model that a file holds."""
        if kind_of(value) != "LPVStateSpace":
            raise Unreadable("the file is damaged: there is no model where one is expected")
        own, functions = parameters(field(value, "parameters")), basis(field(value, "basis"))
        x, u, y = (names(field(value, name), name) for name in ("states", "inputs", "outputs"))
        if len(functions.factors) != len(own):
            raise Unreadable("the file is damaged: functions of another number of parameters")
        for f, p in zip(functions.factors, own, strict=True):
            # the end polynomials go on where rounding takes p beyond them
            slack = p.width / 10**9
            if f.breaks[0] > p.low + slack or f.breaks[-1] < p.high - slack:
                raise Unreadable("the file is damaged: the functions do not cover the range")
        count = sum(1 for _ in functions.indices)
        sizes = {"A": (x, x), "B": (x, u), "C": (y, x), "D": (y, u)}
        matrices = {
            name: tuple(
                matrix(M, len(columns))
                for M in array(field(value, name), name, count, len(rows), len(columns))
            )
            for name, (rows, columns) in sizes.items()
        }
        return cls(functions, matrices, own, x, u, y, period(field(value, "dt")))

    def on(self, middle: Sequence[Fraction], p: Sequence[Polynomial]) -> tuple[Polynomial, ...]:
        """Return A, B, C, D on the box around `middle`, at the polynomials p."""
        functions = self.basis.on(middle, p)
        return tuple(combined(functions, own) for own in self.matrices.values())

    def same_range(self, other: Model) -> bool:
        """Whether the parameters have the ranges of another model's."""
        return [p[:2] for p in self.parameters] == [p[:2] for p in other.parameters]

    def breaks(self, axis: int) -> tuple[Fraction, ...]:
        """Return where the polynomials change along a parameter."""
        return self.basis.factors[axis].breaks


def period(value: Any) -> Fraction | None:
    """Return a sample period, s; None for continuous time."""
    if value is None:
        return None
    dt = number(value, "dt")
    if not dt > 0:
        raise Unreadable("the file is damaged: the sample period is not above zero")
    return dt


def bound_of(kind: str, content: Any) -> Fraction:
    """Return the bound that a certificate claims; 0 of stability, which has none."""
    if kind == "stability":
        return Fraction(0)
    bound = number(field(content, "alpha" if kind == "decay rate" else "gamma"), "the bound")
    if bound < 0:
        raise Unreadable("the file is damaged: the bound is below zero")
    return bound
