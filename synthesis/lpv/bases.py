"""The functions of p that X and Y are made of: what was asked for, or what may move with what."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from symheli.errors import InputError
from symheli.lpv import FunctionSpace, Scheduling
from symheli.lpv.bases.polynomials import factors_of, polynomials

Dependence = int | tuple[int, ...] | FunctionSpace
"""Of X or Y on the parameters: a degree for all, one each, or the functions themselves."""
DEGREES = {1: (2, 4, 6, 8), 2: (2, 4)}
"""Degrees of the function that depends on p, tried in turn while gamma falls (more parameters: 2).
"""


def moves(parameters: Sequence[Scheduling]) -> bool:
    """Whether any of them may change."""
    return any(isinstance(s.rate, str) or s.rate > 0 for s in parameters)


def used(basis: FunctionSpace) -> list[bool]:
    """Which parameters the functions depend on."""
    return [factor.size > 1 for factor in factors_of(basis)]


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

    def untold(self, parameters: Sequence[Scheduling]) -> list[str]:
        """Parameters of a rate that is a number > 0 with which X and Y both move: a controller
        would have to be told dp/dt.
        """
        if self.X is None or self.Y is None:
            return []
        both = zip(parameters, used(self.X), used(self.Y), strict=True)
        return [s.name for s, x, y in both if x and y and not _known(s)]

    def __str__(self) -> str:
        said = [
            f"{name} {_said(basis)}"
            for name, basis in (("X", self.X), ("Y", self.Y))
            if basis is not None
        ]
        return ", ".join(said)


def _said(basis: FunctionSpace) -> str:
    if basis.size == 1:
        return "constant"
    return f"of degree {'x'.join(map(str, basis.degrees))}" if basis.degrees else f"in {basis.size}"


def functions(given: Dependence, parameters: Sequence[Scheduling], name: str) -> FunctionSpace:
    """The basis that was asked for; `InputError` for a degree below zero, a wrong number of them,
    or functions of another range.
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
    """The basis, checked: what may jump must not be in it."""
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
    """The pairs that are tried: what was asked for, else one of the two moving, of this degree,
    then the other, with the parameters that the plant depends on.

    Both may move with a parameter that stands still, and with one whose rate is another parameter:
    then the controller knows how they move. Where both were asked for they may move with others too
    (`Bases.untold`), of which dp/dt is then neglected. Raises `InputError` where that has no proof:
    in discrete time, and beside a rate that is another parameter.
    """
    free = [_known(s) for s in parameters]
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
        untold = shape.untold(parameters)
        if untold and any(isinstance(s.rate, str) for s in parameters):
            raise InputError(
                f"X and Y both depend on {', '.join(untold)}: the controller would need its rate,"
                " which can be neglected only where no rate is another parameter; let one of X and"
                f" Y be of degree 0 in {', '.join(untold)}, or give numbers as rates,"
                " .with_rate(...)"
            )
        out.append(shape)
    return out


def _known(s: Scheduling) -> bool:
    """Whether a controller knows dp/dt."""
    return isinstance(s.rate, str) or s.rate == 0


def both_moving(
    parameters: Sequence[Scheduling], matters: Sequence[bool], degree: int
) -> list[Bases]:
    """X and Y of this degree in every parameter of a limited rate; nothing where none moves, or
    one whose rate is another.
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
    """Functions of X or Y where there is only one of them: by default of this degree in what the
    plant depends on and may not jump; `still`: nor move.
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
