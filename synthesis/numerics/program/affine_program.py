"""Semidefinite programs in matrices that are unknown functions of p, imposed by Bernstein
coefficients.

At each p an inequality is affine in the values of these matrices there. It is kept as an array
(1 + e, K, N, N): its known part, then the factor of each entry of the values, at the K nodes of a
cell. Sums, products with known matrices (K, ., .) and block matrices of such arrays are NumPy's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from scipy import sparse

from symheli.errors import InputError
from symheli.lpv.bases import FunctionSpace, Polynomial
from symheli.lpv.bases.function_space import tensor_grid
from symheli.lpv.bases.polynomials import interpolation_points
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.bernstein import blossom
from synthesis.numerics.polynomial.matrix import Box
from synthesis.numerics.polynomial.symmetric import basis as symmetric_basis
from synthesis.numerics.polynomial.symmetric import length, svec, symmetrized
from synthesis.numerics.program.cone_program import ConeProgram, Solver, SolverPoint, solve
from synthesis.numerics.program.expression import AffineMatrix, Inequality
from synthesis.numerics.program.unknown import UnknownFunction

MARGIN = 1e-8
"""Every inequality is imposed as >= this multiple of the identity."""


class BernsteinCell(NamedTuple):
    """A box of the parameters: `nodes` (K, m) inside it, and `to_bernstein` (q, K) from values
    there to Bernstein coefficients of degrees that take them exactly.
    """

    nodes: Array
    to_bernstein: Array


POINT = BernsteinCell(np.zeros((1, 1)), np.ones((1, 1)))
"""The cell of a program without a scheduling parameter."""
CONSTANT = Polynomial(0, 0.0, 1.0)
"""The basis of a matrix that depends on no parameter."""


def cells(breaks: Sequence[Sequence[float]], degrees: Sequence[int]) -> list[BernsteinCell]:
    """Return one cell between every two breaks of each parameter, for polynomials of these
    degrees.
    """
    units = [interpolation_points([d], [(0.0, 1.0)]) for d in degrees]
    maps = [
        np.linalg.inv([blossom([t] * d) for t in unit])
        for unit, d in zip(units, degrees, strict=True)
    ]
    return [
        BernsteinCell(
            tensor_grid([a + (b - a) * unit for (a, b), unit in zip(sides, units, strict=True)]),
            reduce(np.kron, maps),
        )
        for sides in product(*(list(pairwise(b)) for b in breaks))
    ]


@dataclass(frozen=True, eq=False)
class MatrixVariable:
    """A matrix that is an unknown function of p.

    Its value at p is a sum of `entries` (e, a, b), whose factors are the functions of `unknown`;
    `columns` (k, e) are the numbers of their coefficients in the program. `here` and `along` are
    the places of the factors and of their derivatives among the values at p.
    """

    unknown: UnknownFunction
    entries: Array
    columns: Array
    here: slice
    along: slice

    def coefficients(self, x: Array) -> Array:
        """Return the coefficients (k, a, b) of the functions at the solver's point x."""
        return np.tensordot(x[self.columns], self.entries, axes=1)

    def at(self, x: Array, p: Array) -> Array:
        """Return the values (K, a, b) at p (K, m)."""
        return self.unknown.at(self.coefficients(x), p)

    def on(self, box: Box) -> AffineMatrix:
        """Return the variable on a box of p on which its functions are polynomials: its range, or a
        piece of it.
        """
        basis = self.unknown.basis
        degrees = basis.degrees or (basis.pieces()[0].bernstein.shape[1] - 1,)
        if basis.size == 1:  # the same for all p, on a box of any dimension
            degrees = (0,) * len(box)
        (cell,) = cells(box, degrees)
        values = cell.to_bernstein @ self.unknown.values(cell.nodes)
        factors = np.einsum("qk,eab->qkeab", values, self.entries)
        c = np.zeros((len(values), 2 + int(self.columns.max()), *self.entries.shape[1:]))
        c[:, 1 + self.columns.ravel()] = factors.reshape(len(values), -1, *c.shape[2:])
        return AffineMatrix(box, c.reshape(*(d + 1 for d in degrees), *c.shape[1:]))


class AffineProgram:
    """A semidefinite program in matrices that are unknown functions of p.

    It minimises c' x under inequalities that hold for all p of a box, by their Bernstein
    coefficients. `require` takes them as one writes them; each has a name, and `deciding` tells
    which ones the optimum rests on. What a solver returns is a candidate: verify it.

    Raises
    ------
    InputError
        For a product of two unknowns, or matrices of different shapes.

    See Also
    --------
    synthesis.analysis.PolynomialMatrix : known matrices, and exact verification
    synthesis.Solver : solvers, tolerances

    Examples
    --------
    >>> from symheli.lpv import Polynomial
    >>> A = PolynomialMatrix.from_monomials({(0,): [[-1.0]], (1,): [[-1.0]]}, [(0.0, 1.0)])
    >>> program = AffineProgram()
    >>> decay = program.full(1, 1, Polynomial(0, 0.0, 1.0)).on(A.box)
    >>> program.require(-2 * A - 2 * decay >> 0, "decay")
    >>> found = program.minimise(-decay, Solver())  # x' = -(1 + p) x: 1 at worst
    >>> print(f"{decay.at(found.x)([0.5]).item():.4f}, {program.deciding(found)[0][0]}")
    1.0000, decay
    """

    def __init__(self) -> None:
        self._names: dict[int, str] = {}
        self.variables: list[MatrixVariable] = []
        self.count, self.values = 0, 1
        self._zero: list[tuple[sparse.csr_matrix, Array]] = []
        self._positive: list[tuple[sparse.csr_matrix, Array]] = []
        self._sizes: list[int] = []

    def variable(self, entries: Array, basis: FunctionSpace) -> MatrixVariable:
        """Add a matrix that is a sum of `entries` (e, a, b), each times functions of this basis."""
        e = len(entries)
        columns = self.count + np.arange(basis.size * e).reshape(basis.size, e)
        here = slice(self.values, self.values + e)
        along = slice(here.stop, here.stop + (e if basis.size > 1 else 0))
        made = MatrixVariable(UnknownFunction(basis, 0), entries, columns, here, along)
        self.count, self.values = self.count + columns.size, along.stop
        self.variables.append(made)
        return made

    def symmetric(self, n: int, basis: FunctionSpace) -> MatrixVariable:
        """Add a symmetric matrix (n, n)."""
        return self.variable(symmetric_basis(n), basis)

    def full(self, rows: int, columns: int, basis: FunctionSpace) -> MatrixVariable:
        """Add a matrix (rows, columns) without structure."""
        return self.variable(np.eye(rows * columns).reshape(-1, rows, columns), basis)

    def known(self, M: Array) -> Array:
        """Return a given matrix (..., a, b) in the format of the variables' values."""
        M = M if M.ndim > 2 else M[None]
        out = np.zeros((self.values, *M.shape))
        out[0] = M
        return out

    def value(self, variable: MatrixVariable) -> Array:
        """Return the variable at p."""
        return self._placed(variable.entries, variable.here)

    def slope(self, variable: MatrixVariable) -> Array:
        """Return its derivative along the motion of p for which the inequality is imposed."""
        moving = variable.along.stop - variable.along.start
        return self._placed(variable.entries[:moving], variable.along)

    def _placed(self, entries: Array, where: slice) -> Array:
        out = np.zeros((self.values, 1, *entries.shape[1:]))
        out[where, 0] = entries
        return out

    def positive(
        self, cell: BernsteinCell, F: Array, motion: Array | None = None, name: str = ""
    ) -> None:
        """Impose F(p) >= `MARGIN` on the cell, by its Bernstein coefficients, for the motion dp/dt
        (K, m) at its nodes; `name` is what messages call it.
        """
        v = svec(symmetrized(np.broadcast_to(F, (len(F), len(cell.nodes), *F.shape[-2:]))))
        v[0] -= MARGIN * svec(np.eye(F.shape[-1]))
        for weights in cell.to_bernstein:
            self._names[len(self._positive)] = name
            self._positive.append(self._row(weights, v, cell, motion))
            self._sizes.append(F.shape[-1])

    def require(self, inequality: Inequality, name: str, *, margin: float = 0.0) -> None:
        """Impose F >> G for all p of its box: every Bernstein coefficient of F - G is at least
        `margin` times the identity. `name` is what messages call it.
        """
        F = inequality.positive
        rows = F.coefficients.reshape(-1, F.unknowns + 1, *F.shape)
        for each in svec(symmetrized(rows)):
            self._names[len(self._positive)] = name
            constant = each[0] - margin * svec(np.eye(F.shape[0]))
            self._positive.append((sparse.csr_matrix(each[1:].T), constant))
            self._sizes.append(F.shape[0])

    def deciding(self, found: SolverPoint) -> list[tuple[str, float]]:
        """Return the names of inequalities with the share that each has in the multipliers of the
        solver's answer, the largest first: those with no share could be left out. Where there is no
        solution the shares are those of the contradiction. Empty for a solver without multipliers.
        """
        if found.dual is None:
            return []
        shares: dict[str, float] = {}
        start = sum(len(b) for _, b in self._zero)
        for k, n in enumerate(self._sizes):
            trace = float(svec(np.eye(n)) @ found.dual[start : start + length(n)])
            name = self._names[k] or "another inequality"
            shares[name] = shares.get(name, 0.0) + max(trace, 0.0)
            start += length(n)
        total = sum(shares.values()) or 1.0
        ranked = sorted(shares.items(), key=lambda item: -item[1])
        return [(name, share / total) for name, share in ranked]

    def said(self, found: SolverPoint) -> str:
        """Return the solver's message with the inequalities that decide, the first of those with
        at least a tenth.
        """
        first = [name for name, share in self.deciding(found) if share > 0.1]
        return f"{found.message}; it rests on {', '.join(first)}" if first else found.message

    def zero(self, cell: BernsteinCell, F: Array) -> None:
        """Impose F(p) = 0 at the nodes of the cell."""
        v = np.broadcast_to(F, (len(F), len(cell.nodes), *F.shape[-2:]))
        v = v.reshape(*v.shape[:2], -1)
        for weights in np.eye(len(cell.nodes)):
            A, b = self._row(weights, v, cell, None)
            there = np.diff(A.indptr) + (b != 0) > 0
            self._zero.append((A[there], b[there]))

    def nonnegative(self, cell: BernsteinCell, F: Array, name: str = "") -> None:
        """Impose F >= 0 for a number F, which is the same all over the cell."""
        self._names[len(self._positive)] = name
        v = np.broadcast_to(F[..., 0], (len(F), len(cell.nodes), 1))
        self._positive.append(self._row(cell.to_bernstein[0], v, cell, None))
        self._sizes.append(1)

    def _row(
        self, weights: Array, v: Array, cell: BernsteinCell, motion: Array | None
    ) -> tuple[sparse.csr_matrix, Array]:
        """Return the sum of the values v (1 + e, K, L) at the nodes with these weights (K,):
        factors (L, count) of x and the constant (L,).
        """
        out = np.zeros((v.shape[-1], self.count))
        for each in self.variables:
            functions = [(each.here, each.unknown.values(cell.nodes))]
            if motion is not None:
                functions.append((each.along, each.unknown.slopes(cell.nodes, motion)))
            for where, f in functions:
                if np.any(v[where]):
                    part = np.tensordot(weights[:, None] * f, v[where], axes=(0, 1))
                    out[:, each.columns] += np.moveaxis(part, -1, 0)
        return sparse.csr_matrix(out), weights @ v[0]

    def placed(self, columns: Array, count: int) -> tuple[sparse.csr_matrix, Array]:
        """Return the rows A, b of its inequalities, A x + b in the cones of `sizes`, in a program
        of `count` variables, which has the variables of this one at `columns`.
        """
        to = sparse.csr_matrix(
            (np.ones(self.count), (range(self.count), columns)), (self.count, count)
        )
        A = self._stacked(self._positive)
        return sparse.csr_matrix(A @ to), np.concatenate([b for _, b in self._positive])

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of rows of the matrices that are positive semidefinite."""
        return tuple(self._sizes)

    def minimise(self, cost: Array | AffineMatrix, solver: Solver) -> SolverPoint:
        """Return the solver's candidate for the least cost' x, or of a number (1, 1) that does not
        depend on p.
        """
        return solve(self.cone_program(cost), solver)

    def cone_program(self, cost: Array | AffineMatrix) -> ConeProgram:
        """Return the program of that cost, whose `to_cvxpy` hands it to other solvers."""
        if isinstance(cost, AffineMatrix):
            cost = self._factors(cost)
        rows = [*self._zero, *self._positive]
        A = sparse.csc_matrix(-self._stacked(rows))
        b = np.concatenate([b for _, b in rows])
        equalities = sum(len(b) for _, b in self._zero)
        return ConeProgram(cost, A, b, tuple(self._sizes), equalities)

    def _stacked(self, rows: Sequence[tuple[sparse.csr_matrix, Array]]) -> sparse.csr_matrix:
        """The rows below one another, those from before a variable with zeros for it."""
        for A, b in rows:
            A.resize(len(b), self.count)
        return sparse.csr_matrix(sparse.vstack([A for A, _ in rows]))

    def _factors(self, number: AffineMatrix) -> Array:
        """The factor of each unknown in a number."""
        if number.shape != (1, 1) or any(number.degrees):
            raise InputError(
                "the cost is a number that does not depend on p: expected shape (1, 1) and degree"
                f" 0, got {number.shape} and {number.degrees}"
            )
        out = np.zeros(self.count)
        out[: number.unknowns] = number.coefficients.ravel()[1:]
        return out


def from_lower(rows: Sequence[Sequence[Array | None]]) -> Array:
    """Return the symmetric block matrix of its lower triangle, None for a block of zeros."""
    ends = np.cumsum([0, *(row[-1].shape[-1] for row in rows)])  # type: ignore[union-attr]
    at = [slice(a, b) for a, b in pairwise(ends)]
    there = [(i, j, M) for i, row in enumerate(rows) for j, M in enumerate(row) if M is not None]
    leading = np.broadcast_shapes(*(M.shape[:-2] for _, _, M in there))
    dtype = np.result_type(*(M.dtype for _, _, M in there))
    out = np.zeros((*leading, ends[-1], ends[-1]), dtype=dtype)
    for i, j, M in there:
        out[..., at[i], at[j]] = M
        if i != j:
            out[..., at[j], at[i]] = np.swapaxes(M, -1, -2)
    return out
