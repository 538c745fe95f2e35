"""Multipliers by semidefinite programs over frequencies, and the storage by a Riccati equation: in
doubles, for the exact check.

At each frequency the inequality is affine in the coefficients of the multipliers alone. Where it is
lost between the frequencies of a program, that frequency joins. The storage P then solves the
Riccati equation of the inequality with a part of its margin given away.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg

from symheli.lpv.bases import Polynomial
from symheli.values.arrays import Array
from synthesis.numerics.program.affine_program import AffineProgram, BernsteinCell, cells
from synthesis.numerics.program.cone_program import Solver, solve
from synthesis.robust.multipliers import inequality
from synthesis.robust.multipliers.loop import Plant, Wired, around_nominal, extended

BACKED = 1e-4, 1e-3, 1e-2, 0.1
"""Relative distances from the optimum at which the largest margin of the inequality is sought."""
FREQUENCIES, FINE = 40, 1500
"""Frequencies of the first program, and those at which its answer is looked at."""
DECADES = 2.0
"""Decades of frequency beyond the poles of the loop and its filters."""
AROUND = 0.1
"""Relative distance from the frequency of a member's peak that the first program looks at, too."""
ROUNDS = 15
"""Largest number of programs at one level."""
JOINING = 8
"""Largest number of frequencies that join a program."""
DEFINITE = 1e-13
"""Ratio of eigenvalues above which a matrix gives coordinates."""
GAIN, MARGIN, STABLE = "gain", "margin", "stable"
"""Aims of a program."""
KEPT = 0.25, 0.75, 0.05
"""Parts of the margin that the Riccati equation is given, one after the other."""
HALVED = 1.02
"""Ratio of a gain that is proven to one that is not beyond which one between is tried."""


class Storage(NamedTuple):
    """P, and the coefficients of the multipliers of each block."""

    P: Array
    coefficients: tuple[Array, ...]


class Responses(NamedTuple):
    """Matrices (K, m, m), Hermitian, at frequencies `omega` (K,): of each unknown (e, K, m, m), of
    |y|^2, of |x|^2 + |w|^2 in units, and of the squares of all signals; `turn`, coordinates of w in
    which they are of one size.
    """

    omega: Array
    terms: Array
    out: Array
    size: Array
    signals: Array
    turn: Array

    def joined(self, other: Responses) -> Responses:
        """Return both."""
        axes = dict.fromkeys(self._fields, 0) | {"terms": 1}
        return self._replace(
            **{
                name: np.concatenate([getattr(self, name), getattr(other, name)], axis=axis)
                for name, axis in axes.items()
            }
        )

    def at(self, k: Array) -> Responses:
        """Return these at some of the frequencies."""
        rest = {name: getattr(self, name)[k] for name in self._fields if name != "terms"}
        return Responses(terms=self.terms[:, k], **rest)

    def inner(self, d: Array) -> Responses:
        """Return them for inputs d alone, without outputs."""
        terms, out, size, signals = (M[..., d, :][..., d] for M in self[1:5])
        unit = np.broadcast_to(np.eye(len(d)) + 0j, out.shape)
        return Responses(self.omega, terms, 0 * out, size, signals, unit).near(-signals)

    def turned(self, F: Array) -> Array:
        """Return matrices (..., K, m, m) in these coordinates."""
        return np.asarray(self.turn.conj().swapaxes(1, 2) @ F @ self.turn)

    def near(self, H: Array) -> Responses:
        """Return them in coordinates in which the matrices H (K, m, m) are -1 times the identity,
        where these are negative definite.
        """
        own = -0.5 * self.turned(H + H.conj().swapaxes(1, 2))
        unit = np.sqrt(np.abs(np.einsum("kii->ki", own).real))
        unit[unit == 0] = 1.0
        values, vectors = np.linalg.eigh(own / unit[:, :, None] / unit[:, None, :])
        good = values[:, 0] > DEFINITE * values[:, -1]
        back = vectors[good] / np.sqrt(values[good])[:, None, :] / unit[good][:, :, None]
        turn = self.turn.copy()
        turn[good] = turn[good] @ back
        return self._replace(turn=turn)


class Search:
    """The search for multipliers of one loop, with gains in units of `scale`."""

    def __init__(
        self,
        plant: Plant,
        blocks: Sequence[Wired],
        solver: Solver,
        scale: float,
        sizes: Array,
        peak: float,
    ) -> None:
        """Prepare the loop and its responses; `sizes` of the model's inputs, where f is 1, and the
        frequency `peak` of the largest gain of a member.
        """
        self.plant, self.blocks, self.solver = plant, tuple(blocks), solver
        self.loop = around_nominal(extended(plant, blocks, float), plant, blocks)
        self.scale = scale
        self.outside = list(plant.into)
        m = self.loop.B.shape[1]
        self.inside = np.setdiff1d(np.arange(m), self.outside)
        self.reference: tuple[Array, float] | None = None
        self.enters = np.zeros((m, m))
        self.enters[self.outside, self.outside] = 1.0
        self.forms = [
            np.array([kind.form(e, float) for e in np.eye(kind.count)]) for kind, _, _ in blocks
        ]
        grid = self._frequencies(FINE)
        X = self._states(grid)
        self.into = np.array([_power(v) if v > 0 else 1.0 for v in sizes])
        X = X * self.into
        peaks = np.abs(X).max(axis=(0, 2), initial=0.0)
        self.units = np.array([_power(v) if v > 0 else 1.0 for v in peaks])
        self.fine = self.responses(grid, X)
        self.sizes = np.abs(self.fine.turned(self.fine.terms)).max(axis=(1, 2, 3))
        self.sizes[self.sizes == 0] = 1.0
        self._join_sizes()
        around = peak * np.exp(np.linspace(-AROUND, AROUND, 9)) if peak > 0 else np.ones(0)
        line = self._frequencies(FREQUENCIES)
        self.points = self.responses(np.unique(np.r_[line, around]))

    def _join_sizes(self) -> None:
        """Divide the entries of a matrix that is positive by those of its diagonal."""
        start = 0
        for kind, _, _ in self.blocks:
            own = self.sizes[start : start + kind.count]
            each = [kind.matrices(e) for e in np.eye(kind.count)]
            for q in range(len(each[0]) if each else 0):
                F = np.array([M[q] for M in each])
                diagonal = {
                    int(i): k for k, i in zip(*np.nonzero(np.einsum("kii->ki", F)), strict=True)
                }
                for k, i, j in zip(*np.nonzero(F), strict=True):
                    if i < j:
                        own[k] = math.sqrt(own[diagonal[int(i)]] * own[diagonal[int(j)]])
            start += kind.count

    def _frequencies(self, count: int) -> Array:
        poles = np.linalg.eigvals(self.loop.A) if len(self.loop.A) else np.ones(1)
        if self.plant.sampled:
            angles = np.abs(np.angle(poles))
            own = np.concatenate([np.geomspace(1e-4, np.pi, count), angles, [0.0, np.pi]])
            return np.unique(own[own <= np.pi])
        sizes = np.abs(poles)[np.abs(poles) > 0]
        sizes = sizes if len(sizes) else np.ones(1)
        grow = 10.0**DECADES
        line = np.geomspace(sizes.min() / grow, sizes.max() * grow, count)
        return np.unique(np.r_[0.0, line, sizes, np.abs(poles.imag), np.inf])

    def _states(self, omega: Array) -> Array:
        """Return (s - A)^-1 B (K, n, m)."""
        n, m = self.loop.B.shape
        X = np.zeros((len(omega), n, m), complex)
        ends = np.isfinite(omega)
        w = omega[ends]
        s = np.exp(1j * w) if self.plant.sampled else 1j * w
        X[ends] = np.linalg.solve(s[:, None, None] * np.eye(n) - self.loop.A, self.loop.B + 0j)
        return X

    def responses(self, omega: Array, X: Array | None = None) -> Responses:
        """Return the matrices of the inequality at frequencies, rad/s; sampled: rad."""
        n, m = self.loop.B.shape
        X = self._states(omega) * self.into if X is None else X

        def through(rows: Array) -> Array:
            return np.asarray(rows[:, :n] @ X + rows[:, n:] * self.into)

        parts = []
        for Z, forms in zip(self.loop.Z, self.forms, strict=True):
            z = through(Z)
            back = z.conj().swapaxes(1, 2)
            parts.append(np.array([back @ (M @ z) for M in forms]).reshape(-1, *z.shape[:1], m, m))
        y = through(self.loop.Y) / self.scale
        own, out = X / self.units[:, None], y.conj().swapaxes(1, 2) @ y
        size = own.conj().swapaxes(1, 2) @ own + np.eye(m)
        signals = sum(z.conj().swapaxes(1, 2) @ z for z in map(through, self.loop.Z))
        turn = np.broadcast_to(np.eye(m) + 0j, out.shape)
        signals = signals + out + self.enters
        return Responses(omega, np.concatenate(parts), out, size, signals, turn).near(-signals)

    def begin(self) -> bool:
        """Find multipliers that leave the loop stable, and coordinates from them; False where none
        are found.
        """
        best = None
        for _ in range(ROUNDS):
            found = self._solved(STABLE)
            if found is None:
                break
            c = found[1]
            lost = self._lost(c, 0.0, 0.0, inside=True)
            if not len(lost.omega):
                best = c
                break
            self.points = self.points.joined(lost)
            self._turn()
        if best is None:
            return False
        size, level = self._gain(best)
        if not math.isfinite(level):
            return False
        self.reference = size * best, 2 * level
        self._turn()
        return True

    @property
    def reference_level(self) -> float:
        """The gain of the multipliers of the coordinates."""
        return math.inf if self.reference is None else self.reference[1]

    def _turn(self) -> None:
        """Take coordinates in which the inequality of the reference is of one size."""
        if self.reference is not None:
            self.points = self.points.near(self._left(self.points, *self.reference))

    def _gain(self, c: Array) -> tuple[float, float]:
        """Return (factor, least gain) of multiples of these multipliers, on the fine grid."""
        H = np.tensordot(c, self.fine.terms, axes=1)
        d, f = self.inside, self.outside
        best = 1.0, math.inf
        for factor in np.geomspace(1e-9, 1e9, 73):
            F = factor * H + self.fine.out
            own = F[:, d][:, :, d]
            if len(d) and np.linalg.eigvalsh(own)[:, -1].max() >= 0:
                continue
            level = F[:, f][:, :, f]
            if len(d):
                cross = F[:, d][:, :, f]
                level = level - cross.conj().swapaxes(1, 2) @ np.linalg.solve(own, cross)
            g = float(np.linalg.eigvalsh(level)[:, -1].max())
            if g < best[1]:
                best = float(factor), g
        return best[0], math.sqrt(max(best[1], 0.0)) * self.scale

    def settled(self) -> float | None:
        """Return the least gain at frequencies that join until it no longer rises; None without
        an answer.
        """
        level = None
        for _ in range(ROUNDS):
            found = self._solved(GAIN)
            if found is None:
                break
            level = max(found[0], self.scale)
            lost = self._lost(found[1], level * (1 + BACKED[0]), 0.0)
            if not len(lost.omega):
                break
            self.points = self.points.joined(lost)
            self._turn()
        return level

    def centred(self, level: float) -> tuple[Array, float] | None:
        """Return coefficients of the largest margin at this gain, and the margin; None where none
        is found that holds at every frequency.
        """
        for _ in range(ROUNDS):
            found = self._solved(MARGIN, level)
            if found is None or found[2] <= 0:
                return None
            c = found[1]
            lost = self._lost(c, level, 0.0)
            if not len(lost.omega):
                return c, self._slack(c, level)
            self.points = self.points.joined(lost)
            self._turn()
        return None

    def _lost(self, c: Array, level: float, margin: float, inside: bool = False) -> Responses:
        """Return the responses at frequencies where the inequality is lost the most nearby."""
        between = np.ones(0) if inside else self._crossings(c, level, margin)
        at = self.fine.joined(self.responses(between)) if len(between) else self.fine
        order = np.argsort(at.omega)
        at = at.at(order)
        H = self._left(at, c, level) + margin * at.size
        if inside:
            H = (H - at.out)[:, self.inside][:, :, self.inside]
        unit = np.sqrt(np.abs(np.einsum("kii->ki", H))) + 1e-300
        worst = np.linalg.eigvalsh(H / unit[:, :, None] / unit[:, None, :])[:, -1]
        padded = np.r_[-np.inf, worst, -np.inf]
        peaks = (worst > 0) & (worst >= padded[:-2]) & (worst >= padded[2:])
        k = np.flatnonzero(peaks)
        return at.at(k[np.argsort(-worst[k])][:JOINING])

    def _crossings(self, c: Array, level: float, margin: float) -> Array:
        """Return frequencies at and between those where the inequality is lost, by the eigenvalues
        of its pencil; 2 n of them, as most are not on the axis.
        """
        n, m = self.loop.B.shape
        if not n:
            return np.ones(0)
        A, B, F = self._scaled(self._parts(c), level, margin)
        Q, S, R = F[:n, :n], F[:n, n:], F[n:, n:]
        none = np.zeros((n, n))
        if self.plant.sampled:
            left = np.block([[A, none, B], [Q, -np.eye(n), S], [S.T, 0 * B.T, R]])
            right = np.block(
                [[np.eye(n), none, 0 * B], [none, -A.T, 0 * B], [0 * B.T, -B.T, np.zeros((m, m))]]
            )
        else:
            left = np.block([[A, none, B], [-Q, -A.T, -S], [S.T, B.T, R]])
            right = linalg.block_diag(np.eye(2 * n), np.zeros((m, m)))
        values = linalg.eigvals(left, right)
        values = values[np.isfinite(values)]
        own = np.abs(np.angle(values) if self.plant.sampled else np.imag(values))
        own = np.unique(own[own > 0])
        return np.unique(np.r_[own, np.sqrt(own[1:] * own[:-1])])

    def _slack(self, c: Array, level: float) -> float:
        """Return how often |x|^2 + |w|^2 may be added on the fine grid."""
        at = self.fine.joined(self.points)
        return float(np.min(_ratio(-self._left(at, c, level), at.size)))

    def _left(self, at: Responses, c: Array, level: float) -> Array:
        g = (level / self.scale) ** 2
        return np.tensordot(c, at.terms, axes=1) + at.out - g * self.enters

    def _solved(self, aim: str, level: float = 0.0) -> tuple[float, Array, float] | None:
        """Return (gain, coefficients, margin): of the least gain, or of the largest margin."""
        count, inside = len(self.sizes), aim == STABLE
        at = self.points.inner(self.inside) if inside else self.points
        program = AffineProgram()
        program.variable(np.eye(count + 1)[:, None], Polynomial(0, 0.0, 1.0))
        (cell,) = cells([(0.0, 1.0)], [0])
        g = (level / self.scale) ** 2
        first = at.out if inside else g * self.enters - at.out
        last = np.broadcast_to(self.enters, at.out.shape) if aim == GAIN else 0 * at.out
        terms = -at.terms / self.sizes[:, None, None, None]
        rows = at.turned(np.concatenate([first[None], terms, last[None]]))
        rows[-1] -= 0 if aim == GAIN else np.eye(rows.shape[-1])
        unit = float(np.abs(rows[-1]).max(initial=0.0)) or 1.0
        rows[-1] /= unit
        for k in range(len(at.omega) if rows.size else 0):
            program.positive(cell, _real(rows[:, k])[:, None])
        cost = np.r_[np.zeros(count), 1.0 if aim == GAIN else -1.0]
        if aim != GAIN:
            self._within(program, cell, count if inside else 0)
        self._admit(program, cell)
        found = solve(replace(program.cone_program(cost), own_units=True), self.solver)
        if found.x is None:
            return None
        x = float(found.x[-1]) / unit
        gain = math.sqrt(max(x, 0.0)) * self.scale if aim == GAIN else level
        return gain, found.x[:-1] / self.sizes, 0.0 if aim == GAIN else x

    def _within(self, program: AffineProgram, cell: BernsteinCell, count: int) -> None:
        """Impose a margin of at most 1, and coefficients of at most 1 in size, so many of them."""
        total = len(self.sizes)
        for k, sign in [(total, 1.0), *((k, s) for k in range(count) for s in (-1.0, 1.0))]:
            rows = np.zeros((total + 2, 1, 1, 1))
            rows[0], rows[1 + k] = 1.0, -sign
            program.positive(cell, rows)

    def _admit(self, program: AffineProgram, cell: BernsteinCell) -> None:
        """Impose what makes the multipliers those of their classes."""
        total, start = len(self.sizes), 0
        for kind, _, _ in self.blocks:
            own = slice(1 + start, 1 + start + kind.count)
            unit = np.eye(kind.count) / self.sizes[start : start + kind.count, None]
            for amount in np.array([kind.amounts(e) for e in unit]).T:
                rows = np.zeros((total + 2, 1, 1, 1))
                rows[own, 0, 0, 0] = amount / (np.abs(amount).max() or 1.0)
                program.positive(cell, rows)
            each = [kind.matrices(e) for e in unit]
            for q in range(len(each[0]) if each else 0):
                F = np.array([M[q] for M in each])
                root = 1 / np.sqrt(np.abs(F).max(axis=0).diagonal())
                rows = np.zeros((total + 2, 1, *F.shape[1:]))
                rows[own, 0] = root[:, None] * F * root
                program.positive(cell, rows)
            start += kind.count

    def _parts(self, c: Array) -> tuple[Array, ...]:
        """Return the coefficients of each block, in the units of the model."""
        ends = np.cumsum([0, *(kind.count for kind, _, _ in self.blocks)])
        own = c * self.scale**2
        parts = [own[a:b] for a, b in pairwise(ends)]
        return tuple(b.kind.near(part) for b, part in zip(self.blocks, parts, strict=True))

    def _scaled(
        self, parts: Sequence[Array], level: float, margin: float
    ) -> tuple[Array, Array, Array]:
        """Return A, B and the form of the inequality but that of P, in units."""
        n, m = self.loop.B.shape
        turn = np.concatenate([self.units, self.into])
        forms = [k.form(x, float) for (k, _, _), x in zip(self.blocks, parts, strict=True)]
        out, enters = inequality.energy(self.loop, self.outside)
        F = inequality.supplied(self.loop, forms) + out - level**2 * enters
        F = turn[:, None] * F * turn / self.scale**2 + margin * np.eye(n + m)
        back = 1 / self.units[:, None]
        return back * self.loop.A * self.units, back * self.loop.B * self.into, F

    def storage(self, c: Array, margin: float, level: float) -> Storage | None:
        """Return the storage of these coefficients with a margin to spare; None where the Riccati
        equation has none.
        """
        parts = self._parts(c)
        A, B, F = self._scaled(parts, level, margin)
        try:
            P = _riccati(A, B, F, self.plant.sampled) if len(A) else np.zeros((0, 0))
        except (ValueError, np.linalg.LinAlgError):
            return None
        P = self.scale**2 * P / self.units[:, None] / self.units
        return Storage(0.5 * (P + P.T), parts) if np.all(np.isfinite(P)) else None


def _riccati(A: Array, B: Array, F: Array, sampled: bool) -> Array:
    """Return P with [A'P + PA, PB; B'P, 0] + F <= 0, of the rank of B."""
    n = len(A)
    solve: Any = linalg.solve_discrete_are if sampled else linalg.solve_continuous_are
    return np.asarray(solve(A, B, F[:n, :n], F[n:, n:], s=F[:n, n:]))


def _ratio(H: Array, size: Array) -> Array:
    """Return the least x' H x of x' size x = 1 (K,)."""
    back = np.linalg.inv(np.linalg.cholesky(size))
    return np.linalg.eigvalsh(back @ H @ back.conj().swapaxes(1, 2))[:, 0]


def _real(H: Array) -> Array:
    """Return Hermitian matrices as symmetric ones of twice the size."""
    real, imaginary = np.real(H), np.imag(H)
    upper = np.concatenate([real, -imaginary], axis=-1)
    return np.concatenate([upper, np.concatenate([imaginary, real], axis=-1)], axis=-2)


def _power(value: float) -> float:
    return 2.0 ** round(math.log2(value))


def found(search: Search, proven: Callable[[Storage, float], bool]) -> tuple[float, Storage] | None:
    """Return the least gain that `proven` confirms, and what proves it; None where none is."""
    if not search.begin():
        return None
    level, top = search.settled() or search.scale, search.reference_level
    steps = [level * (1 + distance) for distance in BACKED if level * (1 + distance) < top]
    best, below = None, level
    for own in (*steps, math.sqrt(max(steps, default=level) * top), top):
        best = _confirmed(search, own, proven)
        if best is not None:
            break
        below = own
    while best is not None and best[0] > HALVED * below:
        middle = _confirmed(search, math.sqrt(best[0] * below), proven)
        best, below = (best, math.sqrt(best[0] * below)) if middle is None else (middle, below)
    return best


def _confirmed(
    search: Search, level: float, proven: Callable[[Storage, float], bool]
) -> tuple[float, Storage] | None:
    centre = search.centred(level)
    if centre is None:
        return None
    for part in KEPT:
        at = search.storage(centre[0], part * centre[1], level)
        if at is not None and proven(at, level):
            return level, at
    return None
