"""From a plant to X(p), Y(p) and the gains they promise: which of them moves and of what degree,
how far from the least gamma, in a stated order.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv import FunctionSpace, Scheduling
from symheli.lpv.bases.function_space import tensor_grid
from symheli.lpv.bases.polynomials import polynomials
from symheli.progress import tracked
from synthesis.certificate import Attempt
from synthesis.lpv.coordinates import Coordinates, coordinates_of
from synthesis.lpv.existence import LARGEST, Existence, Found
from synthesis.lpv.fitted import Fitted, cut_to_serve, fits
from synthesis.lpv.motions import used
from synthesis.lpv.neglected_rate import level_kept
from synthesis.lpv.worst_optimum import Worst
from synthesis.program.cone_program import Solver
from synthesis.worst.frozen import below

if TYPE_CHECKING:
    from synthesis.plant.plant import Plant

Array = np.ndarray

Dependence = int | tuple[int, ...] | FunctionSpace
"""Of X or Y on the parameters: a degree for all, one each, or the functions themselves."""

BACK_OFF = (1.02, 1.04, 1.01, 1.1, 1.2, 1.5)
"""Multiples of the least gamma at which X and Y are settled, tried in turn."""
SLACK = 1e-6
"""By which the frozen gain of a controller may exceed what was promised: rounding."""
UNKEPT = "frozen loops do not keep it"
UNTOLD = "p moves too fast for gains that are not told dp/dt"
SHARP = "frozen loops keep it, no functions of p do"
FAR_ABOVE = 1.05
"""A gamma this many times the least one is said to be, one of a larger back-off that was asked for
in proportion; before it gains that turn sharply become splines with as many knots as that takes.
"""
FURTHER = 1.05
"""Of the gamma of a controller that is told dp/dt, where it is not told."""
TOO_FAST = 1.1
"""The same at which no other X and Y of this gamma are tried: all move about as much."""
ROUGH = 0.3
"""Functions of p farther from the gains than this are not looked at."""
ACCURACY = 3e-3
"""Of functions of p fitted to the gains, relative, entry by entry."""
NEAR = 2e-2
"""Polynomials as accurate as this are preferred to splines."""
CHECKED = {1: 97, 2: 7}
"""Values of each parameter at which frozen loops are judged, beside those where the inequalities
were imposed (more parameters: 3).
"""
DEGREES = {1: (2, 4, 6, 8), 2: (2, 4)}
"""Of the one that moves, tried in turn while gamma falls (more parameters: 2)."""
CLOSE = 1.01
"""A gamma within this factor of what no controller can beat is not worth another program."""
NOTHING_KNOWN = Worst()
WORTH = 0.995
"""Part of gamma to which a richer program must lower it to be worth another."""
FAR = 30.0
"""A gamma this many times larger or smaller than the unit of performance asks for another unit."""


@dataclass(frozen=True, eq=False)
class Shape:
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


def shapes(
    parameters: Sequence[Scheduling],
    X: Dependence | None,
    Y: Dependence | None,
    sampled: bool,
    matters: Sequence[bool],
    degree: int = DEGREES[1][0],
) -> list[Shape]:
    """The pairs that are tried: what was asked for, else one of the two moving, of this degree,
    then the other, with the parameters that the plant depends on.

    Both may move with a parameter that stands still, and with one whose rate is another parameter:
    then the controller knows how they move. Where both were asked for they may move with others too
    (`Shape.untold`), of which dp/dt is then neglected. Raises `InputError` where that has no proof:
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
        shape = Shape(*bases)
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


Gains = Callable[[Array], Array]
Loop = Callable[[Coordinates, Gains, Array], tuple[Array, ...]]
"""A, B, C, D (K, ..) of what is judged, at p (K, m)."""


class Start(NamedTuple):
    """The least gamma of a shape."""

    coordinates: Coordinates
    existence: Existence
    found: Found
    shape: Shape

    @property
    def gamma(self) -> float:
        """In the units of the plant; inf where none was found."""
        return self.coordinates.channel * self.found.gamma


@dataclass(frozen=True, eq=False)
class Design:
    """X and Y with the gamma they hold for, in these coordinates; `fit` are the gains (K, ..) at p
    (K, m), scaled, as functions of p.
    """

    coordinates: Coordinates
    existence: Existence
    found: Found
    fit: Fitted

    @property
    def gamma(self) -> float:
        """In the units of the plant."""
        return self.found.gamma * self.coordinates.channel


Recover = Callable[[Coordinates, Existence, Found], Gains]


def both_moving(
    parameters: Sequence[Scheduling], matters: Sequence[bool], degree: int
) -> list[Shape]:
    """X and Y of this degree in every parameter of a limited rate; nothing where none moves, or
    one whose rate is another.
    """
    rates = [s.rate for s in parameters if not isinstance(s.rate, str)]
    if len(rates) < len(parameters) or not any(0 < rate < math.inf for rate in rates):
        return []
    degrees = tuple(
        degree if m and rate != math.inf else 0 for rate, m in zip(rates, matters, strict=True)
    )
    return [Shape(*(functions(degrees, parameters, name) for name in ("X", "Y")))]


def best(
    plant: Plant,
    every: Callable[[int], Sequence[Shape]],
    divisions: int,
    solver: Solver,
    attempts: list[Attempt],
    worst: Worst = NOTHING_KNOWN,
) -> Start:
    """The shape of the least gamma: of those of the lowest degree the best, then of higher degrees
    while that lowers it, then with a larger bound on X and Y where that decides. No controller has
    a gamma below the `worst` frozen optimum.
    """
    floor = worst.level
    channel = floor if 0 < floor < math.inf else 1.0
    degrees = DEGREES.get(len(plant.parameters), (2,))
    starts: list[Start] = []
    for shape in every(degrees[0]):
        starts.append(least(plant, shape, divisions, solver, attempts, channel, worst.p))
        if starts[-1].gamma <= CLOSE * floor:
            break
    chosen = min(range(len(starts)), key=lambda k: starts[k].gamma)
    start = starts[chosen]

    def worth(other: Start) -> bool:
        return other.gamma < WORTH * start.gamma

    for degree in degrees[1:]:
        shape = every(degree)[chosen]
        if start.gamma <= CLOSE * floor or shape.size == start.shape.size:
            break
        richer = least(plant, shape, divisions, solver, attempts, channel, worst.p)
        more = worth(richer)
        start = richer if richer.gamma < start.gamma else start
        if not more and math.isfinite(start.gamma):
            break
    for largest in LARGEST[1:]:
        if start.gamma <= CLOSE * floor or not start.existence.bounded(start.found):
            break
        if start.existence.least_share(start.found, largest, solver) >= WORTH:
            break
        unit = start.gamma
        wider = least(
            plant, start.shape, divisions, solver, attempts, unit, worst.p, largest=largest
        )
        if not worth(wider):
            break
        start = wider
    return start


def least(
    plant: Plant,
    shape: Shape,
    divisions: int,
    solver: Solver,
    attempts: list[Attempt],
    channel: float = 1.0,
    p: Array | None = None,
    *,
    largest: float = LARGEST[0],
) -> Start:
    """The least gamma of a shape, in a unit of performance that suits it, at first `channel`; with
    the inequalities at this p (m,), too.
    """
    for _ in tracked(f"least gamma, {shape}", range(3)):
        own = coordinates_of(plant, channel)
        existence = Existence(own, shape.X, shape.Y, divisions, largest, p)
        found = existence.least_gamma(solver)
        gamma = channel * found.gamma
        attempts.append(Attempt(f"least gamma, {shape}", 0.0, found.message, gamma))
        if not math.isfinite(found.gamma) or 1 / FAR < found.gamma < FAR:
            break
        channel = gamma
    return Start(own, existence, found, shape)


def settled(
    start: Start,
    back_off: Sequence[float],
    recover: Recover,
    solver: Solver,
    attempts: list[Attempt],
    loop: Loop | None = None,
    neglecting: bool = False,
) -> Iterator[Design]:
    """Designs at these multiples of the least gamma, whose frozen `loop` keeps it with the gains
    as functions of p; `neglecting`: at most `FURTHER` above, where the gains are not told dp/dt.
    """
    coordinates, existence, lowest, _ = start
    if not math.isfinite(lowest.gamma):
        return
    judged = loop or closed
    sharp: dict[float, tuple[Found, Gains]] = {}

    def noted(factor: float, message: str, outcome: str) -> None:
        gamma = factor * lowest.gamma * coordinates.channel
        attempts.append(Attempt(f"back-off {factor:g}", 0.0, f"{message}, {outcome}", gamma))

    def by_splines() -> Iterator[Design]:
        while sharp:
            factor = max(sharp)
            found, gains = sharp.pop(factor)
            design, outcome = _tried(start, found, gains, judged, neglecting, with_knots)
            noted(factor, "knots added", outcome)
            if design is not None:
                yield design

    for factor in tracked("backing off", back_off):
        if factor > FAR_ABOVE:
            yield from by_splines()
        gamma = factor * lowest.gamma
        for found in tracked(f"at {factor:g} of the least gamma", existence.widest(gamma, solver)):
            design, outcome = None, UNKEPT
            # X and Y of a solver that stopped short may be nothing, or not positive
            with contextlib.suppress(np.linalg.LinAlgError):
                if np.any(found.coefficients):
                    gains = recover(coordinates, existence, found)
                    design, outcome = _tried(start, found, gains, judged, neglecting, simplest)
                    if outcome == SHARP:
                        sharp.setdefault(factor, (found, gains))
            noted(factor, found.message, outcome)
            if design is not None:
                yield design
            if design is not None or outcome.startswith(UNTOLD):
                break
    yield from by_splines()


def _tried(
    start: Start,
    found: Found,
    gains: Gains,
    loop: Loop,
    neglecting: bool,
    fit_of: Callable[[Coordinates, Gains, Loop, Array, float], Fitted | None],
) -> tuple[Design | None, str]:
    """The design of these gains, None where their loop does not keep gamma; and what came of it."""
    coordinates, existence, *_ = start
    reached = found.gamma
    points = judged(existence.plant.parameters, existence.points)
    if neglecting:
        looped = closed(coordinates, gains, points)
        reached = max(reached, level_kept(coordinates, existence, found, looped, points))
    further = reached / found.gamma
    if further > FURTHER:
        said = UNTOLD if further > TOO_FAST else "as dp/dt is not known"
        return None, f"{said}, {further:.3g} times as much"
    if not all(kept(coordinates, gains, loop, points, reached * (1 + SLACK))):
        return None, UNKEPT
    fit = fit_of(coordinates, gains, loop, points, reached)
    if fit is None:
        return None, SHARP
    said = f"frozen loops keep it, functions of p within {fit.misfit:.1e}"
    return Design(coordinates, existence, found._replace(gamma=reached), fit), said


def simplest(
    coordinates: Coordinates, gains: Gains, loop: Loop, points: Array, gamma: float
) -> Fitted | None:
    """The simplest functions that are accurate and keep gamma, else the most accurate of those that
    keep it, splines only where polynomials are far off; None where none does.
    """
    every = list(fits(gains, coordinates.parameters))
    polynomials = [fit for fit in every if fit.basis.degrees]
    near = any(fit.misfit <= NEAR for fit in polynomials)
    accurate = [fit for fit in every if fit.misfit <= ACCURACY]
    rest = [fit for fit in (polynomials if near else every) if ACCURACY < fit.misfit <= ROUGH]
    for fit in (*accurate, *sorted(rest, key=lambda fit: fit.misfit)):
        if all(kept(coordinates, fit, loop, points, gamma * (1 + SLACK))):
            return fit
    return None


def with_knots(
    coordinates: Coordinates, gains: Gains, loop: Loop, points: Array, gamma: float
) -> Fitted | None:
    """Splines of one parameter with knots where gamma would not be kept without; None where they
    do not come to an end.
    """
    if len(coordinates.parameters) != 1:
        return None
    limit = gamma * (1 + SLACK)

    def serves(fit: Fitted, p: Array) -> Array:
        return np.fromiter(kept(coordinates, fit, loop, p, limit), bool, len(p))

    fit = cut_to_serve(gains, coordinates.parameters[0], serves)
    return fit if fit is not None and serves(fit, points).all() else None


def judged(parameters: Sequence[Scheduling], more: Array | None = None) -> Array:
    """Points (K, m) at which frozen loops are judged, with `more`; a parameter that is the rate of
    another is zero there.
    """
    count = CHECKED.get(len(parameters), 3)
    p = tensor_grid([np.linspace(s.low, s.high, count) for s in parameters])
    p = p if more is None else np.vstack([p, more])
    rates = [s.name in {other.rate for other in parameters} for s in parameters]
    low, high = np.array([(s.low, s.high) for s in parameters]).T
    p[:, rates] = np.clip(0.0, low, high)[rates]
    return np.unique(p, axis=0)


def kept(
    coordinates: Coordinates, gains: Gains, loop: Loop, p: Array, gamma: float
) -> Iterator[bool]:
    """Whether the loop frozen at each p (K, m), scaled, is stable and its gain below gamma."""
    for A, B, C, D in zip(*loop(coordinates, gains, p), strict=True):
        yield below(A, B, C, D, gamma, coordinates.dt)


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
