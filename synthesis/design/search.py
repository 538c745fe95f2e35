"""From a plant to X(p), Y(p) and the gains they promise: which of them moves, how far from the
least gamma, in a stated order.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from symheli.errors import InputError
from symheli.lpv import FunctionSpace, Scheduling
from symheli.lpv.bases.polynomials import polynomials
from symheli.progress import tracked
from synthesis.certificate import Attempt
from synthesis.design.coordinates import Coordinates
from synthesis.design.existence import Existence, Found
from synthesis.design.motions import used
from synthesis.program.cone_program import Solver
from synthesis.worst.frozen import norm

Array = np.ndarray

Dependence = int | tuple[int, ...] | FunctionSpace
"""Of X or Y on the parameters: a degree for all, one each, or the functions themselves."""

BACK_OFF = (1.02, 1.05, 1.2, 1.5)
"""Multiples of the least gamma at which X and Y are settled, tried in turn."""
SLACK = 1e-3
"""By which the frozen gain of a controller may exceed what was promised: rounding."""
USUAL = 2
"""Degree of the one that moves."""
FAR = 30.0
"""A gamma this many times larger or smaller than the unit of performance asks for another unit."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Functions of X and of Y, either None where the problem has only the other."""

    X: FunctionSpace | None
    Y: FunctionSpace | None

    @property
    def by_y(self) -> bool:
        """Whether Y alone depends on p."""
        moving = [basis is not None and basis.size > 1 for basis in (self.X, self.Y)]
        return moving == [False, True]

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


def shapes(
    parameters: Sequence[Scheduling],
    X: Dependence | None,
    Y: Dependence | None,
    sampled: bool,
    matters: Sequence[bool],
) -> list[Shape]:
    """The pairs that are tried: what was asked for, else one of the two moving, then the other,
    with the parameters that the plant depends on.

    Both may move with a parameter that stands still, and with one whose rate is another parameter:
    then the controller knows how they move. Raises `InputError` where it would need dp/dt.
    """
    free = [isinstance(s.rate, str) or s.rate == 0 for s in parameters]
    jumps = [not isinstance(s.rate, str) and math.isinf(s.rate) for s in parameters]
    both = tuple(USUAL if f and m else 0 for f, m in zip(free, matters, strict=True))
    one = tuple(USUAL if m and not j else 0 for j, m in zip(jumps, matters, strict=True))
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
        for s, in_x, in_y, alone in zip(parameters, *map(used, bases), free, strict=True):
            if in_x and in_y and not alone:
                raise InputError(
                    f"X and Y both depend on {s.name}: the controller would need its rate; let one"
                    " of them be of degree 0 in it, or give the plant a lagged parameter:"
                    " plant.lagged(...)"
                )
            if sampled and in_x and (isinstance(s.rate, str) or s.rate > 0):
                raise InputError(
                    f"in discrete time X cannot depend on {s.name}: the controller would need its"
                    " next value; let Y depend on it"
                )
        out.append(Shape(*bases))
    return out


Gains = Callable[[Array], Array]
Loop = Callable[[Coordinates, Gains, Array], tuple[Array, ...]]
"""A, B, C, D (K, ..) of what is judged, at p (K, m)."""


@dataclass(frozen=True, eq=False)
class Design:
    """X and Y with the gamma they hold for, in these coordinates; `gains` at p (K, m), scaled."""

    coordinates: Coordinates
    existence: Existence
    found: Found
    gains: Gains

    @property
    def gamma(self) -> float:
        """In the units of the plant."""
        return self.found.gamma * self.coordinates.channel


Recover = Callable[[Coordinates, Existence, Found], Gains]


def least(
    coordinates: Callable[[float], Coordinates],
    shape: Shape,
    divisions: int,
    solver: Solver,
    attempts: list[Attempt],
) -> tuple[Coordinates, Existence, Found]:
    """The least gamma, in a unit of performance that suits it."""
    channel = 1.0
    for _ in tracked(f"least gamma, {shape}", range(3)):
        own = coordinates(channel)
        existence = Existence(own, shape.X, shape.Y, divisions)
        found = existence.least_gamma(solver)
        gamma = channel * found.gamma
        attempts.append(Attempt(f"least gamma, {shape}", 0.0, found.message, gamma))
        if not math.isfinite(found.gamma) or 1 / FAR < found.gamma < FAR:
            break
        channel = gamma
    return own, existence, found


def settled(
    start: tuple[Coordinates, Existence, Found],
    back_off: Sequence[float],
    recover: Recover,
    solver: Solver,
    attempts: list[Attempt],
    loop: Loop | None = None,
) -> Iterator[Design]:
    """Designs at ever larger multiples of the least gamma, whose frozen `loop` keeps it."""
    coordinates, existence, lowest = start
    if not math.isfinite(lowest.gamma):
        return
    for factor in tracked("backing off", back_off):
        gamma = factor * lowest.gamma
        for found in tracked(f"at {factor:g} of the least gamma", existence.widest(gamma, solver)):
            gains = recover(coordinates, existence, found) if np.any(found.coefficients) else None
            reached = math.inf
            if gains is not None:
                # X and Y of a solver that stopped short may not be positive
                with contextlib.suppress(np.linalg.LinAlgError):
                    reached = frozen_gain(coordinates, gains, loop or closed)
            kept = "none" if math.isinf(reached) else f"worst frozen gain {reached / gamma:.4f}"
            attempts.append(
                Attempt(
                    f"back-off {factor:g}",
                    0.0,
                    f"{found.message}, {kept} of it",
                    gamma * coordinates.channel,
                )
            )
            if gains is not None and reached <= gamma * (1 + SLACK):
                yield Design(coordinates, existence, found, gains)
                break


def frozen_gain(coordinates: Coordinates, gains: Gains, loop: Loop) -> float:
    """Of the loop at some frozen p, scaled, where a parameter that is the rate of another is zero;
    inf where one is unstable.
    """
    parameters = coordinates.parameters
    low, high = np.array([(s.low, s.high) for s in parameters]).T
    p = low + np.linspace(0.0, 1.0, 7)[:, None] * (high - low)
    rates = [s.name in {other.rate for other in parameters} for s in parameters]
    p[:, rates] = np.clip(0.0, low, high)[rates]
    A, B, C, D = loop(coordinates, gains, p)
    return max(norm(A[i], B[i], C[i], D[i], coordinates.dt, 1e-6)[0] for i in range(len(p)))


def closed(coordinates: Coordinates, gains: Gains, p: Array) -> tuple[Array, ...]:
    """The plant under [A B; C D]."""
    plants, K = coordinates.at(p), gains(p)
    k = K.shape[-1] - plants.C2.shape[-2]
    return plants.closed(K[:, :k, :k], K[:, :k, k:], K[:, k:, :k], K[:, k:, k:])


def dependence(
    given: Dependence | None,
    parameters: Sequence[Scheduling],
    name: str,
    matters: Sequence[bool],
    *,
    still: bool = False,
) -> FunctionSpace:
    """Functions of X or Y where there is only one of them: by default of degree `USUAL` in what the
    plant depends on and may not jump; `still`: nor move.
    """
    degrees = tuple(
        USUAL if m and (s.rate == 0 if still else s.rate != math.inf) else 0
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
