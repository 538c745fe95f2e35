"""A primal-dual interior-point method for programs of Lyapunov inequalities of many states.

    minimise cost y_0  subject to  S = constant + along(y) + linear(P) in the cone, for every block

y_0 the level and, around a norm-bounded block, y_1, ... >= 0 the coefficients of its multiplier,
with the directions of Nesterov and Todd and the predictor and corrector of Mehrotra. With H the
inverse of the scaling matrix of a block, the entries of the normal equations between coefficients j
and k of P are those of the maps

    V -> 2 sum_rs (x_jr H f_s' V x_ks H f_r' + x_jr H x_ks' V f_s H f_r')

(f fixed, x varying): sums of Kronecker products, which for all blocks together are one product of
two matrices of n^2 rows. A general solver takes every block as a dense matrix on its N (N + 1)/2
entries and factors that with the rest; here the sixth power of n is in the factorisation of the
normal equations alone, once a coefficient of P.

Sources: Todd, Toh and Tutuncu, "On the Nesterov-Todd direction in semidefinite programming", SIAM
J. Optimization 8 (1998); Vandenberghe, Balakrishnan, Wallin, Hansson and Roh, "Interior-point
algorithms for semidefinite programming problems derived from the KYP lemma", in Positive
Polynomials in Control (2005).
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from symheli.progress import Task, task
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.symmetric import indices, length, smat, svec, symmetrized
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.block_cholesky import BlockCholesky
from synthesis.numerics.program.cone_program import Solver, SolverPoint
from synthesis.numerics.program.lyapunov_program import LyapunovBlocks, Program, Sizes

MIN_START = 10.0
"""Least multiple of the identity from which slacks and multipliers start."""
FEASIBLE = 1e-9
"""Residual of the blocks, relative to their constants, at which a point counts as feasible."""
MIN_LEVEL = 0.01
"""Least level relative to which the gap is measured."""
MIN_STEP = 1e-4
"""Step length below which the iteration ends."""
NORMAL_RESIDUAL = 1e-11
"""Relative residual of the normal equations at which conjugate gradients end."""
MAX_REFINEMENTS = 12
"""Largest number of conjugate gradient steps for a solution of the normal equations."""
DIAGONAL_SHIFT = 1e-13
"""Relative increase of the diagonal of the normal equations before factoring; conjugate gradients
correct for it.
"""
DUAL_RESIDUAL = 1e-6
"""Residual of the multipliers at a solution, relative to the largest of their entries."""
INFEASIBILITY_RESIDUAL = 1e-7
"""Relative residual of multipliers that prove infeasibility."""

EARLY_GAP = 0.1
"""Gap of the point from which the method may start on a similar program."""
GAP_FACTOR = 10.0
"""Factor on the requested gap up to which the result still counts as reached."""
MAX_DUAL_RESIDUAL = 1e-3
"""Residual of the multipliers, relative to the largest of their entries, above which the gap does
not bound the level and the result does not count as reached.
"""
PRODUCT_COST = 10
"""Number of products of matrices by coefficient that take the time of one product by place."""
CHUNK_ENTRIES = 200_000
"""Number of entries of n^4 by place that are summed at a time: they stay in the cache."""


class Early(NamedTuple):
    """A feasible P (K, n, n) and y near the centre of the cones, with the multipliers Z of every
    cone, the level <S, Z> / order of the central path there and the least eigenvalue of a slack of
    every cone: a starting point for a program with other bounds or more `places`.
    """

    P: Array
    y: Array
    Z: list[Array]
    level: float
    least: tuple[float, ...]
    places: int


@dataclass(frozen=True, eq=False)
class Minimum(SolverPoint):
    """Result: whether the requested gap is `reached`, at least nearly; with the point at which it
    first was below `EARLY_GAP`, None where it never was, and the level below which the multipliers
    show that there is none.
    """

    reached: bool = False
    early: Early | None = None
    lower: float = -math.inf


def minimise(
    program: Program, solver: Solver, start: Early | None = None, above: float = math.inf
) -> Minimum:
    """Minimise the level, to the tolerance of the solver or as near as rounding, iterations and
    time allow; no further once the multipliers show that it is not below `above`.

    The point has the coefficients of P as vectors, then the level; where it is not optimal, it is
    feasible to rounding or there is none. From `start`, of another program, and where that leads
    to no solution from afar. Never raises for a failed solve.
    """
    digits = -math.log10(solver.options["tolerance"])
    with task("digits of the least level", round(digits, 1)) as solving:
        if start is not None:
            found = _minimised(program, solver, solving, start, above)
            if found.reached or found.lower > above:
                return found
        return _minimised(program, solver, solving, None, above)


def _minimised(
    program: Program, solver: Solver, solving: Task, start: Early | None, above: float
) -> Minimum:
    tolerance, iterations = (solver.options[name] for name in ("tolerance", "iterations"))
    seconds = solver.options.get("seconds", math.inf)
    begin = time.perf_counter()
    cones = _Cones(program)
    point = cones.start() if start is None else cones.near(start)
    count, feasible, before, digits, early = 0, False, np.inf, 0.0, None
    while True:
        at = cones.residuals(point)
        digits = max(digits, _digits(at.gap, tolerance))
        solving.to(digits, f"{count} iterations")
        close = at.primal_size <= FEASIBLE
        if close and not feasible and cones.inside(point):
            feasible, point = True, point._replace(S=cones.slacks(point.P, point.y))
            at = cones.residuals(point)
        if feasible and early is None and at.gap <= EARLY_GAP:
            least = tuple(float(np.linalg.eigvalsh(S).min()) for S in point.S)
            level = at.product / cones.order
            early = Early(point.P, point.y, point.Z, level, least, program.places)
        if close and at.gap <= tolerance and at.dual_size <= DUAL_RESIDUAL:
            word = "solved"
        elif close and at.gap <= tolerance and at.dual_size >= before:
            word = "out of digits"  # the multipliers no longer improve
        elif at.contradiction < INFEASIBILITY_RESIDUAL:
            word = "infeasible"
        elif at.lower > above:
            word = f"not below {above:.6g}"
        elif count == iterations:
            word = "out of iterations"
        elif time.perf_counter() - begin > seconds:
            word = "out of time"
        else:
            try:
                following = _step(cones, point, at, feasible)
            except np.linalg.LinAlgError:
                following = None
            if following is not None:
                point, count, before = following, count + 1, at.dual_size
                continue
            word = "out of digits"
        answer = {"solved": Answer.SOLVED, "infeasible": Answer.INFEASIBLE}.get(word, Answer.FAILED)
        x = np.r_[svec(point.P).ravel(), point.y[1:], point.y[0]] if close else None
        gap = "" if word == "infeasible" else f", relative gap {at.gap:.1e}"
        message = f"{word} after {count} iterations{gap}"
        reached = close and at.gap <= GAP_FACTOR * tolerance and at.dual_size <= MAX_DUAL_RESIDUAL
        return Minimum(answer, x, time.perf_counter() - begin, message, reached, early, at.lower)


def _digits(gap: float, tolerance: float) -> float:
    """Return the number of accurate digits of the level, at most as many as requested."""
    return round(-math.log10(max(gap, tolerance)), 1) if gap < 1.0 else 0.0


class _Point(NamedTuple):
    """Coefficients of P (K, n, n), y, and slack and dual matrix of every cone."""

    P: Array
    y: Array
    S: list[Array]
    Z: list[Array]


class _Residuals(NamedTuple):
    """Residuals: of the slacks `primal`, of the multipliers `dual` and `dual_y`, with their sizes;
    <S, Z> `product`, relative to the level `gap`. `contradiction`: relative residual of the
    multipliers as a proof of infeasibility. `lower`: the level that the multipliers bound.
    """

    primal: list[Array]
    primal_size: float
    dual: Array
    dual_y: Array
    dual_size: float
    product: float
    gap: float
    contradiction: float
    lower: float


class _Cone(Protocol):
    """Blocks of one size that share coefficients of P: S = constant + along(y) + linear(P)."""

    constant: Array

    def along(self, y: Array) -> Array:
        """Return the matrices (m, N, N) of y."""
        ...

    def across(self, Z: Array) -> Array:
        """Return the adjoint of `along`, of the length of y."""
        ...

    def linear(self, P: Array) -> Array:
        """Return the matrices (m, N, N) of the coefficients of P."""
        ...

    def add_adjoint(self, Z: Array, out: Array) -> None:
        """Add to `out` (K, n, n) the contribution to <Z, linear(.)>."""
        ...

    def add_normal(self, H: Array, out: _NormalBlocks) -> None:
        """Add to the lower blocks of the normal equations those of P -> adjoint(H linear(P) H)."""
        ...


class _Inequalities:
    """The blocks F < 0."""

    def __init__(self, blocks: LyapunovBlocks, program: Program):
        self.blocks = blocks = blocks.by_coefficients() if _few(blocks) else blocks
        self.constant = -blocks.constant - program.back_off
        self.level = program.level if blocks.level is None else blocks.level
        self.length = 1 + program.sizes.multipliers
        x = blocks.varying
        self.used = [np.flatnonzero(np.any(x[:, :, a], axis=(0, 2, 3))) for a in range(x.shape[2])]

    def along(self, y: Array) -> Array:
        out = np.broadcast_to(y[0] * self.level, self.constant.shape)
        supply = self.blocks.supply
        return out if supply is None else out - supply.matrices(y[1:])

    def across(self, Z: Array) -> Array:
        out = np.zeros(self.length)
        out[0] = np.sum(self.level * Z)
        if self.blocks.supply is not None:
            self.blocks.supply.add_adjoint(-Z, out[1:])
        return out

    def linear(self, P: Array) -> Array:
        return -self.blocks.linear(P)

    def add_adjoint(self, Z: Array, out: Array) -> None:
        np.add.at(out, self.blocks.columns, -self.blocks.adjoint(Z))

    def add_normal(self, H: Array, out: _NormalBlocks) -> None:
        columns, weights = self.blocks.columns, self.blocks.weights
        n = self.blocks.fixed.shape[1]
        if weights is None:
            for a, b, left, right in self._of_places(H, slice(None)):
                out.add_products((columns[a], columns[b]), left[0], right[0])
            return
        G, k, A = weights.shape
        v = length(n)
        # the functions of each matrix
        own = [np.flatnonzero(np.any(weights[:, :, a], axis=0)) for a in range(A)]
        total = np.zeros((k, k, v * v))
        together = max(1, CHUNK_ENTRIES // n**4)
        for first in range(0, G, together):
            places = slice(first, first + together)
            g = [weights[places, j, a] for a, j in enumerate(own)]
            for a, b, left, right in self._of_places(H, places):
                each = _on_vectors(left, right)
                if a == b:
                    each = each + np.swapaxes(each, 1, 2)
                total[own[a][:, None], own[b]] += _contracted(g[a], g[b], each)
                if a != b:
                    turned = np.swapaxes(each, 1, 2)
                    total[own[b][:, None], own[a]] += _contracted(g[b], g[a], turned)
        blocks = total.reshape(k, k, v, v)
        for j in range(k):
            for i in range(j + 1):
                out.add((columns[j], columns[i]), blocks[j, i])

    def _of_places(self, H: Array, places: slice) -> Iterator[tuple[int, int, Array, Array]]:
        """Yield (a, b, left, right), a >= b: the block of the normal equations between the matrices
        Q_a and Q_b of each of these places is V -> sum left V right, (places, terms, n, n) both;
        if a = b, that and its adjoint.
        """
        f, n = self.blocks.fixed, self.blocks.fixed.shape[1]
        G, N = self.blocks.places, H.shape[1]
        # motions, places, ...
        H = H.reshape(-1, G, N, N)[:, places]
        x = self.blocks.varying
        x = x.reshape(-1, G, *x.shape[1:])[:, places]
        fH, xH = f @ H[:, :, None], x @ H[:, :, None, None]
        f, x = np.swapaxes(f, -1, -2), np.swapaxes(x, -1, -2)
        # f_r H f_s' and, for every a, x_ra H f_s'; of the r and s that are not zero
        ff = fH[:, :, :, None] @ f
        xf = [xH[:, :, r, a][:, :, :, None] @ f for a, r in enumerate(self.used)]

        def stacked(*each: Array) -> Array:
            """(places, terms, n, n)."""
            flat = np.concatenate([M.reshape(*M.shape[:2], -1, n, n) for M in each], axis=2)
            return np.moveaxis(flat, 0, 1).reshape(flat.shape[1], -1, n, n)

        for a, r in enumerate(self.used):
            for b, s in enumerate(self.used[: a + 1]):
                left = [xf[a][:, :, :, s]]
                right = [np.swapaxes(xf[b][:, :, :, r], 2, 3)]
                if not self.blocks.symmetric:  # else the other half is the same
                    left.append(xH[:, :, r, a][:, :, :, None] @ x[:, :, s, b][:, :, None])
                    right.append(np.swapaxes(ff[:, :, s][:, :, :, r], 2, 3))
                factor = 4.0 if self.blocks.symmetric else 2.0
                share: Array | float = factor
                if a == b:  # the map of s and r is the adjoint of that of r and s
                    i, j = np.triu_indices(len(r))
                    left, right = ([each[:, :, i, j] for each in M] for M in (left, right))
                    share = np.where(i == j, 0.5 * factor, factor)[:, None, None]
                yield a, b, stacked(*(share * each for each in left)), stacked(*right)


class _Bounds:
    """sign P + constant I >= 0 of every coefficient."""

    def __init__(self, sign: float, constant: float, sizes: Sizes):
        self.sign, self.length = sign, 1 + sizes.multipliers
        self.constant = np.tile(constant * np.eye(sizes.states), (sizes.unknowns, 1, 1))

    def along(self, y: Array) -> Array:
        return np.zeros_like(self.constant)

    def across(self, Z: Array) -> Array:
        return np.zeros(self.length)

    def linear(self, P: Array) -> Array:
        return self.sign * P

    def add_adjoint(self, Z: Array, out: Array) -> None:
        out += self.sign * Z

    def add_normal(self, H: Array, out: _NormalBlocks) -> None:
        for j, h in enumerate(H):
            out.add_products((j, j), 0.5 * h[None], h[None])


class _Multiplier:
    """Coefficients of the multiplier >= 0."""

    def __init__(self, count: int):
        self.constant = np.zeros((count, 1, 1))

    def along(self, y: Array) -> Array:
        return y[1:, None, None]

    def across(self, Z: Array) -> Array:
        return np.r_[0.0, Z[:, 0, 0]]

    def linear(self, P: Array) -> Array:
        return np.zeros_like(self.constant)

    def add_adjoint(self, Z: Array, out: Array) -> None:
        pass

    def add_normal(self, H: Array, out: _NormalBlocks) -> None:
        pass


def _few(blocks: LyapunovBlocks) -> bool:
    """Whether so few coefficients are involved that their normal equations are summed over all
    blocks faster than those of every place are formed.
    """
    if blocks.weights is None:
        return False
    places, k, A = blocks.weights.shape
    motions = len(blocks.constant) // places
    return k * (k + 1) * motions <= PRODUCT_COST * A * (A + 1)


def _contracted(g: Array, h: Array, blocks: Array) -> Array:
    """Return sum_m g_mj h_mk blocks_m (j, k, v^2), the blocks (m, v, v)."""
    pairs = (g[:, :, None] * h[:, None, :]).reshape(len(g), -1)
    return (pairs.T @ blocks.reshape(len(g), -1)).reshape(g.shape[1], h.shape[1], -1)


class _NormalBlocks:
    """Lower blocks {(i, j): block}, i >= j, of the normal equations between coefficients of P."""

    def __init__(self) -> None:
        self.blocks: dict[tuple[int, int], Array] = {}
        self.products: dict[tuple[int, int], Array] = {}

    def add(self, at: tuple[int, int], block: Array) -> None:
        """Add a block (v, v) on vectors."""
        i, j = (int(k) for k in at)
        if i < j:
            i, j, block = j, i, block.T
        if (i, j) in self.blocks:
            self.blocks[i, j] += block
        else:
            self.blocks[i, j] = block

    def add_products(self, at: tuple[int, int], left: Array, right: Array) -> None:
        """Add the map V -> sum left V right, (terms, n, n) both, of a block on the diagonal with
        its adjoint.
        """
        i, j = (int(k) for k in at)
        if i < j:
            i, j, left, right = j, i, np.swapaxes(left, 1, 2), np.swapaxes(right, 1, 2)
        terms, n = left.shape[:2]
        product = left.reshape(terms, n * n).T @ right.reshape(terms, n * n)
        if (i, j) in self.products:
            self.products[i, j] += product
        else:
            self.products[i, j] = product

    def finished(self) -> dict[tuple[int, int], Array]:
        """Return the blocks; the products of a block are summed before they are rearranged."""
        for (i, j), product in self.products.items():
            block = _of_symmetric(_by_entry(product))
            self.add((i, j), block + block.T if i == j else block)
        return self.blocks


def _on_vectors(left: Array, right: Array) -> Array:
    """Return the maps V -> the symmetric part of sum L V R as matrices on vectors, (..., v, v); the
    L and R of a map are `left` and `right` (..., terms, n, n).
    """
    terms, n = left.shape[-3:-1]
    rows, columns, _ = indices(n)
    if 2 * terms <= n:
        L = np.concatenate([left[..., rows, :], left[..., columns, :]], axis=-3)
        R = np.concatenate([right[..., columns], right[..., rows]], axis=-3)
        L, R = np.moveaxis(L, -3, -1), np.moveaxis(R, -1, -3)
        by_entry = np.ascontiguousarray(L) @ np.ascontiguousarray(R)
    else:  # one product for all entries
        shape = (*left.shape[:-3], terms, n * n)
        by_entry = _by_entry(np.swapaxes(left.reshape(shape), -1, -2) @ right.reshape(shape))
    return _of_symmetric(by_entry)


def _by_entry(product: Array) -> Array:
    """Return for every entry of the symmetric part of sum L V R the matrix (..., v, n, n) that is
    multiplied with V entry by entry, of the products of entries of L and R, (..., n^2, n^2).
    """
    n = math.isqrt(product.shape[-1])
    rows, columns, _ = indices(n)
    product = np.moveaxis(product.reshape(*product.shape[:-2], n, n, n, n), -1, -3)
    return product[..., rows, columns, :, :] + product[..., columns, rows, :, :]


def _of_symmetric(by_entry: Array) -> Array:
    """Return the map (..., v, v) on vectors of a symmetric V, of these matrices."""
    n = by_entry.shape[-1]
    rows, columns, weight = indices(n)
    flat = by_entry.reshape(*by_entry.shape[:-2], n * n)
    out = flat.take(rows * n + columns, axis=-1)
    out += flat.take(columns * n + rows, axis=-1)
    scale = weight / 2.0
    out *= scale[:, None]
    out *= scale
    return out


class _Cones:
    """All cones of the program."""

    def __init__(self, program: Program):
        self.program = program
        self.each: list[_Cone] = [_Inequalities(b, program) for b in program.blocks]
        self.sizes = program.sizes
        self.each += [_Bounds(*b, self.sizes) for b in program.bounds]
        if self.sizes.multipliers:
            self.each.append(_Multiplier(self.sizes.multipliers))
        self.size = 1.0 + max(float(np.abs(c.constant).max(initial=0.0)) for c in self.each)
        self.order = sum(c.constant.shape[0] * c.constant.shape[1] for c in self.each)

    def start(self) -> _Point:
        """Return a starting point far inside the cones, wherever that is."""
        n = self.sizes.states
        far = max(MIN_START, self.size)
        S = [
            far * np.broadcast_to(np.eye(c.constant.shape[1]), c.constant.shape) for c in self.each
        ]
        y = np.zeros(1 + self.sizes.multipliers)
        return _Point(np.zeros((self.sizes.unknowns, n, n)), y, S, S)

    def near(self, start: Early) -> _Point:
        """Return a starting point as close to the central path as the one of another program
        allows.
        """
        S, Z = [], []
        for slack, least, old in zip(
            self.slacks(start.P, start.y), start.least, start.Z, strict=True
        ):
            raised = _raised(slack, least)
            multiplier = start.level * np.linalg.inv(raised)
            if len(old) * self.program.places == len(slack) * start.places:
                # each kind of block at its former places, then at the new ones
                kind = (-1, self.program.places, *slack.shape[1:])
                known = old.reshape(-1, start.places, *slack.shape[1:])
                multiplier.reshape(kind)[:, : start.places] = known
            S.append(raised)
            Z.append(multiplier)
        return _Point(start.P, start.y, S, Z)

    def change(self, P: Array, y: Array) -> list[Array]:
        """Return the change of the slacks with P and y."""
        return [cone.along(y) + cone.linear(P) for cone in self.each]

    def slacks(self, P: Array, y: Array) -> list[Array]:
        """Return the slacks that belong to this P and y."""
        return [
            cone.constant + change
            for cone, change in zip(self.each, self.change(P, y), strict=True)
        ]

    def inside(self, point: _Point) -> bool:
        """Whether the slacks that belong to P and y are in the cones."""
        try:
            for S in self.slacks(point.P, point.y):
                np.linalg.cholesky(S)
        except np.linalg.LinAlgError:
            return False
        return True

    def adjoint(self, Z: list[Array]) -> tuple[Array, Array]:
        """Return (P', y') with <Z, change(P, y)> = <P', P> + <y', y>."""
        out = np.zeros((self.sizes.unknowns, self.sizes.states, self.sizes.states))
        across = np.zeros(1 + self.sizes.multipliers)
        for cone, each in zip(self.each, Z, strict=True):
            cone.add_adjoint(each, out)
            across += cone.across(each)
        return out, across

    def residuals(self, point: _Point) -> _Residuals:
        """Return the residuals of slacks and multipliers at this point."""
        primal = [
            wanted - S for wanted, S in zip(self.slacks(point.P, point.y), point.S, strict=True)
        ]
        dual, level = self.adjoint(point.Z)
        constant = sum(
            float(np.sum(c.constant * z)) for c, z in zip(self.each, point.Z, strict=True)
        )
        dual_y, most = level.copy(), max(float(np.abs(z).max()) for z in point.Z)
        dual_y[0] -= self.program.cost
        product = sum(float(np.sum(s * z)) for s, z in zip(point.S, point.Z, strict=True))
        dual_size = _largest(dual, dual_y) / max(1.0, most)
        unknown = abs(float(np.sum(dual * point.P))) + abs(float(dual_y @ point.y))
        lower = -(constant + unknown) / self.program.cost
        return _Residuals(
            primal,
            max(float(np.abs(r).max()) for r in primal) / self.size,
            dual,
            dual_y,
            dual_size,
            product,
            product / max(abs(float(point.y[0])), MIN_LEVEL),
            _largest(dual, level) / -constant if constant < 0 else np.inf,
            lower if self.program.cost > 0 and dual_size <= DUAL_RESIDUAL else -np.inf,
        )


def _raised(S: Array, least: float) -> Array:
    """Return matrices (m, N, N) plus the least multiple of the identity with no eigenvalue below
    the limit.
    """
    missing = np.maximum(least - np.linalg.eigvalsh(S)[:, 0], 0.0)
    return S + missing[:, None, None] * np.eye(S.shape[-1])


def _largest(P: Array, y: Array) -> float:
    return max(float(np.abs(P).max()), float(np.abs(y).max()))


class _Scaling(NamedTuple):
    """Nesterov-Todd scaling of one cone: r^-1 S r^-T = r' Z r = diag(values), H = (r r')^-1;
    `inverse` is r^-1.
    """

    r: Array
    inverse: Array
    values: Array
    H: Array

    @classmethod
    def of(cls, S: Array, Z: Array) -> _Scaling:
        left, right = np.linalg.cholesky(S), np.linalg.cholesky(Z)
        U, values, Vt = np.linalg.svd(np.swapaxes(right, 1, 2) @ left)
        root = np.sqrt(values)[:, None, :]
        r = left @ (np.swapaxes(Vt, 1, 2) / root)
        inverse = np.swapaxes(right @ (U / root), 1, 2)
        return cls(r, inverse, values, np.swapaxes(inverse, 1, 2) @ inverse)

    @property
    def diagonal(self) -> Array:
        """Slack and multiplier in the scaled coordinates."""
        return self.values[:, :, None] * np.eye(self.values.shape[1])

    def of_slack(self, change: Array) -> Array:
        """Return a change of the slack in the coordinates in which both are diagonal."""
        return symmetrized(self.inverse @ change @ np.swapaxes(self.inverse, 1, 2))

    def slack(self, scaled: Array) -> Array:
        """Return the change of the slack that is `scaled` in them."""
        return symmetrized(self.r @ scaled @ np.swapaxes(self.r, 1, 2))

    def multiplier(self, scaled: Array) -> Array:
        """Return the change of the multiplier that is `scaled` in them."""
        return symmetrized(np.swapaxes(self.inverse, 1, 2) @ scaled @ self.inverse)

    def divided(self, M: Array) -> Array:
        """Return T with (T diag + diag T)/2 = M."""
        return 2.0 * M / (self.values[:, :, None] + self.values[:, None, :])

    def extent(self, scaled: Array) -> tuple[float, float]:
        """Return the least and the largest eigenvalue of `scaled` relative to the slack."""
        root = np.sqrt(self.values)
        found = np.linalg.eigvalsh(scaled / (root[:, :, None] * root[:, None, :]))
        return float(found.min()), float(found.max())


class _NormalEquations:
    """The equations M (P, y) = adjoint(H change(P, y) H), factored."""

    def __init__(self, cones: _Cones, scalings: list[_Scaling]):
        self.cones, self.scalings = cones, scalings
        normal = _NormalBlocks()
        for cone, scaling in zip(cones.each, scalings, strict=True):
            cone.add_normal(scaling.H, normal)
        blocks = normal.finished()
        for (i, j), block in blocks.items():
            if i == j:
                block[np.diag_indices(len(block))] *= 1.0 + DIAGONAL_SHIFT
        self.factor = BlockCholesky(blocks)
        start = cones.start()
        columns = [self.times(np.zeros_like(start.P), unit) for unit in np.eye(len(start.y))]
        # the rows of y beside those of P
        self.border = np.stack([svec(border) for border, _ in columns])
        self.across = np.stack([self.factor.solve(border) for border in self.border])
        corner = np.stack([corner for _, corner in columns])
        self.pivot = corner - np.einsum("ikl,jkl->ij", self.border, self.across)

    def times(self, P: Array, y: Array) -> tuple[Array, Array]:
        """Return M (P, y), block by block."""
        moved = self.cones.change(P, y)
        return self.cones.adjoint(
            [at.H @ M @ at.H for at, M in zip(self.scalings, moved, strict=True)]
        )

    def _by_factors(self, b: Array, d: Array) -> tuple[Array, Array]:
        x = self.factor.solve(svec(b))
        y = np.linalg.solve(self.pivot, d - np.einsum("ikl,kl->i", self.border, x))
        return smat(x - np.tensordot(y, self.across, axes=1), b.shape[-1]), y

    def solve(self, b: Array, d: Array) -> tuple[Array, Array]:
        """Return (P, y) for the right-hand side (b, d), by conjugate gradients preconditioned with
        the factors, which near the end are accurate to a few digits only.
        """
        P, y, rest, left = np.zeros_like(b), np.zeros_like(d), b, d
        along, pace, size = None, 0.0, _inner(b, d, b, d)
        best, least = (P, y), np.inf
        for _ in range(MAX_REFINEMENTS):
            zP, zy = self._by_factors(rest, left)
            before, pace = pace, _inner(rest, left, zP, zy)
            if along is not None:
                zP, zy = zP + pace / before * along[0], zy + pace / before * along[1]
            along = zP, zy
            MP, My = self.times(*along)
            share = pace / _inner(*along, MP, My)
            P, y = P + share * along[0], y + share * along[1]
            rest, left = rest - share * MP, left - share * My
            misfit = np.sqrt(_inner(rest, left, rest, left) / size)
            if not np.isfinite(misfit):
                raise np.linalg.LinAlgError
            if misfit < least:
                best, least = (P, y), misfit
            if misfit <= NORMAL_RESIDUAL:
                break
        return best


def _inner(P: Array, y: Array, Q: Array, z: Array) -> float:
    return float(np.sum(P * Q) + y @ z)


def _longest(least: float, share: float = 1.0) -> float:
    """Return the part of a step in a direction with this least eigenvalue that stays in the
    cone.
    """
    return min(1.0, share / -least) if least < 0 else 1.0


def _step(cones: _Cones, point: _Point, at: _Residuals, feasible: bool) -> _Point | None:
    """Return the next point, None where no step is possible."""
    scalings = [_Scaling.of(s, z) for s, z in zip(point.S, point.Z, strict=True)]
    normal = _NormalEquations(cones, scalings)
    diagonals = [scaling.diagonal for scaling in scalings]

    def direction(targets: list[Array]) -> tuple[Array, Array, list[Array], list[Array]]:
        """dP, dy and the scaled changes of slacks and multipliers, which add up to the targets."""
        known = [
            s.multiplier(T) - s.H @ r @ s.H
            for s, T, r in zip(scalings, targets, at.primal, strict=True)
        ]
        b, d = cones.adjoint(known)
        dP, dy = normal.solve(b + at.dual, d + at.dual_y)
        moved = cones.change(dP, dy)
        dS = [s.of_slack(M + r) for s, M, r in zip(scalings, moved, at.primal, strict=True)]
        return dP, dy, dS, [T - s for T, s in zip(targets, dS, strict=True)]

    def extent(scaled: list[Array]) -> tuple[float, float]:
        each = [s.extent(d) for s, d in zip(scalings, scaled, strict=True)]
        return min(low for low, _ in each), max(high for _, high in each)

    _, _, aS, aZ = direction([-D for D in diagonals])
    low, high = extent(aS)
    along, across = _longest(low), _longest(-1.0 - high)  # both add up to minus what there is
    left = sum(
        float(np.sum((D + along * s) * (D + across * z)))
        for D, s, z in zip(diagonals, aS, aZ, strict=True)
    )
    # Mehrotra's centring: little where the predictor alone goes far
    centring = min(1.0, max(left / at.product, 0.0)) ** 2 if min(along, across) > 0.1 else 0.5
    level = centring * at.product / cones.order
    targets = [
        scaling.divided(level * np.eye(D.shape[1]) - D @ D - symmetrized(s @ z))
        for scaling, D, s, z in zip(scalings, diagonals, aS, aZ, strict=True)
    ]
    share = 0.9 + 0.08 * min(along, across)
    dP, dy, dS, dZ = direction(targets)
    along, across = (_longest(extent(scaled)[0], share) for scaled in (dS, dZ))
    if max(along, across) < MIN_STEP:
        return None
    P, y = symmetrized(point.P + along * dP), point.y + along * dy
    if feasible:
        S = [symmetrized(s) for s in cones.slacks(P, y)]
    else:
        S = [s + along * c.slack(d) for s, c, d in zip(point.S, scalings, dS, strict=True)]
    Z = [z + across * c.multiplier(d) for z, c, d in zip(point.Z, scalings, dZ, strict=True)]
    return _Point(P, y, S, Z)
