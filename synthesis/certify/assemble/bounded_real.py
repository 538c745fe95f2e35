"""The bounded real lemma for LPV models as a cone program, one block per Bernstein coefficient.

Continuous time, V = x' P(p) x, for |dp/dt| <= rate:

    [A'P + PA + nu dP/dp + C'C   PB + C'D ]
    [B'P + D'C                   D'D - g I]  < 0,   nu = -rate, +rate,   g = gamma^2,

discrete time, P+ = P(p(k+1)), |p(k+1) - p(k)| <= rate dt:

    [A'P+A - P + C'C   A'P+B + C'D      ]
    [B'P+A + D'C       B'P+B + D'D - g I]  < 0.

With a norm-bounded block d = Delta v, v = G x + J d + H u, |Delta| <= beta, the inputs are (d, u),
C and D are those of y alone, g belongs to u alone, and lambda(p) (beta^2 [G J H]'[G J H] - diag(0,
I, 0)) is added with lambda >= 0, a spline on the knots of P; of a block of several parts one for
each.

Source: Wu, Yang, Packard and Becker, "Induced L2-norm control for LPV systems with bounded
parameter variation rates", Int. J. Robust and Nonlinear Control 6 (1996), theorem 3.1.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from symheli.values.arrays import Array
from synthesis.certify.statement.norm_bounded import NormBounded
from synthesis.numerics.polynomial.bernstein import (
    composition,
    elevation_matrix,
    product_weights,
    restriction,
)
from synthesis.numerics.polynomial.cells import Cell, Strip
from synthesis.numerics.polynomial.symmetric import basis, smat, svec
from synthesis.numerics.program.cone_program import ConeProgram
from synthesis.numerics.program.lyapunov_program import Sizes


class Blocks(NamedTuple):
    """LMI blocks F = sum_j linear[., j] P_columns[j] + constant - weight g diag(0, I), svec'd along
    the last axis.

    `columns` (k,) are the coefficients of P that are involved; `linear` (m, k, n (n + 1)/2, L),
    `constant` (m, L), of matrices (N, N) with L = N (N + 1)/2; `weight` (m,) > 0. `likely`:
    expected to be among the binding ones. `supply`: what a block adds, None without one.
    """

    columns: Array
    linear: Array
    constant: Array
    weight: Array
    likely: bool = True
    supply: Supply | None = None

    def values(self, P: Array, N: int, multipliers: Array | None = None) -> Array:
        """F (m, N, N) with g = 0 at the coefficients P (k, n (n + 1)/2) and, around a block,
        multipliers (k',) of the whole splines.
        """
        F = np.einsum("mjvl,jv->ml", self.linear, P[self.columns]) + self.constant
        if self.supply is not None and multipliers is not None:
            F = F + np.einsum("mjl,j->ml", self.supply.linear, multipliers[self.supply.columns])
        return smat(F, N)

    def congruent(self, W: Array) -> Blocks:
        """W' F W for every F, W (N, N) not acting on the part with g."""
        N = len(W)
        K = svec(W.T @ basis(N) @ W)
        supply = self.supply and self.supply._replace(linear=self.supply.linear @ K)
        return self._replace(linear=self.linear @ K, constant=self.constant @ K, supply=supply)

    def keep(self, which: Array) -> Blocks:
        """Return only these of the m blocks."""
        supply = self.supply and self.supply._replace(linear=self.supply.linear[which])
        return self._replace(
            linear=self.linear[which],
            constant=self.constant[which],
            weight=self.weight[which],
            supply=supply,
        )


class Supply(NamedTuple):
    """Supply rate of a norm-bounded block, sum_j linear[., j] multipliers[columns[j]], added to F:
    `linear` (m, k, L).
    """

    columns: Array
    linear: Array


class BlockMultipliers(NamedTuple):
    """The multiplier lambda of each part of a `block`: a spline of `degree` on the knots of P, one
    number where the part is dynamic.
    """

    block: NormBounded
    degree: int

    def sizes(self, segments: int) -> list[int]:
        """Numbers of coefficients, part by part."""
        each = segments * self.degree + 1
        return [1 if dynamic else each for *_, dynamic in self.block.every_part]


def continuous_blocks(
    cells: Sequence[Cell],
    knots: Array,
    degree: int,
    rate: float,
    extra: int,
    multiplier: BlockMultipliers | None = None,
) -> Iterator[Blocks]:
    """The blocks of every cell for both signs of the rate; `extra` raises the degree of the
    Bernstein form.
    """
    for cell in cells:
        form = over_cell(cell, knots, degree, extra, multiplier)
        E = basis(form.A.shape[1])
        lyapunov = E @ form.A[:, None]
        coupling = E @ form.B[:, None]
        operator = svec(bordered(lyapunov + np.swapaxes(lyapunov, -1, -2), coupling))
        direct = svec(bordered(E, np.zeros((*E.shape[:2], form.B.shape[2]))))
        linear = np.einsum("mij,ivl->mjvl", form.flow, operator)
        constant = form.up @ svec(form.output)
        for nu in (-rate, rate) if rate > 0 else (0.0,):
            drift = nu * form.slope[:, :, None, None] * direct
            weight = np.ones(len(constant))
            yield Blocks(form.columns, linear + drift, constant, weight, supply=form.supply)


def discrete_blocks(
    strips: Sequence[Strip],
    knots: Array,
    degree: int,
    extra: int,
    multiplier: BlockMultipliers | None = None,
) -> Iterator[Blocks]:
    """Yield the blocks of every strip."""
    for form in over_strips(strips, knots, degree, extra, multiplier):
        M = np.concatenate([form.A, form.B], axis=2)
        E = basis(form.A.shape[1])
        inner = E @ M[:, None]
        dM = len(M) - 1
        pairs = np.einsum("rik,iab,kvac->rvbc", product_weights(dM, dM), M, inner, optimize=True)
        operator = svec(0.5 * (pairs + np.swapaxes(pairs, -1, -2)))
        direct = svec(bordered(E, np.zeros((*E.shape[:2], form.B.shape[2]))))
        constant = form.up @ svec(form.output)
        now = form.here[:, :, None, None] * direct
        for k, likely in enumerate(form.likely):
            after_k = np.einsum(
                "qm,mri,ij,rvl->qjvl",
                form.raised,
                product_weights(2 * dM, degree),
                form.after[:, k],
                operator,
                optimize=True,
            )
            linear = np.zeros((len(after_k), len(form.columns), *after_k.shape[2:]))
            linear[:, form.next : form.next + degree + 1] += after_k
            linear[:, form.own : form.own + degree + 1] -= now
            weight = np.ones(len(constant))
            yield Blocks(form.columns, linear, constant, weight, likely, form.supply)


def assemble(
    blocks: Sequence[Blocks],
    sizes: Sizes,
    margin: float,
    floor: float,
    null: Array | None = None,
) -> ConeProgram:
    """minimise g subject to every block <= -margin diag(I, 0) and every coefficient of P >= floor
    I, every one of a multiplier >= 0.

    Without inputs: maximise t subject to blocks <= -t I and 0 <= P <= I; t > 0 proves stability.
    Both I are times the weight of the block. `null` (s, L): symmetric matrices that may be added to
    each block, with weights of its own. The unknowns: P, coefficient by coefficient; the weights of
    `null`, block by block; the multiplier; g or t.
    """
    states, inputs, unknowns, _, multipliers = sizes
    N, nv = sizes.rows, states * (states + 1) // 2
    of_P, of_block = unknowns * nv, 0 if null is None else len(null)
    eye, zero = np.eye(sizes.strict), np.zeros((sizes.strict, inputs))
    gain = -svec(np.block([[0 * eye, zero], [zero.T, np.eye(inputs)]])) if inputs else svec(eye)
    back_off = (
        margin * svec(np.block([[eye, zero], [zero.T, np.zeros((inputs, inputs))]]))
        if inputs
        else 0 * gain
    )
    L = len(gain)
    weights = np.concatenate([block.weight for block in blocks])
    columns = of_P + of_block * len(weights) + multipliers + 1
    of_lambda = columns - 1 - multipliers
    data, index, pointer, top = [], [], [], 0

    def place(rows: Array, unknown: Array) -> None:
        where = np.nonzero(rows)
        data.append(rows[where])
        index.append(where[0] + top)
        pointer.append(unknown[where[1]])

    for block in blocks:
        m, count = block.linear.shape[:2]
        rows = np.moveaxis(block.linear, 3, 1).reshape(m * L, count * nv)
        place(rows, (block.columns[:, None] * nv + np.arange(nv)).ravel())
        if block.supply is not None:
            rows = np.moveaxis(block.supply.linear, 2, 1).reshape(m * L, -1)
            place(rows, of_lambda + block.supply.columns)
        top += m * L
    lmi = sparse.coo_matrix(
        (np.concatenate(data), (np.concatenate(index), np.concatenate(pointer))),
        shape=(top, columns - 1),
    )
    if null is not None:
        own = sparse.kron(sparse.identity(len(weights)), sparse.csc_matrix(null.T))
        beside = [sparse.csc_matrix((top, n)) for n in (of_P, multipliers)]
        lmi = lmi + sparse.hstack([beside[0], own, beside[1]])
    parts: list[Any] = [lmi]
    A = [sparse.hstack([*parts, sparse.csc_matrix(np.outer(weights, gain).reshape(-1, 1))])]
    b = [
        -np.concatenate([block.constant for block in blocks]).ravel()
        - np.outer(weights, back_off).ravel()
    ]
    positive = sparse.hstack([-sparse.identity(of_P), sparse.csc_matrix((of_P, columns - of_P))])
    identities = np.tile(svec(np.eye(states)), unknowns)
    for sign, bound in ((1, -floor),) if inputs else ((1, 0), (-1, 1)):
        A.append(sign * positive)
        b.append(bound * identities)
    cones = [N] * len(weights) + [states] * (unknowns * (len(A) - 1)) + [1] * multipliers
    if multipliers:
        A.append(-sparse.eye(multipliers, columns, of_lambda))
        b.append(np.zeros(multipliers))
    c = np.append(np.zeros(columns - 1), 1.0 if inputs else -1.0)
    return ConeProgram(c, sparse.csc_matrix(sparse.vstack(A)), np.concatenate(b), tuple(cones))


class OverCell(NamedTuple):
    """Weights from which the blocks of one cell are assembled, in continuous time.

    `columns` (k,) of P; A, B of the same degree; the block q has A_i and B_i by P_j with the weight
    `flow` (q, i, j), P_j in dP/dp with `slope` (q, j), and `output` r with `up` (q, r); `supply` of
    a norm-bounded block.
    """

    columns: Array
    A: Array
    B: Array
    flow: Array
    slope: Array
    output: Array
    up: Array
    supply: Supply | None


def over_cell(
    cell: Cell, knots: Array, degree: int, extra: int, multiplier: BlockMultipliers | None = None
) -> OverCell:
    """Compute the weights of one cell; `extra` raises the degree of the Bernstein form."""
    A, B, dM = common_degree(cell.piece.A, cell.piece.B, cell)
    output, own = output_terms(cell, multiplier), supply_terms(cell, multiplier)
    d = max(degree + dM, len(output) - 1, own.degree) + extra
    a, b, width = local_coordinates(cell, knots)
    here = restriction(degree, a, b)
    up = elevation_matrix(degree + dM, d)
    flow = np.einsum("qm,mik,kj->qij", up, product_weights(dM, degree), here)
    slope = slope_over(degree, here, (b - a) * width)
    slope = elevation_matrix(len(slope) - 1, d) @ slope
    columns = cell.segment * degree + np.arange(degree + 1)
    up = elevation_matrix(len(output) - 1, d)
    return OverCell(columns, A, B, flow, slope, output, up, own.over(cell, knots, d))


class OverStrip(NamedTuple):
    """Weights from which the blocks of one strip are assembled, in discrete time.

    `columns` (k,) of P, those of p from `own` on and those of p(k+1) from `next` on; A, B of the
    same degree. P(p) has the weights `here` (q, j); P(p(k+1)) those of `after` (x, s, j), its
    product with A and B twice those of `raised`; `output` r has `up` (q, r). One group of blocks
    for every s, `likely` (s) or not to bind.
    """

    columns: Array
    own: int
    next: int
    A: Array
    B: Array
    here: Array
    after: Array
    raised: Array
    output: Array
    up: Array
    likely: tuple[bool, ...]
    supply: Supply | None


def over_strips(
    strips: Sequence[Strip],
    knots: Array,
    degree: int,
    extra: int,
    multiplier: BlockMultipliers | None = None,
) -> Iterator[OverStrip]:
    """Compute the weights of every strip. Likely to be active: the border lines of the widest cell
    of each segment and piece.
    """
    widest: dict[tuple[int, float], float] = {}
    for cell in (strip.cell for strip in strips):
        place = (cell.segment, cell.piece.low)
        widest[place] = max(widest.get(place, 0.0), cell.high - cell.low)
    for strip in strips:
        cell = strip.cell
        wide_cell = cell.high - cell.low >= 0.5 * widest[cell.segment, cell.piece.low]
        A, B, dM = common_degree(cell.piece.A, cell.piece.B, cell)
        output, own = output_terms(cell, multiplier), supply_terms(cell, multiplier)
        d = max(degree + 2 * dM, len(output) - 1, own.degree) + extra
        a, b, _ = local_coordinates(cell, knots)
        low, high = knots[strip.next_segment], knots[strip.next_segment + 1]
        corners = [[(q - low) / (high - low) for q in pair] for pair in strip.corners]
        first = min(strip.next_segment, cell.segment)
        count = (abs(strip.next_segment - cell.segment) + 1) * degree + 1
        yield OverStrip(
            first * degree + np.arange(count),
            (cell.segment - first) * degree,
            (strip.next_segment - first) * degree,
            A,
            B,
            elevation_matrix(degree, d) @ restriction(degree, a, b),
            composition(degree, corners),
            elevation_matrix(degree + 2 * dM, d),
            output,
            elevation_matrix(len(output) - 1, d),
            tuple(wide_cell and k in (0, degree) for k in range(degree + 1)),
            own.over(cell, knots, d),
        )


def common_degree(A: Array, B: Array, cell: Cell) -> tuple[Array, Array, int]:
    """Return A and B over the cell with coefficients of the same degree, and that degree."""
    A, B = (_restrict(M, cell) for M in (A, B))
    d = max(len(A), len(B)) - 1
    return _raise(A, d), _raise(B, d), d


def _raise(M: Array, degree: int) -> Array:
    return np.tensordot(elevation_matrix(len(M) - 1, degree), M, axes=1)


def _restrict(M: Array, cell: Cell) -> Array:
    width = cell.piece.high - cell.piece.low
    a, b = (cell.low - cell.piece.low) / width, (cell.high - cell.piece.low) / width
    return np.tensordot(restriction(len(M) - 1, a, b), M, axes=1)


def local_coordinates(cell: Cell, knots: Array) -> tuple[float, float, float]:
    """Return the cell's ends as fractions of its segment, and the segment's width."""
    low, high = float(knots[cell.segment]), float(knots[cell.segment + 1])
    return (cell.low - low) / (high - low), (cell.high - low) / (high - low), high - low


def slope_over(degree: int, here: Array, width: float) -> Array:
    """Bernstein coefficients (degree, columns) of dP/dp over the cell."""
    return np.zeros((1, here.shape[1])) if degree == 0 else degree * np.diff(here, axis=0) / width


def bordered(top: Array, side: Array) -> Array:
    """Return [top side; side' 0]."""
    corner = np.zeros((*side.shape[:-2], side.shape[-1], side.shape[-1]))
    return np.concatenate(
        [
            np.concatenate([top, side], axis=-1),
            np.concatenate([np.swapaxes(side, -1, -2), corner], axis=-1),
        ],
        axis=-2,
    )


def output_terms(cell: Cell, multiplier: BlockMultipliers | None = None) -> Array:
    """Bernstein coefficients of [C D]'[C D] over the cell, of the outputs y alone where there is a
    block.
    """
    own = slice(None, None if multiplier is None else -multiplier.block.outputs)
    return _squared(cell.piece.C[:, own], cell.piece.D[:, own], cell)


class SupplyTerms(NamedTuple):
    """Bernstein coefficients `squares` (parts, r, N, N) of the supply of each part of a block over
    a cell for lambda = 1; none without a block. `by`: the multipliers.
    """

    squares: Array
    by: BlockMultipliers | None

    @property
    def degree(self) -> int:
        """Degree of the supply rate with lambda; -1 without a block."""
        return -1 if self.by is None else self.squares.shape[1] - 1 + self.by.degree

    def over(self, cell: Cell, knots: Array, degree: int) -> Supply | None:
        """Return the supply rate as added to each of the degree + 1 coefficients."""
        if self.by is None:
            return None
        e, (a, b, _) = self.by.degree, local_coordinates(cell, knots)
        shares = np.einsum(
            "qm,mri,ij->qrj",
            elevation_matrix(self.degree, degree),
            product_weights(self.squares.shape[1] - 1, e),
            restriction(e, a, b),
        )
        columns, linear, first = [], [], 0
        for count, own in zip(self.by.sizes(len(knots) - 1), self.squares, strict=True):
            each = np.einsum("qrj,rl->qjl", shares, svec(own))
            varies = count > 1
            columns.append(first + (cell.segment * e + np.arange(e + 1) if varies else np.zeros(1)))
            linear.append(each if varies else each.sum(axis=1, keepdims=True))
            first += count
        return Supply(np.concatenate(columns).astype(int), np.concatenate(linear, axis=1))


def supply_terms(cell: Cell, multiplier: BlockMultipliers | None) -> SupplyTerms:
    """bound^2 [G J H]'[G J H] - diag(0, I, 0) over the cell, of each part."""
    if multiplier is None:
        return SupplyTerms(np.zeros((0, 0, 0, 0)), None)
    block, every = multiplier.block, []
    for d, v in block.places(cell.piece.A.shape[1], cell.piece.C.shape[1]):
        squares = block.bound**2 * _squared(cell.piece.C[:, v], cell.piece.D[:, v], cell)
        squares[:, d, d] -= 1.0
        every.append(squares)
    return SupplyTerms(np.stack(every), multiplier)


def _squared(C: Array, D: Array, cell: Cell) -> Array:
    C, D = (_restrict(M, cell) for M in (C, D))
    d = max(len(C), len(D)) - 1
    Y = np.concatenate([_raise(C, d), _raise(D, d)], axis=2)
    return np.einsum("rik,iab,kac->rbc", product_weights(d, d), Y, Y, optimize=True)
