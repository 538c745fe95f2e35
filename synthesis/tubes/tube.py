"""Invariant tubes of the nonlinear helicopter, and of any nonlinear model, about its references."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise, product
from typing import Any, ClassVar, NamedTuple

import casadi
import numpy as np
from scipy.linalg import eigh, expm

from symheli import Helicopter
from symheli.errors import InputError
from symheli.flight import Servo
from symheli.lazy import former_attribute
from symheli.lpv.tools import Actuation
from symheli.progress import Task, task, tracked
from symheli.values.arrays import Array
from symheli.values.summary import summarized
from synthesis.certify.statement.proven_statement import ProvenStatement
from synthesis.numerics.program.cone_program import Solver
from synthesis.tubes.controllers import Choice
from synthesis.tubes.deviations import SEGMENTS, CommandCell, Deviations
from synthesis.tubes.equipment import of_periods
from synthesis.tubes.files import (
    numbers,
    read_loop,
    read_multipliers,
    written_loop,
    written_multipliers,
)
from synthesis.tubes.gain import LocalGain, least
from synthesis.tubes.inequality import Multipliers
from synthesis.tubes.motions import Motions
from synthesis.tubes.proof import falls_in, holds
from synthesis.tubes.reference import TUBE_SIZES, Reference, held, moving
from synthesis.tubes.search import Enclosed, TubeSolution, smallest
from synthesis.tubes.travel import why_not_free

INTERVAL = 1.0
"""Largest distance of the nodes of reference, feedback and P along airspeed, m/s."""
DOWNWARD = 0.75
"""Largest change of the reference's velocity along the body's axis in a cell, m/s, by a change of
acceleration: p a/g.
"""
GRAVITY = 9.8
"""m/s^2; of the choice of cells only."""
DECAYS = (1.0, 2.0, 3.0)
"""Rates alpha that are tried on the linear loop of a helicopter, 1/s,"""
SLOW_DECAYS = (0.3, 0.6)
"""those tried where none of these is feasible, as with a slow governor,"""
MORE_DECAYS = (0.3, 0.5, 0.8, 1.2, 2.0, 3.0, 5.0)
"""and of any other model, whose time scale is not known."""
FIRST_SHARE = 0.1
"""Share of the deviations and gusts over which the equations are enclosed at first; without any the
multipliers have no bound.
"""
FIRST_SIZE = 0.3
"""First half widths, in units of `TUBE_SIZES`."""
GROWTHS = ((1.5, 1.05), (1.15, 1.05), (1.05, 1.02))
"""Factors on the half widths in the first round of a search, and from one round to the next: where
the deviations enclosed were too large for any ellipsoid, a smaller start may lead to one.
"""
ROUNDS = 15
SPARE = 0.02
"""Spare of the inequality in the search, 1/s."""
INSIDE = 1 - 1e-6
"""Share of the enclosed deviations that the tube may fill, for rounding of the search."""
UNDEFINED = "the reference is not defined for all commands, as the root of a negative number"
TOLERANCE = 1e-6
"""Tolerance of the semidefinite programs: the exact check decides."""


@dataclass(frozen=True, eq=False)
class Tube(ProvenStatement):
    """The deviations e = x - x_r with e'P e <= 1, which the nonlinear model does not leave.

    Made by `tube`; `verify` proves it again from these fields alone.

    Attributes
    ----------
    deviations : Deviations
        The closed loop: helicopter or model, reference, feedback, gust amplitude.
    P : array (k, n, n)
        At the k nodes of the airspeed, or of another scheduling command, linear between, in SI
        units; the search's last ones where nothing was proven.
    cells : tuple of CommandCell
        Parts of the commands, each with a proof of its own.
    factors : array (cells, n, n)
        The deviations e = factor z, |z| <= 1, over which the equations are enclosed.
    multipliers : tuple of Multipliers
        Of the matrix inequality of each cell; none where nothing was found.
    verified : bool
        The inequality holds in exact arithmetic for every enclosed matrix.
    why : str
        Why there is no proof; empty where there is one.
    gains : tuple of LocalGain
        Bounds of the deviations' energy or peaks by the energy of the gusts, while the flight stays
        in the tube: `with_gain`.

    Raises
    ------
    InputError
        `save` of a tube without a proof, `load` of a file that is damaged or another.

    Examples
    --------
    >>> import symheli
    >>> found = tube(symheli.Helicopter.load("xcell60", governor="ideal"), 3.0, gust=0.1)
    >>> found.save("tube.json").name, Tube.load("tube.json").verified
    ('tube.json', True)
    """

    deviations: Deviations
    P: Array
    cells: tuple[CommandCell, ...]
    factors: Array
    multipliers: tuple[Multipliers, ...]
    verified: bool
    why: str
    gains: tuple[LocalGain, ...] = ()
    reader: ClassVar[str] = "tube"

    proven = former_attribute("proven", "verified")

    __repr__ = summarized

    @property
    def nodes(self) -> Array:
        """Nodes of the commanded airspeed, m/s, or of another scheduling command; one where it is
        held.
        """
        return self.deviations.reference.nodes

    def at(self, command: float) -> Array:
        """P (n, n) at a commanded airspeed, m/s, or another scheduling command."""
        return self.along([command])[0]

    def along(self, commands: Any) -> Array:
        """P (N, n, n) at scheduling commands (N,)."""
        i, s = self.deviations.reference.place(commands)
        return self.P[i] + s[:, None, None] * (self.P[i + (len(self.P) > 1)] - self.P[i])

    @cached_property
    def half_widths(self) -> Array:
        """Largest deviation of each state at any command, (n,), SI."""
        # convex in P, which is linear between the nodes
        return np.sqrt(np.diagonal(np.linalg.inv(self.P), axis1=1, axis2=2)).max(axis=0)

    @cached_property
    def control_half_widths(self) -> Array:
        """Largest deviation of each control from that of the reference at the nodes, (k,), SI."""
        K = self.deviations.feedback[:, : len(self.deviations.inputs)]
        K = np.broadcast_to(K, (len(self.P), *K.shape[1:]))
        return np.sqrt(np.einsum("kui,kij,kuj->ku", K, np.linalg.inv(self.P), K)).max(axis=0)

    @property
    def hypotheses(self) -> tuple[str, ...]:
        """Hypotheses of the statement, in sentences."""
        d = self.deviations
        travel = (
            "shown, not assumed: commands and blade pitch stay within their travel, servos below"
            " their rate limits"
            if isinstance(d.model, Helicopter)
            else "controls within their travel: they differ from those of the reference by no more"
            " than the control deviations"
        )
        return (*d.hypotheses, "the deviation lies in the tube at the start", travel)

    def __str__(self) -> str:
        named = zip(self.deviations.states, self.half_widths, strict=True)
        sizes = ", ".join(f"{name} {width:.3g}" for name, width in named)
        inputs = zip(self.deviations.inputs, self.control_half_widths, strict=True)
        controls = ", ".join(f"{name} {width:.3g}" for name, width in inputs)
        if not self.verified:
            return f"no tube: {self.why}"
        return "\n".join(
            [
                "invariant tube of the nonlinear equations, proven",
                f"largest deviations (SI): {sizes}",
                f"of the controls: {controls}",
                *(f"{gain}" for gain in self.gains),
                *(f"- {line}" for line in self.hypotheses),
            ]
        )

    def contains(self, deviation: Any, command: float | None = None) -> bool:
        """Whether a deviation (n,), SI, lies in the tube at a commanded airspeed, m/s, or another
        scheduling command; by default the first.
        """
        e = np.asarray(deviation, float)
        return bool(e @ self.at(self.nodes[0] if command is None else command) @ e <= 1)

    def with_gain(self, outputs: Any, *, energy: bool = True, solver: Solver | None = None) -> Tube:
        """This tube with one more proven bound from gusts to deviations.

        Parameters
        ----------
        outputs : sequence of str
            States whose deviations are bounded together, as the root of the sum of their squares.
        energy : bool
            Bound the energy of these deviations (L2 gain) by that of the gusts; False: their peak.
        solver : Solver, optional
            Of the semidefinite program; by default Clarabel.

        Returns
        -------
        Tube
            Its last `gains`.

        Raises
        ------
        InputError
            A tube without a proof, a name that is no state, no proven bound.

        Examples
        --------
        >>> import symheli
        >>> found = tube(symheli.Helicopter.load("xcell60", governor="ideal"), 3.0, gust=0.1)
        >>> print(f"{found.with_gain(['theta']).gains[0].gamma:.4f} rad/(m/s)")
        0.0043 rad/(m/s)
        """
        if not self.verified:
            raise InputError(f"only a proven tube has gains; here {self.why}")
        if not self.deviations.gust > 0:
            raise InputError("a gain from gusts needs a tube in gusts: make it with gust > 0")
        if self.deviations.reference.jump is not None:
            raise InputError("gains are of loops in continuous time: the tube's is sampled")
        d, own = self.deviations, solver or Solver(tolerance=TOLERANCE)
        cells = enclosed_cells(d, self.cells, self.factors, d.drifts(self.cells))
        found = least(cells or [], self.P, d.states, outputs, energy, d.gust, own)
        if (
            (cells is None)
            or found is None
            or not (
                found.has_storage
                and all(found.holds_in(k, c, self.nodes) for k, c in enumerate(cells))
            )
        ):
            raise InputError("no bound was proven: over less of the tube there may be one")
        return replace(self, gains=(*self.gains, found))

    def verify(self, rigorous: bool = True) -> bool:
        """Enclose the equations again and check the inequality, in exact arithmetic always."""
        return not self._refused()

    def _refused(self, over: Sequence[Enclosed] | None = None) -> str:
        """Empty where the proof holds, else what does not; `over`: the cells, if enclosed."""
        loop, p = self.deviations, self.nodes
        jump, no_fall = loop.reference.jump, "the inequality does not hold in exact arithmetic"
        complete = len(self.cells) == len(self.factors) == len(self.multipliers)
        counts = {len(gain.multipliers) for gain in self.gains}
        if not (complete and counts <= {len(self.cells)} and _covers(self.cells, loop.reference)):
            return "the cells do not cover all commands"
        if not loop.is_defined(self.cells):
            return UNDEFINED
        if any(gain.gust != loop.gust or gain.states != loop.states for gain in self.gains):
            return "a gain is in other gusts, or of other states, than the tube"
        if not all(gain.has_storage for gain in self.gains):
            return "a gain has no storage"
        if jump is not None and (self.gains or not falls_in(jump, self.P[0], self.P[-1])):
            return "the deviation grows at a sample"
        parts = list(zip(self.cells, self.factors, self.multipliers, strict=True))
        sets = []
        for k, (cell, factor, by) in enumerate(tracked("verifying cells", parts)):
            made = (
                [over[k]]
                if over
                else enclosed_cells(loop, [cell], factor[None], loop.drifts([cell]))
            )
            if (
                made is None
                or not self._holds(made[0], by)
                or not all(gain.holds_in(k, made[0], p) for gain in self.gains)
            ):
                return no_fall
            sets.append((made[0].over, factor))
        return why_not_free(loop, self.cells, self.P, sets)

    def _holds(self, made: Enclosed, by: Multipliers) -> bool:
        """Whether the inequality holds in a cell."""
        if by.terms.shape != (len(made.over.left),) * 2:
            return False
        nodes = list(made.nodes)
        own = (self.P[nodes], self.nodes[nodes])
        return holds(*own, made.cell, made.over, made.factor, by)

    @property
    def claim(self) -> str:
        """The claim in one sentence, with numbers and units."""
        sizes = zip(self.deviations.states, self.half_widths, strict=True)
        each = ", ".join(f"{name} {width:.3g}" for name, width in sizes)
        bounds = "".join(f"; {gain}" for gain in self.gains)
        return f"invariant tube of the nonlinear equations: deviations (SI) at most {each}{bounds}"

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, each a sentence made from the numbers of the proof."""
        return self.hypotheses

    @property
    def facts(self) -> Mapping[str, Any]:
        """Kind, bounds and conditions as data that JSON holds."""
        return {
            "kind": "invariant tube",
            "airspeeds": self.nodes.tolist(),
            "gust": self.deviations.gust,
            "half_widths": self.half_widths.tolist(),
        }

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file: equations (the vehicle file, or the operations of the model), feedback
        and proof.
        """
        if not self.verified:
            raise InputError(f"only a proven tube is saved; here {self.why}")
        return {
            "kind": "tube",
            **written_loop(self.deviations),
            "P": self.P.tolist(),
            "cells": [[cell.interval, *map(list, cell.ranges)] for cell in self.cells],
            "factors": self.factors.tolist(),
            "multipliers": [written_multipliers(by) for by in self.multipliers],
            "gains": [gain.written for gain in self.gains],
        }

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> Tube:
        """Return the tube of a file, proven anew."""
        found = _read(content)
        why = found._refused()
        return replace(found, verified=not why, why=why)


def _read(content: Mapping[str, Any]) -> Tube:
    loop = read_loop(content)
    n, k, count = len(loop.states), len(loop.reference.nodes), len(content["cells"])
    cells = []
    for interval, *ranges in content["cells"]:
        own = numbers(ranges, 1 + len(loop.reference.ranges), 2).tolist()
        s, a, *others = ((low, high) for low, high in own)
        cells.append(CommandCell(int(interval), s, a, tuple(others)))
    factors = numbers(content["factors"], count, n, n)
    if np.any(np.linalg.matrix_rank(factors) < n):
        raise ValueError("a factor of the deviations enclosed is singular")
    return Tube(
        loop,
        numbers(content["P"], k, n, n),
        tuple(cells),
        factors,
        tuple(read_multipliers(given, loop.moved) for given in content["multipliers"]),
        False,
        "not verified",
        tuple(
            LocalGain.read(given, k, loop.states, loop.moved, loop.gust)
            for given in content["gains"]
        ),
    )


def tube(
    model: Helicopter | casadi.Function,
    reference: float | tuple[float, float] | Motions,
    *,
    gust: float,
    acceleration: float = 0.0,
    jerk: float = 0.0,
    snap: float = math.inf,
    gain: Any = None,
    known: Sequence[str] | None = None,
    servos: Mapping[str, Servo] | Actuation | None = None,
    period: float = 0.0,
    delay: int = 0,
    sizes: Any = None,
    solver: Solver | None = None,
) -> Tube:
    """A proven invariant tube of a nonlinear helicopter in level flight in gusts, or of any other
    model about its motions.

    With u = u_r + K e, the deviation e = x - x_r from the reference, with the states of controller
    and servos where there are any, stays in e'P e <= 1 for every gust history of the amplitude, and
    every history of the commands within their limits. The difference of the nonlinear equations
    from those of the reference is an average of their Jacobian times (e, w); the Jacobian is
    enclosed over the whole tube (`synthesis.tubes.enclosure`), and a matrix inequality is checked
    for all enclosed matrices in rational arithmetic. So is that controls stay within their travel.

    Parameters
    ----------
    model : Helicopter or casadi.Function
        With either governor: ten or twelve states. Or (x, u, w) -> dx/dt, of dense columns and of
        the operations that `synthesis.tubes.enclosure.enclose` knows.
    reference : float, (float, float) or Motions
        Of a helicopter the airspeed held, or the range of its command, m/s. Of another model its
        motions and the feedback about them.
    gust : float
        Largest size of the gust vector, m/s; of w.
    acceleration, jerk : float
        Largest sizes of the first and second derivative of the commanded airspeed, m/s^2 and m/s^3;
        > 0 for a range.
    snap : float
        Largest derivative of the jerk, m/s^4. Infinite: the jerk may jump, and the pitch rate of
        the reference does not follow it.
    gain : array (4, n) or (nodes, 4, n), LinearModel, LPVStateSpace or design, optional
        Of a helicopter: K, rad per SI unit, at all airspeeds or at each node; or a controller from
        deviations to commands by name, taken at the commanded airspeed, in continuous time or with
        `period`. Default: linear-quadratic regulators.
    known : sequence of str, optional
        States that the default feedback knows; by default the ten of an ideal governor. An observer
        estimates the others, but for the rotor's where neither is known.
    servos : mapping of Servo, or Actuation, optional
        One for each control. With a rate limit: continuous time and a held airspeed. An Actuation
        has period and delay too, both in s.
    period : float
        Sample period of the controller, s, whose command is held between; 0: continuous time. At a
        held airspeed.
    delay : int
        Whole periods from a sample to its command.
    sizes : array (n,), optional
        Half widths of equal weight: the mean square of the tube's half widths over these is made
        small. Needed for another model than a helicopter.
    solver : Solver, optional
        Of the semidefinite programs; by default Clarabel.

    Returns
    -------
    Tube
        `verified` says whether there is one, `why` why not; a larger tube may exist.

    Raises
    ------
    InputError
        A gust that is no number >= 0, limits that do not fit, a controller, servos or sizes of
        another shape.
    TrimError
        No flight at one of these airspeeds and accelerations.

    References
    ----------
    Boyd et al. (1994), Linear Matrix Inequalities in System and Control Theory, section 6.1
    (invariant ellipsoids of unit-peak inputs); Petersen (1987), A stabilization algorithm for a
    class of uncertain linear systems.

    Examples
    --------
    >>> import symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> found = tube(heli, 3.0, gust=0.1)
    >>> found.verified, bool(found.half_widths[0] < 0.02)
    (True, True)
    """
    loop, cells, own = posed(
        model, reference, gust=gust, acceleration=acceleration, jerk=jerk, snap=snap, gain=gain,
        known=known, servos=servos, period=period, delay=delay, sizes=sizes,
    )  # fmt: skip
    return _found(loop, cells, own, solver or Solver(tolerance=TOLERANCE))


def posed(
    model: Helicopter | casadi.Function,
    reference: Any,
    *,
    gust: float,
    acceleration: float = 0.0,
    jerk: float = 0.0,
    snap: float = math.inf,
    gain: Any = None,
    known: Sequence[str] | None = None,
    servos: Mapping[str, Servo] | Actuation | None = None,
    period: float = 0.0,
    delay: int = 0,
    sizes: Any = None,
    segments: int = SEGMENTS,
) -> tuple[Deviations, tuple[CommandCell, ...], Array]:
    """Return the closed loop, the cells of its commands and the half widths of equal weight of what
    `tube` is asked.
    """
    if not (np.isfinite(gust) and gust >= 0):
        raise InputError(f"gust must be a number >= 0; got {gust!r:.60}")
    limits = _limits(acceleration, jerk, snap)
    made: Reference | Motions
    if isinstance(model, Helicopter):
        actuation = of_periods(servos, period, delay)
        slow = actuation.period is not None or actuation.servos is not None
        choice = Choice(gain, known, actuation.period or 0.0, slow)
        made = _flight(model, reference, limits, choice, actuation)
        own = np.concatenate([TUBE_SIZES[: made.own], made.equipment.sizes])
    else:
        others = [gain, known, servos, period or None, delay or None]
        made = _checked(model, reference, [*limits[:2], *(x is not None for x in others)], sizes)
    loop = Deviations(model, made, float(gust), segments)
    own = own if sizes is None else np.array(sizes, float)
    if own.shape != (len(loop.states),) or not (np.all(np.isfinite(own)) and np.all(own > 0)):
        raise InputError(f"sizes must be {len(loop.states)} numbers > 0; got {sizes}")
    return loop, tuple(_cells(made)), own


def _flight(
    heli: Helicopter,
    airspeed: Any,
    limits: tuple[float, float, float],
    choice: Choice,
    actuation: Actuation,
) -> Reference:
    """The reference of a helicopter."""
    if np.ndim(airspeed) > 0 or isinstance(airspeed, Motions):
        if actuation.period or actuation.delay:
            raise InputError("a sampled loop needs one airspeed: its P follows the clock alone")
        if any(np.isfinite(servo.rate) for servo in (actuation.servos or {}).values()):
            raise InputError(
                "servos with a rate limit need one airspeed: along a range the rates of their"
                " commands are not bounded; leave the limit out (rate=inf) or hold an airspeed"
            )
        return moving(heli, _range(airspeed, limits), limits, choice, actuation)
    if limits[0] or limits[1]:
        raise InputError("a held airspeed has no acceleration or jerk: give (low, high)")
    return held(heli, airspeed, choice, actuation)


def _checked(model: Any, motions: Any, flight: Sequence[float], sizes: Any) -> Motions:
    """The motions of another model than a helicopter."""
    if not (isinstance(model, casadi.Function) and isinstance(motions, Motions)):
        raise InputError(
            "a tube needs a Helicopter with airspeeds, or a casadi.Function (x, u, w) -> dx/dt with"
            f" Motions; got {type(model).__name__} and {type(motions).__name__}"
        )
    n, k = len(motions.states), len(motions.inputs)
    shapes = [model.size_in(i) for i in range(model.n_in())]
    if shapes[:2] != [(n, 1), (k, 1)] or len(shapes) != 3 or shapes[2][1] != 1:
        raise InputError(f"the model must take x ({n}), u ({k}) and w, columns; it takes {shapes}")
    if model.n_out() != 1 or model.size_out(0) != (n, 1):
        raise InputError(f"the model must return dx/dt ({n}), one column")
    if any(flight):
        raise InputError(
            "limits, gain, known, servos, period and delay are those of a helicopter: see Motions"
        )
    if sizes is None:
        raise InputError(f"sizes are needed: {n} half widths of equal weight")
    return motions


def _cells(reference: Reference | Motions) -> list[CommandCell]:
    """The commands in cells."""
    if isinstance(reference, Reference) and len(reference.airspeeds) > 1:
        return [
            CommandCell(i, (0.0, 1.0), (low, high))
            for i, p in enumerate(reference.nodes[1:])
            for low, high in pairwise(_accelerations(float(p), reference.limits[0]))
        ]
    pieces = reference.pieces if isinstance(reference, Motions) else (1,)
    edges = [
        np.linspace(*limits, k + 1) for limits, k in zip(reference.ranges, pieces, strict=True)
    ]
    sides = [[(float(a), float(b)) for a, b in pairwise(row)] for row in edges]
    s = (0.0, float(len(reference.nodes) > 1))
    return [
        CommandCell(i, s, own[0], tuple(own[1:]))
        for i in range(reference.intervals)
        for own in product(*sides)
    ]


def _limits(*given: Any) -> tuple[float, float, float]:
    """Acceleration, jerk and snap as numbers."""
    try:
        acceleration, jerk, snap = map(float, given)
    except (TypeError, ValueError):
        raise InputError(f"acceleration, jerk and snap must be numbers; got {given}") from None
    return acceleration, jerk, snap


def _range(airspeed: Any, limits: tuple[float, float, float]) -> Array:
    """The nodes of a range of airspeeds."""
    try:
        low, high = (float(p) for p in airspeed)
    except (TypeError, ValueError):
        low, high = math.nan, math.nan
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"airspeed must be a number or (low, high), m/s; got {airspeed!r:.60}")
    if not all(math.isfinite(limit) and limit > 0 for limit in limits[:2]) or not limits[2] > 0:
        raise InputError(
            f"a range of airspeeds needs acceleration, jerk and snap > 0; got {limits}"
        )
    return np.linspace(low, high, math.ceil((high - low) / INTERVAL - 1e-9) + 1)


def _accelerations(airspeed: float, limit: float) -> list[float]:
    """The ends of the cells of an interval along acceleration, m/s^2."""
    count = max(math.ceil(2 * limit * airspeed / (GRAVITY * DOWNWARD)), 2)
    return np.linspace(-limit, limit, count + 1).tolist()


def _nodes(cell: CommandCell, count: int) -> tuple[int, ...]:
    """The nodes of a cell's interval, of so many."""
    return (0,) if count == 1 else (cell.interval, cell.interval + 1)


def _covers(cells: Sequence[CommandCell], reference: Reference | Motions) -> bool:
    """Whether these cells are all commands: of each interval all s in [0, 1] with all commands
    that cells split; and no state of the reference may jump.
    """
    if reference.jumps or {c.interval for c in cells} != set(range(reference.intervals)):
        return False
    needed = [(0.0, float(len(reference.nodes) > 1)), *reference.ranges]
    if not all(len(c.ranges) == len(needed) for c in cells):
        return False
    return all(
        _fills(np.array([c.ranges for c in cells if c.interval == i]), np.array(needed))
        for i in range(reference.intervals)
    )


def _fills(boxes: Array, whole: Array) -> bool:
    """Whether boxes (N, r, 2) cover a box (r, 2): each part between their edges lies in one."""
    parts = []
    for sides, (low, high) in zip(np.moveaxis(boxes, 1, 0), whole, strict=True):
        inner = sides[(sides > low) & (sides < high)]
        edges = np.unique([low, *inner, high])
        parts.append(list(pairwise(edges)) or [(low, high)])
    return all(
        np.any(np.all((boxes[..., 0] <= own[:, 0]) & (own[:, 1] <= boxes[..., 1]), axis=1))
        for own in map(np.array, product(*parts))
    )


class Growth(NamedTuple):
    """How a tube is sought: its rate alpha, 1/s, the factors on the half widths in the first round
    and from one round to the next, the rounds at most, and the spare of the inequality, 1/s.
    """

    decay: float
    first: float
    later: float
    rounds: int = ROUNDS
    spare: float = SPARE


Grown = tuple[TubeSolution | None, Sequence[Enclosed], Array, str]
"""What was found, the cells enclosed, P, why nothing was."""


def _found(loop: Deviations, cells: tuple[CommandCell, ...], sizes: Array, solver: Solver) -> Tube:
    """The search: the ellipsoids over which the equations are enclosed grow until the smallest ones
    that satisfy the inequality lie inside.
    """
    with task("tube", len(GROWTHS)) as progress:
        return established(loop, cells, _grown(loop, cells, sizes, solver, progress))


def established(loop: Deviations, cells: tuple[CommandCell, ...], grown: Grown) -> Tube:
    """Return the tube that a search has found, with its proof."""
    found, over, P, why = grown
    factors = np.array([cell.factor for cell in over])
    if found is None:
        return Tube(loop, P, cells, factors, (), False, why)
    made = Tube(loop, P, cells, factors, tuple(found.multipliers), True, "")
    why = made._refused(over)
    return replace(made, verified=not why, why=why)


def _grown(
    loop: Deviations, cells: Sequence[CommandCell], sizes: Array, solver: Solver, progress: Task
) -> Grown:
    """The search over all cells, from the ellipsoids of the linear loop."""
    count = len(loop.reference.nodes)
    roots = np.broadcast_to(FIRST_SIZE * np.diag(sizes), (count, len(sizes), len(sizes)))
    factors = np.broadcast_to(roots[0], (len(cells), *roots[0].shape))
    P = np.broadcast_to(np.diag(sizes**-2), roots.shape)
    drifts = loop.drifts(cells)
    linear = enclosed_cells(loop, cells, factors, drifts, FIRST_SHARE)
    if linear is None or not np.all(np.isfinite(drifts)):
        return None, (), P, "the equations have no bounds near the reference"
    if not loop.is_defined(cells):
        return None, (), P, UNDEFINED
    found = of_linear_loop(loop, cells, linear, roots, sizes, solver)
    if found is None:
        return None, (), P, "the linear loop has no invariant ellipsoid"
    made: Grown = (None, (), P, "")
    for first, growth in GROWTHS:
        effort = Growth(found[1], first, growth)
        made = from_below(loop, cells, sizes, drifts, effort, found[0], solver)
        if made[0] is not None:
            break
        progress.step(made[3])
    return made


def from_below(
    loop: Deviations,
    cells: Sequence[CommandCell],
    sizes: Array,
    drifts: Array,
    effort: Growth,
    P: Array,
    solver: Solver,
) -> Grown:
    """Return what `_grown` does, from ellipsoids P that are too small or just large enough."""
    decay, growth, later, rounds, spare = effort
    for _ in range(rounds):
        P, growth = P / growth**2, later
        roots, factors = coordinates(P, cells)
        over = enclosed_cells(loop, cells, factors, drifts)
        if over is None:
            return None, (), P, "the equations have no bounds over a tube of the size needed"
        found = smallest(over, roots, sizes, decay, spare, solver, loop.reference.jump)
        if found is None:
            why = "no ellipsoid satisfies the inequality: the gusts are too large"
            return None, over, P, why
        if inside(found.P, cells, factors) * INSIDE > 1:
            return found, over, found.P, ""
        P = found.P
    return None, over, P, f"the tube still grew after {rounds} rounds"


def of_linear_loop(
    loop: Deviations,
    cells: Sequence[CommandCell],
    linear: Sequence[Enclosed],
    roots: Array,
    sizes: Array,
    solver: Solver,
) -> tuple[Array, float] | None:
    """P of the smallest ellipsoids of the linear loop and their rate alpha, that of the smallest
    ones of one interval in the middle, of a sampled loop of all; None: there are none.
    """
    middle, jump = cells[len(cells) // 2].interval, loop.reference.jump
    some, own_roots = list(linear), roots
    if jump is None:
        some = [o for o in linear if o.cell.interval == middle]
        own_roots = roots[: len(some[0].nodes)]
        some = [o._replace(nodes=tuple(range(len(own_roots)))) for o in some]
    rates: tuple[float, ...] = DECAYS if isinstance(loop.model, Helicopter) else MORE_DECAYS
    if jump is not None:  # each try is long: that of the slowest mode of the linear loop
        A, period = linear[0].over.corners[0, 0, 0][:, : len(jump)], loop.reference.nodes[-1]
        modes = np.linalg.eigvals(jump @ expm(A * period))
        rates = (float(max(-np.log(np.abs(modes).max()) / period, DECAYS[0])),)
    for own in (rates, SLOW_DECAYS) if isinstance(loop.model, Helicopter) else (rates,):
        tries = [
            (smallest(some, own_roots, sizes, decay, SPARE, solver, jump), decay) for decay in own
        ]
        made = [(f, decay) for f, decay in tries if f is not None]
        if made:
            found, decay = min(made, key=lambda each: each[0].size)
            if len(some) < len(linear):
                found = smallest(linear, roots, sizes, decay, SPARE, solver, jump)
            return None if found is None else (found.P, decay)
    return None


def enclosed_cells(
    loop: Deviations,
    cells: Sequence[CommandCell],
    factors: Array,
    drifts: Array,
    share: float = 1.0,
) -> list[Enclosed] | None:
    """The cells with the sets of their F; None where one has no bounds."""
    p, out = loop.reference.nodes, []
    for over, cell, L in zip(
        loop.enclosed(cells, factors, drifts, share), cells, factors, strict=True
    ):
        if over is None:
            return None
        nodes = _nodes(cell, len(p))
        out.append(Enclosed(cell, nodes, float(p[nodes[-1]] - p[nodes[0]]), over, L))
    return out


def coordinates(P: Array, cells: Sequence[CommandCell]) -> tuple[Array, Array]:
    """Roots (nodes, n, n) of the ellipsoids of P, e = root z, and factors (cells, n, n) of an
    ellipsoid around those of each cell.
    """
    roots = np.linalg.inv(np.swapaxes(np.linalg.cholesky(P), 1, 2))
    return roots, np.array([_around(_ends(P, cell)) for cell in cells])


def inside(P: Array, cells: Sequence[CommandCell], factors: Array) -> float:
    """The least e'P e on the borders of the ellipsoids of the factors: above 1 those of P lie
    inside them.
    """
    return min(
        np.linalg.eigvalsh(L.T @ end @ L)[0]
        for cell, L in zip(cells, factors, strict=True)
        for end in _ends(P, cell)
    )


def _ends(P: Array, cell: CommandCell) -> list[Array]:
    """P at the ends of a cell in airspeed."""
    own = P[list(_nodes(cell, len(P)))]
    return [own[0] + s * (own[-1] - own[0]) for s in cell.s]


def _around(ends: Sequence[Array]) -> Array:
    """The factor L of an ellipsoid e = L z that holds those of all P."""
    mean = sum(ends) / len(ends)
    least = min(eigh(P, mean, eigvals_only=True)[0] for P in ends)
    return np.linalg.inv(np.linalg.cholesky(mean * min(least, 1.0))).T
