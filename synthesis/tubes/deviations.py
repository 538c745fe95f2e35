"""Deviations of a nonlinear model from its reference under state feedback, over ellipsoids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi
import numpy as np

from symheli import Helicopter
from symheli.values.arrays import Array
from symheli.values.summary import summarized
from synthesis.tubes.enclosure import AffineForm, Domain, SegmentAverages, enclose, segment_averages
from synthesis.tubes.enclosure.form import EPS
from synthesis.tubes.inequality import ROUNDED, ROUNDED_UP, MatrixSet, elementwise, rank_one
from synthesis.tubes.motions import Motions
from synthesis.tubes.reference import Reference

SMALL = 1e-3
"""Rate, 1/s, up to which a term is part of the remainder: the deviations' change over their size.
"""
TAMED = 1e-3
"""Share of the largest kinks' squares below which offsets of a kink are kept small."""
TINY = 1e-300
"""Least divisor where a square may be 0."""
SEGMENTS = 4
"""Parts of the way to a deviation, by default,"""
MOST_SEGMENTS = 1000
"""and at most."""
CORNERS = 3
"""Commands at whose ends the inequality is checked; the others are terms of the remainder."""


@dataclass(frozen=True)
class CommandCell:
    """Commands between two nodes of the scheduling command: shares `s` of the way from one to the
    other, its rates `a`, as accelerations in m/s^2, and `others` that cells split, each (lower,
    upper).
    """

    interval: int
    s: tuple[float, float]
    a: tuple[float, float]
    others: tuple[tuple[float, float], ...] = ()

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Ranges of s, a and the others."""
        return (self.s, self.a, *self.others)

    @property
    def domain(self) -> tuple[Array, Array]:
        """Centre and half widths of the ranges, which cover the cell."""
        lower, upper = np.array(self.ranges).T
        centre = 0.5 * (lower + upper)
        half = np.maximum(upper - centre, centre - lower)
        return centre, np.where(half > 0, np.nextafter(half, np.inf), 0.0)


@dataclass(frozen=True, eq=False)
class Deviations:
    """de/dt of e = x - x_r with u = u_r + K e in gusts of amplitude `gust`.

    model: a helicopter with its `Reference`, or any dx/dt = f(x, u, w) with its `Motions`. gust:
    m/s, body axes, any direction; or the size of w. segments: parts of the way to a deviation over
    which the Jacobian is averaged; more are sharper and take longer.
    """

    model: Helicopter | casadi.Function
    reference: Reference | Motions
    gust: float
    segments: int = SEGMENTS

    __repr__ = summarized

    @property
    def name(self) -> str:
        """Name of the vehicle, or of the model's function."""
        own = self.model
        if not isinstance(own, Helicopter):
            return own.name()
        governor = "an ideal governor" if own.governor == "ideal" else "the governor and engine"
        return f"{own.vehicle.name} with {governor}"

    @property
    def _named(self) -> Any:
        return self.reference if isinstance(self.reference, Motions) else self.model

    @property
    def hypotheses(self) -> tuple[str, ...]:
        """Hypotheses of model and gusts, in sentences."""
        return self.reference.hypotheses(self.name, self.gust, self.states)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states, those of the controller and of servos after those of the model."""
        own = self.reference
        further = () if isinstance(own, Motions) else own.equipment.names
        return (*map(str, self._named.states), *further)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the controls."""
        return tuple(self._named.inputs)

    @property
    def feedback(self) -> Array:
        """K (nodes, k + m, n + m), or one for all: controls, and the rates of the further states,
        by the deviations.
        """
        own = self.reference
        return own.gain if isinstance(own, Motions) else own.closed

    @property
    def disturbances(self) -> int:
        """Number of components of w."""
        return 3 if isinstance(self.model, Helicopter) else self.model.size1_in(2)

    @cached_property
    def _functions(self) -> tuple[casadi.Function, casadi.Function | None]:
        """(e, w, c, data) -> de/dt; of a helicopter (e, w, c, data, lam) -> de/dt, balance of the
        inflow, with (e, w, c, data) -> lam.
        """
        r = self.reference
        sizes = (len(self.states), self.disturbances, 1 + len(r.ranges) + len(r.whole))
        e, w, c = (casadi.SX.sym(name, k) for name, k in zip("ewc", sizes, strict=True))
        data = casadi.SX.sym("data", r.data.shape[1])
        x, moving, u, K = r.between(data, c)
        n, moved = self.moved, u + K @ e
        at = ((x + e)[:n], moved[: len(self.inputs)], self.gust * w)
        if not isinstance(self.model, Helicopter):
            rate = self.model(*at) - (self.model(x, u, 0) if moving is None else moving)
            return casadi.Function("deviation", [e, w, c, data], [casadi.densify(rate)]), None
        lam = casadi.SX.sym("lam", 2)
        xdot, balance = self.model.implicit(*at, lam)
        rate = casadi.vertcat(xdot, moved[len(self.inputs) :]) - moving
        function = casadi.Function("deviation", [e, w, c, data, lam], [rate, balance])
        return function, casadi.Function("inflow", [e, w, c, data], [self.model.inflow(*at)])

    @property
    def moved(self) -> int:
        """Number of states of the model; the others' rates are linear in the deviations."""
        return len(self._named.states)

    @cached_property
    def _linear(self) -> tuple[int, Array | None, Array]:
        """`moved`, the rates of the other states by all deviations where they are the same for all
        commands, and (states, k): rates that servos add by resolving their commands in steps, each
        times a number within [-1, 1].
        """
        n, r = self.moved, self.reference
        if isinstance(r, Motions) or not isinstance(self.model, Helicopter):
            return n, None, np.zeros((n, 0))
        further = r.equipment.steps(self.model.travel)
        rates = r.closed[0, len(self.inputs) :] if len(r.airspeeds) == 1 else None
        return n, rates, np.vstack([np.zeros((n, further.shape[1])), further])

    @property
    def rate(self) -> casadi.Function:
        """(e, w, c, data) -> de/dt: w in units of `gust`, c as `between` of the reference takes."""
        function, start = self._functions
        if start is None:
            return function
        at = [casadi.SX.sym(f"in{i}", function.size1_in(i)) for i in range(4)]
        return casadi.Function("rate", at, [function(*at, start(*at))[0]])

    def enclosed(
        self, cells: Sequence[CommandCell], factors: Array, drifts: Array, share: float = 1.0
    ) -> list[MatrixSet | None]:
        """For each cell the set of F for e = factor z, |z| <= 1, and all gusts; None where there is
        no bound. `share`: of these deviations and gusts, over which the Jacobian is enclosed.

        f(e, w) - f(0, 0) = J [e; w] with the average J of the Jacobian over the segment to (e, w):
        the part of J that is linear in (e, w) is halved.
        """
        function, start = self._functions
        m, whole = self.disturbances, len(self.reference.whole)
        zero, calm = np.zeros(factors.shape[-1]), np.zeros(m)
        found: list[MatrixSet | None] = []
        for cell, factor, drift in zip(cells, factors, drifts, strict=True):
            places, widths, commands, data = self.parts(cell, self.reference.jacobian_parts)
            ellipsoid = Domain.ellipsoid(zero, share * factor)
            over = (ellipsoid, Domain.ellipsoid(calm, share * np.eye(m)), commands, data)
            parts = segment_averages(
                function, *over, along=[0, 1], start=start, pieces=self.segments
            )
            if np.all(np.isfinite(parts.average.rest)):
                units = np.concatenate([np.linalg.norm(factor, axis=1), np.ones(m + 1)])
                own = _covered(parts, places, widths, whole, units)
                found.append(_matrix_set(*own, drift, factor, units, self._linear))
            else:
                found.append(None)
        return found

    def drifts(self, cells: Sequence[CommandCell]) -> Array:
        """For each cell f(x_r, u_r, 0) - dx_r/dt: centre, rest and the parts linear in the commands
        that cells do not split (jerk and its derivative), (N, 2 + k, n). Infinite where there is no
        bound; 0 where the reference is a motion of the equations.
        """
        n, whole = len(self.states), len(self.reference.whole)
        if not self.reference.drifts:
            return np.zeros((len(cells), 2 + whole, n))
        function, start = self._functions
        still = (Domain.point(np.zeros(n)), Domain.point(np.zeros(self.disturbances)))
        found = []
        for cell in cells:
            _, _, commands, data = self.parts(cell, self.reference.drift_parts)
            value = enclose(function, *still, commands, data, start=start).value
            split = value.slopes.shape[-1] - whole
            by = value.slopes[..., split:]
            radius = (np.abs(value.slopes[..., :split]).sum(axis=-1) + value.rest) * ROUNDED_UP
            lower, upper = (value.centre - radius).min(axis=0), (value.centre + radius).max(axis=0)
            middle, linear = 0.5 * (lower + upper), by.mean(axis=0)
            rest = upper - middle + np.abs(by - linear).max(axis=0).sum(axis=-1)
            rest += 8 * EPS * (np.abs(middle) + np.abs(linear).sum(axis=-1))
            found.append([middle, rest * ROUNDED_UP, *linear.T])
        return np.array(found)

    def is_defined(self, cells: Sequence[CommandCell]) -> bool:
        """Whether the reference of another model than a helicopter is shown to exist for all
        commands of these cells: a motion that holds sqrt(c) does not where c < 0.
        """
        r = self.reference
        if not isinstance(r, Motions):
            return True
        c, data = casadi.SX.sym("c", 1 + len(r.ranges)), casadi.SX.sym("data", r.data.shape[1])
        x, moving, u, _ = r.between(data, c)
        values = [casadi.densify(v) for v in (x, moving, u) if v is not None and v.numel()]
        function = casadi.Function("reference", [c, data], [casadi.vertcat(*values)])
        every = (self.parts(cell, r.drift_parts)[2:] for cell in cells)
        return all(np.all(enclose(function, *each).finite) for each in every)

    def parts(self, cell: CommandCell, parts: Sequence[int]) -> tuple[Array, Array, Domain, Domain]:
        """A cell in so many parts along each of its ranges, with all the other commands: the parts'
        places (N, r) and half widths (r,) in units of the cell's half widths, the commands, and the
        data of the reference.
        """
        centre, half = cell.domain
        split = [
            np.arange(1 - k, k, 2) / k if h > 0 else np.zeros(1)
            for k, h in zip(parts, half, strict=True)
        ]
        places = np.stack(np.meshgrid(*split, indexing="ij"), axis=-1).reshape(-1, len(half))
        centres = centre + half * places
        own = half / [len(side) for side in split] + 4 * EPS * (np.abs(centre) + half)
        own, unit = np.where(half > 0, own, 0.0), np.where(half > 0, half, 1.0)
        whole = self.reference.whole
        size = len(half) + len(whole)
        commands = Domain(
            np.hstack([centres, np.zeros((len(places), len(whole)))]),
            np.diag([*own, *whole]),
            (1,) * size,
        )
        data = Domain.point(self.reference.data[cell.interval])
        return (centres - centre) / unit, own / unit, commands, data


def _covered(
    parts: SegmentAverages, places: Array, widths: Array, whole: int, units: Array
) -> tuple[AffineForm, Array, Array]:
    """One form of a cell that covers those of its parts, linear in all of its ranges, and (left,
    weights) of its kinks as in a `MatrixSet`.

    `parts` of (parts, n, .): the last symbols of the domains are those of the ranges and of `whole`
    other commands. `units` (q,): sizes of deviations and inputs.
    """
    forms, switched, turning = parts
    kinks, rest = _kinks(switched, turning, forms.groups, units)
    design = np.hstack([np.ones((len(places), 1)), places])
    slopes, command = forms.slopes.mean(axis=0), _commands(forms, places, whole)
    _place(
        kinks, forms.centre, slopes[..., command] / np.where(widths > 0, widths, 1.0), places, units
    )
    moved = np.array([kink.offset for kink in kinks]).reshape(len(kinks), len(places))
    mains = np.array([kink.main for kink in kinks]).reshape(len(kinks), *rest.shape[1:])
    centres = forms.centre - np.tensordot(moved.T, mains, axes=1)
    centre, *by = np.tensordot(np.linalg.pinv(design), centres, axes=1)
    slopes[..., command] = np.stack(by, axis=-1)
    missed = rest + np.abs(centres - centre - np.tensordot(places, np.array(by), axes=1))
    own = slopes.copy()
    own[..., command] *= widths
    missed += _by_groups(np.abs(forms.slopes - own), forms.groups)
    size = np.abs(forms.centre) + np.abs(forms.slopes).sum(axis=-1)
    size = size + np.tensordot(np.abs(moved.T), np.abs(mains), axes=1)
    rest = (forms.rest + missed + 16 * EPS * size).max(axis=0)
    left, weights = [], []
    for kink in kinks:
        if kink.rate > SMALL:
            left.append(kink.left * units[: len(rest)])
            weights.append(kink.weight(units))
        else:
            rest = rest + kink.bound(units)
    n, q = len(rest), len(units)
    return (
        AffineForm(centre, slopes, rest * ROUNDED_UP, forms.groups),
        np.reshape(left, (-1, n)),
        np.reshape(weights, (-1, q, q)),
    )


@dataclass
class _CellKink:
    """Matrices left (offset + number) row' of a kink over the parts of a cell, in units of equal
    weight: left (n,); row (m,) and further `blocks` (m, .), each times a vector of norm <= 1 of its
    own; share (parts,) >= |number|; offset (parts,) of the parts on one side; main (n, m), left
    row' in SI units.
    """

    left: Array
    row: Array
    blocks: list[Array]
    share: Array
    main: Array
    offset: Array
    size: float

    def is_placed(self, offset: Array) -> None:
        """Let the parts have these offsets (parts,), up to a constant with which the sum of offset
        and share is the smallest.
        """
        upper, lower = (offset + self.share).max(), (offset - self.share).min()
        self.offset = offset - 0.5 * (upper + lower)
        self.size = float((np.abs(self.offset) + self.share).max() * ROUNDED_UP)

    @property
    def _all(self) -> list[Array]:
        return [self.size * self.row[:, None], *self.blocks]

    @property
    def rate(self) -> float:
        """Its size, 1/s."""
        return float(sum(np.linalg.norm(block) for block in self._all) * np.linalg.norm(self.left))

    def weight(self, units: Array) -> Array:
        """(q, q): of the squares of all rows, by Cauchy's inequality."""
        blocks = [block for block in self._all if np.any(block)]
        sizes = np.array([np.linalg.norm(block) for block in blocks])
        total, out = sizes.sum(), np.zeros((len(units), len(units)))
        for block, size in zip(blocks, sizes, strict=True):
            own = np.zeros((len(units), block.shape[1]))
            own[: len(block)] = block / units[: len(block), None] * np.sqrt(total / size)
            # not less than the exact product, in the order of matrices, by Gershgorin's theorem
            out += own @ own.T + (ROUNDED_UP - 1) * np.diag((own**2).sum(axis=1))
        return out * ROUNDED_UP

    def bound(self, units: Array) -> Array:
        """Sizes of its entries (n, m)."""
        rows = sum(np.linalg.norm(block, axis=1) for block in self._all)
        n, m = self.main.shape
        return np.abs(self.left * units[:n])[:, None] * rows / units[:m] * ROUNDED_UP


def _place(
    kinks: Sequence[_CellKink], centres: Array, by: Array, places: Array, units: Array
) -> None:
    """Choose the offsets of the kinks: with them the centres (parts, n, m) of parts at these places
    are most nearly linear in the ranges, of slopes near by (n, m, r), by least squares.
    """
    if not kinks:
        return
    n, m = centres.shape[1:]

    def scaled(matrices: Array) -> Array:
        return (matrices / units[:n, None] * units[:m]).reshape(len(matrices), -1)

    mains = np.array([np.outer(kink.left, kink.row).ravel() for kink in kinks])
    gram = mains @ mains.T
    gram += (TAMED * np.trace(gram) + TINY) * np.eye(len(gram))
    off = scaled(centres) - places @ (scaled(np.moveaxis(by, -1, 0)))
    for kink, offset in zip(
        kinks, np.linalg.solve(gram, mains @ (off - off.mean(0)).T), strict=True
    ):
        kink.is_placed(offset)


def _kinks(
    switched: Array, turning: Array, groups: tuple[int, ...], units: Array
) -> tuple[list[_CellKink], Array]:
    """Kinks of `SegmentAverages` (parts, pieces, n, m, k), and the sizes of what they leave (parts,
    n, m).
    """
    parts, _, n, m, _ = switched.shape
    rest, found = np.zeros((parts, n, m)), []
    over = np.outer(units[:n], 1 / units[:m])
    for k in range(switched.shape[-1]):
        each, turns = switched[..., k] / over, turning[..., k] / over[..., None]
        sizes = np.linalg.norm(each, axis=(2, 3))
        U, s, V = np.linalg.svd(each[np.unravel_index(sizes.argmax(), sizes.shape)])
        left, row = U[:, 0], s[0] * V[0]
        rows, turned = (np.moveaxis(own, 2, -1) @ left for own in (each, turns))
        missed = np.abs(each - left[:, None] * rows[..., None, :])
        missed += _by_groups(np.abs(turns - left[:, None, None] * turned[..., None, :, :]), groups)
        share = rows @ row / max(row @ row, TINY)
        apart = rows - share[..., None] * row
        # rows that differ from part to part, by the two main directions of their differences
        directions = np.linalg.svd(apart.reshape(-1, m), full_matrices=False)[2][:2]
        along = apart @ directions.T
        blocks = (directions * np.abs(along).mean(axis=1).max(axis=0)[:, None])[..., None]
        common, more = _common_turns(turned, groups)
        more = more + np.abs(apart - along @ directions)
        missed += np.abs(left)[:, None] * more[..., None, :]
        size = np.abs(each) + np.abs(turns).sum(axis=-1)
        missed += 16 * EPS * (size + np.abs(left)[:, None] * size.sum(axis=2, keepdims=True))
        rest += missed.mean(axis=1) * over
        shares = np.abs(share).mean(axis=1) * ROUNDED_UP
        main = left[:, None] * row * over
        found.append(
            _CellKink(left, row, [*blocks, *common], shares, main, 0 * shares, shares.max())
        )
    return found, rest * ROUNDED_UP


def _common_turns(turned: Array, groups: tuple[int, ...]) -> tuple[list[Array], Array]:
    """Blocks (m, .), one for each group of symbols, that cover the means over pieces of turned
    (parts, pieces, m, symbols), each times a number in [-1, 1], and the sizes of what that leaves
    (parts, pieces, m).
    """
    blocks, rest, start = [], np.zeros(turned.shape[:3]), 0
    for group in groups:
        own = turned[..., start : start + group]
        start += group
        sizes = np.linalg.norm(own, axis=(2, 3))
        main = own[np.unravel_index(sizes.argmax(), sizes.shape)]
        share = np.tensordot(own, main, 2) / max(np.sum(main * main), TINY)
        left = own - share[..., None, None] * main
        rest += np.linalg.norm(left, axis=-1) + 4 * EPS * np.abs(own).sum(axis=-1)
        blocks.append(main * np.abs(share).mean(axis=1).max() * ROUNDED_UP)
    return blocks, rest


def _by_groups(sizes: Array, groups: tuple[int, ...]) -> Array:
    """Sums over groups of symbols, the last axis, of the norms of sizes of slopes."""
    out, start = np.zeros(sizes.shape[:-1]), 0
    for group in groups:
        if start < sizes.shape[-1]:
            out += np.linalg.norm(sizes[..., start : start + group], axis=-1)
            start += group
    return out


def _commands(forms: AffineForm, places: Array, whole: int) -> slice:
    """The symbols of the ranges of a cell."""
    symbols = forms.slopes.shape[-1]
    return slice(symbols - whole - places.shape[1], symbols - whole)


def _matrix_set(
    average: AffineForm,
    left: Array,
    weights: Array,
    drift: Array,
    factor: Array,
    units: Array,
    linear: tuple[int, Array | None, Array],
) -> MatrixSet:
    """The set of F; left, weights: of the kinks; linear: see `Deviations._linear`."""
    n, (r, rates, steps) = len(factor), linear
    q, symbols = len(units), average.slopes.shape[-1]
    m = q - n - 1
    slopes = np.zeros((symbols, n, q))
    slopes[..., :-1] = np.moveaxis(average.slopes, -1, 0)
    slopes[symbols - len(drift) + 2 : symbols, :, -1] = drift[2:]
    if np.any(slopes[: n + m, r:]):
        raise ValueError("the rates of controller and servos are linear in the deviations")
    tube, gust, command = slopes[:n], slopes[n : n + m], slopes[n + m : symbols]
    centre, rest = np.zeros((n, q)), np.zeros((n, q))
    centre[:, :-1], centre[:, -1] = average.centre, drift[0]
    rest[:, :-1], rest[:, -1] = average.rest, drift[1]
    if rates is not None:  # as stored, without rounding; the reference misses nothing of them
        centre[r:], rest[r:], slopes[:, r:] = 0.0, 0.0, 0.0
        centre[r:, :n] = rates
    # z_k H_k w = y_m G_m e, since z = factor^-1 e and y = w: one multiplier takes both
    inverse, wind = np.linalg.inv(factor), slice(n, n + m)
    cross = tube[:, :, wind].copy()
    gust[:, :, :n] += np.einsum("knm,ke->mne", cross, inverse)
    tube[:, :, wind] = 0.0
    products = np.einsum("knm,ke->ne", np.abs(cross), np.abs(inverse))
    rest[:, :n] += ROUNDED * (products + np.abs(gust[:, :, :n]).sum(axis=0))
    missed = np.abs(np.eye(n) - inverse @ factor) + ROUNDED * np.abs(inverse) @ np.abs(factor)
    rest[:, wind] += missed.sum(axis=1).max() * np.abs(cross).sum(axis=0)
    # linear in s, a and j: the corners of the cell
    at_ends = np.zeros((CORNERS, n, q))
    at_ends[: len(command)] = command[:CORNERS]
    signs = [(-1, 1) if np.any(part) else (0,) for part in at_ends]
    corners = centre + np.tensordot(np.stack(np.meshgrid(*signs, indexing="ij"), -1), at_ends, 1)
    rounded = ROUNDED * (np.abs(centre) + np.abs(command).sum(axis=0))
    rest[: n if rates is None else r] += rounded[: n if rates is None else r]
    others = command[CORNERS:]
    rates = np.abs(others / units[:n, None] * units).max(axis=(1, 2))
    own, squares, more = rank_one(others[rates > SMALL], units)
    left, weights = np.vstack([left, own]), np.concatenate([weights, squares])
    rest += more + np.abs(others[rates <= SMALL]).sum(axis=0) * ROUNDED_UP
    rows, diagonal = elementwise(rest * ROUNDED_UP, units)
    size = np.linalg.norm(steps / units[:n, None], axis=0) ** 0.5
    constant = np.zeros((steps.shape[1], q, q))
    constant[:, -1, -1] = size**2 * ROUNDED_UP
    return MatrixSet(
        corners,
        np.eye(n)[:, :r],
        tube[:, :r],
        gust[:, :r],
        np.vstack([left, rows, (steps / size).T]),
        np.concatenate([weights, diagonal, constant]),
    )
