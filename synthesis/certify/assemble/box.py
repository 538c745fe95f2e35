"""The inequalities of a problem over a box as a cone program, by the chosen relaxation.

The general assembly: any number of parameters, any way to impose. It shares its inequalities with
the proof; `pointwise` does not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from math import prod
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from symheli.errors import InputError
from symheli.values.arrays import Array
from synthesis.certify.assemble.imposed import (
    Conditions,
    coefficient_conditions,
    grid_conditions,
    sums_of_squares,
    vertex_conditions,
)
from synthesis.certify.proof.inequalities import Pair, decrease, output_form, positivity
from synthesis.certify.statement.box import segment_slices
from synthesis.certify.statement.demand import Demand
from synthesis.certify.statement.impose import Bernstein, Grid, Imposed, SumOfSquares, Vertices
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.polynomial.pieces import Pieces
from synthesis.numerics.polynomial.regions import Region, regions
from synthesis.numerics.polynomial.symmetric import basis, extended, length, svec
from synthesis.numerics.program.cone_program import ConeProgram


class Shape(NamedTuple):
    """The form of P: knots and degree in each parameter, and the total degree where that is limited
    (one segment only).
    """

    knots: tuple[Array, ...]
    degrees: tuple[int, ...]
    total: int | None = None

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of coefficients along each parameter."""
        return tuple((len(k) - 1) * d + 1 for k, d in zip(self.knots, self.degrees, strict=True))

    @property
    def free(self) -> Array:
        """Matrix (coefficients, unknowns): the identity, or orthonormal polynomials of limited
        total degree.
        """
        if self.total is None:
            return np.eye(prod(self.counts))
        if any(len(k) > 2 for k in self.knots):
            raise InputError("a total degree of P needs one segment in each parameter")
        each = [_legendre(d) for d in self.degrees]
        whole = reduce(np.kron, each)
        sums = reduce(np.add.outer, [np.arange(d + 1) for d in self.degrees]).ravel()
        return whole[:, sums <= self.total]


class Affine(NamedTuple):
    """F = sum_v x_v linear[., v] + constant + g `level`, which must stay below -`back_off`; svec'd
    matrices (N, N).

    `linear` (K, V, L), `constant` and `level` (K, L) are the Bernstein coefficients of `degrees`;
    `columns` (V,) of P.
    """

    degrees: tuple[int, ...]
    columns: Array
    linear: Array
    constant: Array
    level: Array
    back_off: Array
    N: int


def affine_inequalities(
    model: Pieces, demand: Demand, shape: Shape, margin: float, floor: float, weight: Array
) -> list[Affine]:
    """Every inequality of the problem, scaled data; the state blocks of the decrease in coordinates
    changed by `weight`.
    """
    nx, nu, ny = model.sizes
    eye, gains = np.eye(nx), demand.kind.driven
    nothing = svec(np.zeros((nx, nx)))
    out = []
    # every P on its own segments
    for index in np.ndindex(*(len(k) - 1 for k in shape.knots)):
        columns, P = _unknown(shape, index, np.unique(coefficients_of(shape, index)), nx)
        out.append(
            _affine(
                positivity(P), columns, nothing, floor * svec(eye) if gains else nothing, 0 * eye
            )
        )
        if not gains:
            out.append(_affine(P, columns, nothing, nothing, -eye))
    if gains:
        inputs = np.diag(np.r_[np.zeros(nx), np.ones(nu)])
        paid = 0 if demand.of_gramian else demand.kind.facets.rise.inputs
        level, fixed = -paid * svec(inputs), -inputs if demand.of_gramian else 0 * inputs
        back_off = margin * svec(np.diag(np.r_[np.ones(nx), np.zeros(nu)]))
    else:
        level, fixed, back_off = svec(eye), 0 * eye, nothing
    for region in regions(model, shape.knots, demand.motion, demand.moving(shape.degrees)):
        columns, pair = _pair(shape, region, nx)
        for F, G in _with_rise(model, region, pair, demand):
            W = extended(weight, F.shape[0] - nx)
            F = PolynomialMatrix(F.box, W.T @ F.coefficients @ W)
            rise = level if G is None else PolynomialMatrix(G.box, W.T @ G.coefficients @ W)
            out.append(_affine(F, columns, rise, back_off, fixed))
        if demand.of_gramian and region.next_segment == region.segment:
            columns, P = _unknown(
                shape, region.segment, np.unique(coefficients_of(shape, region.segment)), nx
            )
            F = output_form(model, region, P, demand, float)
            size, seen = F.shape[0], demand.seen(ny)
            level_y = -svec(np.diag(np.r_[np.zeros(size - seen), np.ones(seen)]))
            out.append(_affine(F, columns, level_y, 0 * level_y, np.zeros((size, size))))
    return out


def _with_rise(
    model: Pieces, region: Region, pair: Pair, demand: Demand
) -> Iterator[tuple[PolynomialMatrix, PolynomialMatrix | None]]:
    """Yield each dissipation inequality at level 0, and what a level of 1 adds; None of a kind
    whose level multiplies the inputs alone, or that has none.
    """
    every = decrease(model, region, pair, demand, float)
    if not (demand.kind.facets.rise.outputs or demand.kind.facets.rise.cross):
        yield from ((F, None) for F in every)
        return
    for F, higher in zip(every, decrease(model, region, pair, demand, float, 1.0), strict=True):
        degrees = tuple(map(max, F.degrees, higher.degrees))
        F = F.elevate(degrees)
        yield F, higher.elevate(degrees) - F


def assemble(
    inequalities: Sequence[Affine],
    shape: Shape,
    states: int,
    impose: Imposed,
    *,
    maximise: bool,
) -> ConeProgram:
    """Minimise g, or maximise it, subject to all inequalities; the unknowns are P's free
    coefficients, g and Gram matrices.
    """
    nv = length(states)
    free = shape.free
    tensor = len(free) * nv
    reduce_P = sparse.kron(sparse.csr_matrix(free), sparse.identity(nv), format="csr")
    zero, cone, sizes, squares = [], [], [], []
    for F in inequalities:
        P = _columns(F, tensor)
        if isinstance(impose, SumOfSquares):
            F, P = _raised(F, impose.elevation, tensor)
            terms = list(sums_of_squares(F.degrees, F.N))
            level = F.level.ravel()
            zero.append(
                (
                    P,
                    level,
                    (-F.constant - F.back_off).ravel(),
                    sparse.hstack([t.map for t in terms], format="csc"),
                )
            )
            squares += [t.size for t in terms]
            continue
        conditions = _conditions(impose, F.degrees)
        lift = sparse.kron(
            sparse.csr_matrix(conditions.negative), sparse.identity(length(F.N)), format="csr"
        )
        rows = len(conditions.negative)
        cone.append(
            (
                lift @ P,
                (conditions.negative @ F.level).ravel(),
                (-conditions.negative @ F.constant - F.back_off).ravel(),
            )
        )
        bend: Any = sparse.kron(
            sparse.csr_matrix(conditions.positive), sparse.identity(length(F.N)), format="csr"
        )
        cone.append(
            (-bend @ P, np.zeros(bend.shape[0]), (conditions.positive @ F.constant).ravel())
        )
        sizes += [F.N] * (rows + len(conditions.positive))
    parts = [*((P, level, b) for P, level, b, _ in zero), *cone]
    left: Any = sparse.vstack([P for P, _, _ in parts]) @ reduce_P
    level = sparse.csr_matrix(np.concatenate([level for _, level, _ in parts])[:, None])
    b = np.concatenate([right for _, _, right in parts])
    A: Any = sparse.hstack([left, level])
    equalities = 0
    if zero:
        gram: Any = sparse.block_diag([maps for *_, maps in zero])
        equalities = gram.shape[0]
        A = sparse.bmat([[A, gram], [None, -sparse.identity(gram.shape[1])]])
        b = np.concatenate([b, np.zeros(gram.shape[1])])
        sizes += squares
    c = np.zeros(A.shape[1])
    c[left.shape[1]] = -1.0 if maximise else 1.0
    return ConeProgram(c, sparse.csc_matrix(A), b, tuple(sizes), equalities)


def _conditions(impose: Bernstein | Vertices | Grid, degrees: tuple[int, ...]) -> Conditions:
    if isinstance(impose, Grid):
        return grid_conditions(degrees, impose.points)
    if isinstance(impose, Vertices):
        return vertex_conditions(degrees)
    return coefficient_conditions(degrees, impose.elevation, impose.subdivision)


def _columns(F: Affine, tensor: int) -> sparse.csr_matrix:
    K, V, L = F.linear.shape
    rows = np.moveaxis(F.linear, 2, 1).reshape(K * L, V)
    where = np.nonzero(rows)
    return sparse.csr_matrix((rows[where], (where[0], F.columns[where[1]])), shape=(K * L, tensor))


def _raised(F: Affine, elevation: int, tensor: int) -> tuple[Affine, sparse.csr_matrix]:
    if elevation:
        T = coefficient_conditions(F.degrees, elevation, 0).negative
        degrees = tuple(d + elevation if d else 0 for d in F.degrees)
        F = F._replace(
            degrees=degrees,
            linear=np.tensordot(T, F.linear, axes=1),
            constant=T @ F.constant,
            level=T @ F.level,
        )
    return F, _columns(F, tensor)


def _affine(
    F: PolynomialMatrix,
    columns: Array,
    level: Array | PolynomialMatrix,
    back_off: Array,
    fixed: Array,
) -> Affine:
    """Return the affine map of the polynomials of a stack of unit P and, last in the stack, P = 0;
    `level` multiplies g, a constant (L,) or the same stack of one polynomial; `fixed` is a constant
    to add.
    """
    m, N = len(F.box), F.shape[0]
    c = svec(F.coefficients).reshape(-1, F.coefficients.shape[m], length(N))
    if isinstance(level, PolynomialMatrix):
        g = svec(level.coefficients).reshape(len(c), -1, length(N))[:, -1]
    else:
        g = np.tile(level, (len(c), 1))
    return Affine(F.degrees, columns, c[:, :-1] - c[:, -1:], c[:, -1] + svec(fixed), g, back_off, N)


def coefficients_of(shape: Shape, index: Sequence[int]) -> Array:
    """Return the indices of the coefficients of P on one segment of each parameter, an axis a
    parameter.
    """
    return np.arange(prod(shape.counts)).reshape(shape.counts)[segment_slices(shape.degrees, index)]


def _pair(shape: Shape, region: Region, states: int) -> tuple[Array, Pair]:
    here, there = region.segment, region.next_segment
    involved = np.union1d(coefficients_of(shape, here), coefficients_of(shape, there))
    columns, P = _unknown(shape, here, involved, states)
    return columns, Pair(P, _unknown(shape, there, involved, states)[1])


def _unknown(
    shape: Shape, index: Sequence[int], involved: Array, states: int
) -> tuple[Array, PolynomialMatrix]:
    """Return columns (V,) of the `involved` coefficients, and P on a segment for a unit of each;
    then for P = 0.
    """
    ids, E = coefficients_of(shape, index), basis(states)
    nv = len(E)
    unit = (ids[..., None] == involved).astype(float)
    stack = np.multiply.outer(unit, E).reshape(*ids.shape, len(involved) * nv, states, states)
    stack = np.concatenate([stack, np.zeros((*ids.shape, 1, states, states))], axis=len(ids.shape))
    box = tuple((float(k[j]), float(k[j + 1])) for k, j in zip(shape.knots, index, strict=True))
    return (involved[:, None] * nv + np.arange(nv)).ravel(), PolynomialMatrix(box, stack)


def _legendre(degree: int) -> Array:
    """Bernstein coefficients (degree + 1, degree + 1) on [0, 1], a column a Legendre polynomial,
    orthonormal.
    """
    nodes = 0.5 - 0.5 * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    values = np.polynomial.legendre.legvander(2 * nodes - 1, degree) * np.sqrt(
        2 * np.arange(degree + 1) + 1
    )
    identity = PolynomialMatrix(((0.0, 1.0),), np.eye(degree + 1)[:, None, :])
    return np.linalg.solve(identity(nodes[:, None])[:, 0, :], values)
