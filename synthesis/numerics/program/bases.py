"""The functions of p in X and Y: those that the user requested, or those that the rates permit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from symheli import Scheduling
from symheli.errors import InputError
from symheli.lpv.bases import FunctionSpace
from symheli.lpv.bases.polynomials import factors_of, polynomials
from symheli.values.arrays import Array

Dependence = int | tuple[int, ...] | FunctionSpace
"""Dependence of X or Y on the parameters: a degree for all, one each, or the functions themselves.
"""
MAX_DIVISIONS = 1000
"""Largest number of parts into which the range of a parameter may be divided."""
DEGREES = {1: (2, 4, 6, 8), 2: (2, 4)}
"""Degrees of the function that depends on p, tried in turn while gamma falls (more parameters: 2).
"""


def moves(parameters: Sequence[Scheduling]) -> bool:
    """Whether any of the parameters may change."""
    return any(isinstance(s.rate, str) or s.rate > 0 for s in parameters)


def used(basis: FunctionSpace) -> list[bool]:
    """Return for each parameter whether the functions depend on it."""
    return [factor.size > 1 for factor in factors_of(basis)]


def extreme_motions(
    parameters: Sequence[Scheduling], p: Array, matters: Sequence[bool], time: float = 1.0
) -> list[Array]:
    """Return every extreme dp/dt (K, m) at p (K, m), per `time` seconds.

    The rate is the value of another parameter where that is the rate, else both signs of the limit;
    it is zero for parameters that do not matter.
    """
    names = [s.name for s in parameters]
    choices: list[list[Array]] = []
    for s, counts in zip(parameters, matters, strict=True):
        if not counts:
            choices.append([np.zeros(len(p))])
        elif isinstance(s.rate, str):
            choices.append([time * p[:, names.index(s.rate)]])
        else:
            rates = (-s.rate, s.rate) if s.rate > 0 else (0.0,)
            choices.append([np.full(len(p), time * r) for r in rates])
    return [np.stack(choice, axis=1) for choice in product(*choices)]


@dataclass(frozen=True, eq=False)
class Bases:
    """Functions of X and of Y, either None where the problem has only the other."""

    X: FunctionSpace | None
    Y: FunctionSpace | None

    @property
    def size(self) -> int:
        """Number of functions of both."""
        return sum(basis.size for basis in (self.X, self.Y) if basis is not None)

    @property
    def by_y(self) -> bool:
        """Whether Y alone depends on p."""
        moving = [basis is not None and basis.size > 1 for basis in (self.X, self.Y)]
        return moving == [False, True]

    def unmeasured_rates(self, parameters: Sequence[Scheduling]) -> list[str]:
        """Names of the parameters with a finite rate > 0 on which X and Y both depend: the
        controller would need dp/dt.
        """
        if self.X is None or self.Y is None:
            return []
        both = zip(parameters, used(self.X), used(self.Y), strict=True)
        return [s.name for s, x, y in both if x and y and not _rate_known(s)]

    def __str__(self) -> str:
        texts = [
            f"{name} {_described(basis)}"
            for name, basis in (("X", self.X), ("Y", self.Y))
            if basis is not None
        ]
        return ", ".join(texts)


def _described(basis: FunctionSpace) -> str:
    if basis.size == 1:
        return "constant"
    return f"of degree {'x'.join(map(str, basis.degrees))}" if basis.degrees else f"in {basis.size}"


def functions(given: Dependence, parameters: Sequence[Scheduling], name: str) -> FunctionSpace:
    """Return the requested basis; `InputError` for a degree below zero, a wrong number of them, or
    functions of another range.
    """
    box = [(s.low, s.high) for s in parameters]
    if isinstance(given, FunctionSpace):
        if given.dimension != len(box):
            raise InputError(f"{name}: expected functions of {len(box)} parameter(s), got {given}")
        return given
    degrees = given if isinstance(given, tuple) else (given,) * len(box)
    whole = all(isinstance(d, int) and not isinstance(d, bool) and d >= 0 for d in degrees)
    if len(degrees) != len(box) or not whole:
        raise InputError(
            f"{name}: expected a degree >= 0, one for each of"
            f" {', '.join(s.name for s in parameters)}, or functions of them; got {given!r:.60}"
        )
    return polynomials(degrees, box)


def limited(basis: FunctionSpace, parameters: Sequence[Scheduling], name: str) -> FunctionSpace:
    """Return the basis; raise `InputError` if it depends on a parameter that may jump."""
    for s, moves in zip(parameters, used(basis), strict=True):
        if moves and not isinstance(s.rate, str) and math.isinf(s.rate):
            raise InputError(
                f"{name} cannot depend on {s.name}, which may jump: give its rate, or degree 0"
            )
    return basis


def candidates(
    parameters: Sequence[Scheduling],
    X: Dependence | None,
    Y: Dependence | None,
    sampled: bool,
    matters: Sequence[bool],
    degree: int = DEGREES[1][0],
) -> list[Bases]:
    """Return the pairs of bases to try: the requested ones, else first one of X and Y with this
    degree in the parameters that the plant depends on, then the other.

    Both may depend on a constant parameter, and on one whose rate is another parameter: then the
    controller knows dp/dt. If the user requests both they may also depend on others
    (`Bases.unmeasured_rates`), whose dp/dt is then neglected. Raises `InputError` where that has no
    proof: in discrete time, and beside a rate that is another parameter.
    """
    free = [_rate_known(s) for s in parameters]
    jumps = [not isinstance(s.rate, str) and math.isinf(s.rate) for s in parameters]
    both = tuple(degree if f and m else 0 for f, m in zip(free, matters, strict=True))
    one = tuple(degree if m and not j else 0 for j, m in zip(jumps, matters, strict=True))
    pairs: list[tuple[Dependence, Dependence]] = []
    if X is not None or Y is not None:
        pairs = [(both if X is None else X, both if Y is None else Y)]
    elif sampled and any(isinstance(s.rate, str) or s.rate > 0 for s in parameters):
        pairs = [(0, one)]
    elif both == one:
        pairs = [(one, one)]
    else:
        pairs = [(both, one), (one, both)]
    out = []
    for x, y in pairs:
        bases = [
            limited(functions(d, parameters, n), parameters, n) for d, n in ((x, "X"), (y, "Y"))
        ]
        for s, in_x in zip(parameters, used(bases[0]), strict=True):
            if sampled and in_x and (isinstance(s.rate, str) or s.rate > 0):
                raise InputError(
                    f"in discrete time X cannot depend on {s.name}: the controller would need its"
                    " next value; let Y depend on it"
                )
        shape = Bases(*bases)
        names = shape.unmeasured_rates(parameters)
        if names and any(isinstance(s.rate, str) for s in parameters):
            raise InputError(
                f"X and Y both depend on {', '.join(names)}: the controller would need its rate,"
                " which can be neglected only where no rate is another parameter; let one of X and"
                f" Y be of degree 0 in {', '.join(names)}, or give numbers as rates,"
                " .with_rate(...)"
            )
        out.append(shape)
    return out


def _rate_known(s: Scheduling) -> bool:
    """Whether dp/dt is known to the controller."""
    return isinstance(s.rate, str) or s.rate == 0


def both_moving(
    parameters: Sequence[Scheduling], matters: Sequence[bool], degree: int
) -> list[Bases]:
    """Return X and Y of this degree in every parameter with a finite rate; nothing where no
    parameter moves, or one is the rate of another.
    """
    rates = [s.rate for s in parameters if not isinstance(s.rate, str)]
    if len(rates) < len(parameters) or not any(0 < rate < math.inf for rate in rates):
        return []
    degrees = tuple(
        degree if m and rate != math.inf else 0 for rate, m in zip(rates, matters, strict=True)
    )
    return [Bases(*(functions(degrees, parameters, name) for name in ("X", "Y")))]


def dependence(
    given: Dependence | None,
    parameters: Sequence[Scheduling],
    name: str,
    matters: Sequence[bool],
    degree: int = DEGREES[1][0],
    *,
    still: bool = False,
) -> FunctionSpace:
    """Return the functions of X or Y where there is only one of them: by default of this degree in
    the parameters that the plant depends on and that may not jump; `still`: in constant ones only.
    """
    degrees = tuple(
        degree if m and (s.rate == 0 if still else s.rate != math.inf) else 0
        for s, m in zip(parameters, matters, strict=True)
    )
    basis = limited(
        functions(degrees if given is None else given, parameters, name), parameters, name
    )
    for s, moves in zip(parameters, used(basis), strict=True):
        if still and moves and s.rate != 0:
            raise InputError(
                f"in discrete time {name} cannot depend on {s.name}: the gains would need its next"
                " value"
            )
    return basis
