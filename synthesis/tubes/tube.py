"""Invariant tubes of the nonlinear helicopter about steady flight and along transitions."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eigh

from symheli import Helicopter
from symheli.airframe.vehicle import load_vehicle
from symheli.airframe.written import as_toml
from symheli.errors import InputError
from symheli.progress import Task, task, tracked
from symheli.values.summary import summarized
from symheli.values.whole_files import write_text
from synthesis.program.cone_program import Solver
from synthesis.tubes.deviations import Cell, Deviations
from synthesis.tubes.inequality import Multipliers
from synthesis.tubes.proof import holds
from synthesis.tubes.reference import TUBE_SIZES, Reference, held, moving
from synthesis.tubes.search import Enclosed, Found, smallest

Array = np.ndarray

SCHEMA, VERSION = "symheli tube", 2
INTERVAL = 1.0
"""Largest distance of the nodes of reference, feedback and P along airspeed, m/s."""
DOWNWARD = 0.75
"""Largest change of the reference's velocity along the body's axis in a cell, m/s, by a change of
acceleration: p a/g.
"""
GRAVITY = 9.8
"""m/s^2; of the choice of cells only."""
DECAYS = (1.0, 2.0, 3.0)
"""Rates alpha that are tried on the linear loop, 1/s."""
FIRST_SHARE = 0.1
"""Share of the deviations and gusts over which the equations are enclosed at first; without any the
multipliers have no bound.
"""
FIRST_SIZE = 0.3
"""First half widths, in units of `TUBE_SIZES`."""
FIRST_GROWTH, GROWTH = 1.5, 1.05
"""Factors on the half widths from one round of the search to the next."""
ROUNDS = 15
SPARE = 0.02
"""Spare of the inequality in the search, 1/s."""
INSIDE = 1 - 1e-6
"""Share of the enclosed deviations that the tube may fill, for rounding of the search."""
TOLERANCE = 1e-6
"""Of the semidefinite programs: the exact check decides."""


@dataclass(frozen=True, eq=False)
class Tube:
    """The deviations e = x - x_r with e'P e <= 1, which the nonlinear helicopter does not leave.

    Made by `tube`; `verify` proves it again from these fields alone.

    Attributes
    ----------
    deviations : Deviations
        The closed loop: helicopter, reference, feedback, gust amplitude.
    P : array (k, n, n)
        At the k nodes of the airspeed, linear between, in SI units; the search's last ones where
        nothing was proven.
    cells : tuple of Cell
        Parts of the commands, each with a proof of its own.
    factors : array (cells, n, n)
        The deviations e = factor z, |z| <= 1, over which the equations are enclosed.
    multipliers : tuple of Multipliers
        Of the matrix inequality of each cell; none where nothing was found.
    proven : bool
        The inequality holds in exact arithmetic for every enclosed matrix.
    why : str
        Why there is no proof; empty where there is one.

    Raises
    ------
    InputError
        `save` of a tube without a proof, `load` of a file that is damaged or another.

    Examples
    --------
    >>> import symheli
    >>> found = tube(symheli.Helicopter.load("xcell60", governor="ideal"), 3.0, gust=0.1)
    >>> found.save("tube.json").name, Tube.load("tube.json").proven
    ('tube.json', True)
    """

    deviations: Deviations
    P: Array
    cells: tuple[Cell, ...]
    factors: Array
    multipliers: tuple[Multipliers, ...]
    proven: bool
    why: str

    __repr__ = summarized

    @property
    def airspeeds(self) -> Array:
        """Nodes of the commanded airspeed, m/s; one where it is held."""
        return self.deviations.reference.airspeeds

    def at(self, airspeed: float) -> Array:
        """P (n, n) at a commanded airspeed, m/s."""
        return self.along([airspeed])[0]

    def along(self, airspeeds: Any) -> Array:
        """P (N, n, n) at commanded airspeeds (N,), m/s."""
        i, s = self.deviations.reference.place(airspeeds)
        return self.P[i] + s[:, None, None] * (self.P[i + (len(self.P) > 1)] - self.P[i])

    @cached_property
    def half_widths(self) -> Array:
        """Largest deviation of each state at any airspeed, (n,), SI."""
        # convex in P, which is linear between the nodes
        return np.sqrt(np.diagonal(np.linalg.inv(self.P), axis1=1, axis2=2)).max(axis=0)

    @cached_property
    def control_half_widths(self) -> Array:
        """Largest deviation of each control from that of the reference at the nodes, (4,), rad."""
        K = self.deviations.reference.gain
        return np.sqrt(np.einsum("kui,kij,kuj->ku", K, np.linalg.inv(self.P), K)).max(axis=0)

    @property
    def hypotheses(self) -> tuple[str, ...]:
        """What the statement rests on, in sentences."""
        d, p = self.deviations, self.airspeeds
        a, j, b = d.reference.limits
        command = f"the commanded airspeed is {p[0]:g} m/s"
        if len(p) > 1:
            bounded = (
                f", which changes by at most {b:g} m/s^4" if math.isfinite(b) else " that may jump"
            )
            command = (
                f"the commanded airspeed stays within {p[0]:g} to {p[-1]:g} m/s, its acceleration"
                f" within {a:g} m/s^2, with a jerk of at most {j:g} m/s^3{bounded}"
            )
        return (
            f"the equations of {d.heli.vehicle.name} with an ideal governor; u = u_r + K e in"
            " continuous time with all ten states known; no servos, no delay",
            "controls within their travel: they differ from those of the reference by no more than"
            " the control deviations",
            f"{command}; gusts have at most {d.gust:g} m/s, any direction in body axes and any"
            " history",
            "the deviation lies in the tube at the start",
        )

    def __str__(self) -> str:
        named = zip(self.deviations.heli.states, self.half_widths, strict=True)
        sizes = ", ".join(f"{name} {width:.3g}" for name, width in named)
        inputs = zip(self.deviations.heli.inputs, self.control_half_widths, strict=True)
        controls = ", ".join(f"{name} {width:.3g}" for name, width in inputs)
        if not self.proven:
            return f"no tube: {self.why}"
        return "\n".join(
            [
                "invariant tube of the nonlinear equations, proven",
                f"largest deviations (SI): {sizes}",
                f"of the controls (rad): {controls}",
                *(f"- {line}" for line in self.hypotheses),
            ]
        )

    def contains(self, deviation: Any, airspeed: float | None = None) -> bool:
        """Whether a deviation (n,), SI, lies in the tube at a commanded airspeed, m/s."""
        e = np.asarray(deviation, float)
        return bool(e @ self.at(self.airspeeds[0] if airspeed is None else airspeed) @ e <= 1)

    def verify(self) -> bool:
        """Enclose the equations again and check the inequality in exact arithmetic."""
        loop, p = self.deviations, self.airspeeds
        complete = len(self.cells) == len(self.factors) == len(self.multipliers)
        if not (complete and _covers(self.cells, loop.reference)):
            return False
        parts = list(zip(self.cells, self.factors, self.multipliers, strict=True))
        for cell, factor, by in tracked("verifying cells", parts):
            (over,) = loop.enclosed([cell], factor[None], loop.drifts([cell]))
            nodes = list(_nodes(cell, len(p)))
            if (
                over is None
                or by.terms.shape != (len(over.left),) * 2
                or not holds(self.P[nodes], p[nodes], cell, over, factor, by)
            ):
                return False
        return True

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the tube as JSON: equations (the vehicle file), feedback and proof."""
        if not self.proven:
            raise InputError(f"only a proven tube is saved; here {self.why}")
        d, heli, r = self.deviations, self.deviations.heli, self.deviations.reference
        proof = [
            {name: np.asarray(m).tolist() for name, m in by._asdict().items()}
            for by in self.multipliers
        ]
        limits = [limit if math.isfinite(limit) else None for limit in r.limits]
        content = {
            "schema": SCHEMA,
            "version": VERSION,
            "name": heli.vehicle.name,
            "vehicle": as_toml(heli.vehicle),
            "density": heli.density,
            "smoothing": heli.smoothing,
            "printed": sorted(heli.printed),
            "gust": d.gust,
            "limits": limits,
            **{name: getattr(r, name).tolist() for name in ARRAYS},
            "P": self.P.tolist(),
            "cells": [[cell.interval, *cell.s, *cell.a] for cell in self.cells],
            "factors": self.factors.tolist(),
            "multipliers": proof,
        }
        return write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Tube:
        """Read a tube and prove it again; `proven` says whether that succeeded."""
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"))
            if not isinstance(content, dict) or content.get("schema") != SCHEMA:
                raise InputError(f"{path}: expected the schema {SCHEMA!r}, written by Tube.save")
            if content["version"] != VERSION:
                raise InputError(
                    f"{path}: expected version {VERSION} of the schema, got"
                    f" {content['version']!r:.60}; read it with the version that wrote it"
                )
            found = _read(content)
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"{path}: damaged, a value is invalid or missing ({error})") from None
        proven = found.verify()
        why = "" if proven else "the inequality does not hold in exact arithmetic"
        return replace(found, proven=proven, why=why)


ARRAYS = ("airspeeds", "steady", "jerk", "snap", "gain")
"""Fields of `Reference` that are stored as they are."""


ARRAYS = ("airspeeds", "steady", "jerk", "snap", "gain")
"""Fields of `Reference` that are stored as they are."""


def _read(content: dict[str, Any]) -> Tube:
    with tempfile.TemporaryDirectory(prefix="symheli-") as folder:
        file = Path(folder) / f"{Path(str(content['name'])).name}.toml"
        file.write_text(content["vehicle"], encoding="utf-8")
        vehicle = load_vehicle(file)
    heli = Helicopter(
        vehicle,
        "ideal",
        float(content["density"]),
        frozenset(content["printed"]),
        float(content["smoothing"]),
    )
    n = len(heli.states)

    def array(values: Any, *shape: int) -> Array:
        read = np.asarray(values, float)
        if read.shape != shape or not np.all(np.isfinite(read)):
            raise ValueError(f"expected finite numbers of shape {shape}, got {read.shape}")
        return read

    k, count = len(content["airspeeds"]), len(content["cells"])
    powers = np.shape(content["steady"])[2]
    shapes = ((k,), (k, 2, powers, n + 4), (k, n + 4), (k, 4), (k, 4, n))
    parts = {name: array(content[name], *shape) for name, shape in zip(ARRAYS, shapes, strict=True)}
    if not (k > 0 and np.all(np.diff(parts["airspeeds"]) > 0)):
        raise ValueError("the airspeeds do not increase")
    limits = [math.inf if limit is None else float(limit) for limit in content["limits"]]
    a, j, snap = limits
    reference = Reference(**parts, limits=(float(array(a)), float(array(j)), snap))

    def proof(given: dict[str, Any]) -> Multipliers:
        terms = np.asarray(given["terms"], float)
        return Multipliers(
            array(given["tube"], n, n),
            array(given["gust"], n, n),
            array(terms, *terms.shape),
            array(given["wind"], 1, 1),
            float(array(given["decay"])),
        )

    cells = [(int(c[0]), tuple(array(c[1:3], 2)), tuple(array(c[3:], 2))) for c in content["cells"]]
    return Tube(
        Deviations(heli, reference, float(array(content["gust"]))),
        array(content["P"], k, n, n),
        tuple(Cell(i, (float(s[0]), float(s[1])), (float(a[0]), float(a[1]))) for i, s, a in cells),
        array(content["factors"], count, n, n),
        tuple(proof(given) for given in content["multipliers"]),
        False,
        "not verified",
    )


def tube(
    heli: Helicopter,
    airspeed: float | tuple[float, float],
    *,
    gust: float,
    acceleration: float = 0.0,
    jerk: float = 0.0,
    snap: float = math.inf,
    gain: Any = None,
    solver: Solver | None = None,
) -> Tube:
    """A proven invariant tube of the nonlinear helicopter in level flight, in gusts.

    With u = u_r + K e, the deviation e = x - x_r from the reference stays in e'P e <= 1 for every
    gust history of the amplitude, and every history of the commanded airspeed within its limits.
    The difference of the nonlinear equations from those of the reference is an average of their
    Jacobian times (e, w); the Jacobian is enclosed over the whole tube (`symheli.enclosure`), and a
    matrix inequality is checked for all enclosed matrices in rational arithmetic.

    Parameters
    ----------
    heli : Helicopter
        With governor "ideal": ten states.
    airspeed : float or (float, float)
        Held, or the range of the command, m/s.
    gust : float
        Largest size of the gust vector, m/s.
    acceleration, jerk : float
        Largest sizes of the first and second derivative of the command, m/s^2 and m/s^3; > 0 for a
        range.
    snap : float
        Largest derivative of the jerk, m/s^4. Infinite: the jerk may jump, and the pitch rate of
        the reference does not follow it.
    gain : array (4, 10) or (nodes, 4, 10), optional
        K, rad per SI unit, at all airspeeds or at each node. Default: linear-quadratic regulators
        on all states.
    solver : Solver, optional
        Of the semidefinite programs; by default Clarabel.

    Returns
    -------
    Tube
        `proven` says whether there is one, `why` why not; a larger tube than that found may exist.

    Raises
    ------
    InputError
        Another governor, a gust that is no number >= 0, limits that do not fit, a gain of another
        shape.
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
    >>> found.proven, bool(found.half_widths[0] < 0.02)
    (True, True)
    """
    if heli.governor != "ideal" or len(heli.states) != 10:
        raise InputError(
            "a tube needs the ten states of an ideal governor: Helicopter.load(...,"
            " governor='ideal')"
        )
    if not (np.isfinite(gust) and gust >= 0):
        raise InputError(f"gust must be a number >= 0, m/s; got {gust!r:.60}")
    limits = _limits(acceleration, jerk, snap)
    if np.ndim(airspeed) == 0:
        if limits[0] or limits[1]:
            raise InputError(
                "a held airspeed has no acceleration or jerk: give airspeed=(low, high)"
            )
        reference = held(heli, airspeed, gain)
        cells = [Cell(0, (0.0, 0.0), (0.0, 0.0))]
    else:
        reference = moving(heli, _range(airspeed, limits), limits, gain)
        cells = [
            Cell(i, (0.0, 1.0), (low, high))
            for i, p in enumerate(reference.airspeeds[1:])
            for low, high in pairwise(_accelerations(float(p), limits[0]))
        ]
    loop = Deviations(heli, reference, float(gust))
    return _found(loop, tuple(cells), solver or Solver(tolerance=TOLERANCE))


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


def _nodes(cell: Cell, count: int) -> tuple[int, ...]:
    """The nodes of a cell's interval, of so many."""
    return (0,) if count == 1 else (cell.interval, cell.interval + 1)


def _covers(cells: Sequence[Cell], reference: Reference) -> bool:
    """Whether these cells are all commands: of each interval all s in [0, 1] with every
    acceleration; and no state of the reference may jump with the jerk.
    """
    limit, still = reference.limits[0], len(reference.airspeeds) == 1
    n = reference.gain.shape[-1]
    jumps = np.isinf(reference.limits[2]) and (
        np.any(reference.jerk[:, :n]) or np.any(reference.snap)
    )
    if jumps or (still and any(reference.limits)):
        return False
    if not {c.interval for c in cells} <= set(range(reference.intervals)):
        return False
    for i in range(reference.intervals):
        own = [c for c in cells if c.interval == i]
        edges = sorted({s for c in own for s in c.s})
        if not own or (not still and (edges[0] > 0 or edges[-1] < 1)):
            return False
        for low, high in zip(edges, edges[1:] or edges, strict=False):
            there = sorted(c.a for c in own if c.s[0] <= low and high <= c.s[1])
            reach = -limit
            for a in there:
                reach = max(reach, a[1]) if a[0] <= reach else reach
            if not there or there[0][0] > -limit or reach < limit:
                return False
    return True


def _found(loop: Deviations, cells: tuple[Cell, ...], solver: Solver) -> Tube:
    """The search: the ellipsoids over which the equations are enclosed grow until the smallest ones
    that satisfy the inequality lie inside.
    """
    with task("tube", ROUNDS) as progress:
        found, factors, P, why = _grown(loop, cells, solver, progress)
    if found is None:
        return Tube(loop, P, cells, factors, (), False, why)
    made = Tube(loop, P, cells, factors, tuple(found.multipliers), True, "")
    if made.verify():
        return made
    return replace(made, proven=False, why="the inequality does not hold in exact arithmetic")


def _grown(
    loop: Deviations, cells: Sequence[Cell], solver: Solver, progress: Task
) -> tuple[Found | None, Array, Array, str]:
    """(what was found, factors, P, why nothing was)."""
    sizes, count = np.array(TUBE_SIZES), len(loop.reference.airspeeds)
    roots = np.broadcast_to(FIRST_SIZE * np.diag(sizes), (count, len(sizes), len(sizes)))
    factors = np.broadcast_to(roots[0], (len(cells), *roots[0].shape))
    P = np.broadcast_to(np.diag(sizes**-2), roots.shape)
    drifts = loop.drifts(cells)
    linear = _enclosed(loop, cells, factors, drifts, FIRST_SHARE)
    if linear is None or not np.all(np.isfinite(drifts)):
        return None, factors, P, "the equations have no bounds near the reference"
    decay = _decay(loop, cells, linear, sizes, solver)
    found = None if decay is None else smallest(linear, roots, sizes, decay, SPARE, solver)
    if decay is None or found is None:
        return None, factors, P, "the linear loop has no invariant ellipsoid"
    growth = FIRST_GROWTH
    for _ in range(ROUNDS):
        P, growth = found.P / growth**2, GROWTH
        roots = np.linalg.inv(np.swapaxes(np.linalg.cholesky(P), 1, 2))
        factors = np.array([_around(_ends(P, cell)) for cell in cells])
        over = _enclosed(loop, cells, factors, drifts)
        if over is None:
            return None, factors, P, "the equations have no bounds over a tube of the size needed"
        found = smallest(over, roots, sizes, decay, SPARE, solver)
        if found is None:
            return (
                None,
                factors,
                P,
                "no ellipsoid satisfies the inequality: the gusts are too large",
            )
        least = min(
            np.linalg.eigvalsh(L.T @ end @ L)[0]
            for cell, L in zip(cells, factors, strict=True)
            for end in _ends(found.P, cell)
        )
        progress.step(f"size {found.size**0.5:.3g}, {least**-0.5:.2f} of the deviations enclosed")
        if least * INSIDE > 1:
            return found, factors, found.P, ""
    return None, factors, P, f"the tube still grew after {ROUNDS} rounds"


def _decay(
    loop: Deviations, cells: Sequence[Cell], linear: list[Enclosed], sizes: Array, solver: Solver
) -> float | None:
    """The rate alpha of the smallest ellipsoids of the linear loop, by the cells of one interval in
    the middle; None: there are none.
    """
    middle = cells[len(cells) // 2].interval
    nodes = _nodes(cells[len(cells) // 2], len(loop.reference.airspeeds))
    own = [o._replace(nodes=tuple(range(len(nodes)))) for o in linear if o.cell.interval == middle]
    roots = np.broadcast_to(own[0].factor, (len(nodes), *own[0].factor.shape))
    tries = [(smallest(own, roots, sizes, decay, SPARE, solver), decay) for decay in DECAYS]
    return min(((f.size, decay) for f, decay in tries if f is not None), default=(0.0, None))[1]


def _enclosed(
    loop: Deviations, cells: Sequence[Cell], factors: Array, drifts: Array, share: float = 1.0
) -> list[Enclosed] | None:
    """The cells with the sets of their F; None where one has no bounds."""
    p, out = loop.reference.airspeeds, []
    for over, cell, L in zip(
        loop.enclosed(cells, factors, drifts, share), cells, factors, strict=True
    ):
        if over is None:
            return None
        nodes = _nodes(cell, len(p))
        out.append(Enclosed(cell, nodes, float(p[nodes[-1]] - p[nodes[0]]), over, L))
    return out


def _ends(P: Array, cell: Cell) -> list[Array]:
    """P at the ends of a cell in airspeed."""
    own = P[list(_nodes(cell, len(P)))]
    return [own[0] + s * (own[-1] - own[0]) for s in cell.s]


def _around(ends: Sequence[Array]) -> Array:
    """The factor L of an ellipsoid e = L z that holds those of all P."""
    mean = sum(ends) / len(ends)
    least = min(eigh(P, mean, eigvals_only=True)[0] for P in ends)
    return np.linalg.inv(np.linalg.cholesky(mean * min(least, 1.0))).T
