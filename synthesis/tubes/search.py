"""Search for invariant ellipsoids and their multipliers, in floating point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import sparse

from symheli.lpv import Polynomial
from synthesis.lpv.affine_program import AffineProgram, BernsteinCell, Variable, from_lower
from synthesis.program.cone_program import Answer, ConeProgram, Solver, solve
from synthesis.tubes.deviations import Cell
from synthesis.tubes.inequality import MatrixSet, Multipliers, Shares, conditions, motion

Array = np.ndarray

POINT = BernsteinCell(np.zeros((1, 1)), np.ones((1, 1)))
"""The cell of a program without a scheduling parameter."""
CONSTANT = Polynomial(0, 0.0, 1.0)


PRICE = 1e-8
"""Cost of the traces of multipliers: they stay finite where nothing else bounds them."""
NEGLIGIBLE = 1e-12
"""Size of entries that are left out of a program: numbers near underflow upset solvers."""


class Enclosed(NamedTuple):
    """A cell of commands with the nodes at the ends of its interval, one or two, their distance in
    m/s, and the set of F for e = factor z, |z| <= 1.
    """

    cell: Cell
    nodes: tuple[int, ...]
    width: float
    over: MatrixSet
    factor: Array


class Found(NamedTuple):
    """P (nodes, n, n), the multipliers of each cell, and the mean square of the half widths over
    those of equal weight.
    """

    P: Array
    multipliers: list[Multipliers]
    size: float


def smallest(
    cells: Sequence[Enclosed],
    roots: Array,
    sizes: Array,
    decay: float,
    spare: float,
    solver: Solver,
) -> Found | None:
    """The smallest ellipsoids that satisfy the inequality of every cell with `spare` (1/s) left,
    None: the solver has none.

    roots (nodes, n, n): e = root z are the coordinates at a node in the program. sizes (n,): half
    widths of equal weight.
    """
    parts = [_Node(root, sizes, len(roots)) for root in roots]
    count = sum(node.program.count for node in parts)
    starts = np.cumsum([0, *(node.program.count for node in parts)])
    columns = [
        start + np.arange(node.program.count) for start, node in zip(starts, parts, strict=False)
    ]
    made = [_Inequality(cell, roots, decay, spare) for cell in cells]
    for part in made:
        shared = [columns[i][parts[i].P.columns[0]] for i in part.cell.nodes]
        own = part.program.count - sum(map(len, shared))
        columns.append(np.concatenate([*shared, count + np.arange(own)]))
        count += own
    programs = [part.program for part in (*parts, *made)]
    rows = [program.placed(c, count) for program, c in zip(programs, columns, strict=True)]
    cost = np.zeros(count)
    for part, c in zip((*parts, *made), columns, strict=True):
        cost[c] += part.cost
    A = sparse.csc_matrix(sparse.vstack([A for A, _ in rows]))
    b = np.concatenate([b for _, b in rows])
    A.data[np.abs(A.data) < NEGLIGIBLE] = 0.0
    A.eliminate_zeros()
    cones = tuple(size for program in programs for size in program.sizes)
    found = solve(ConeProgram(cost, -A, b, cones, own_units=True), solver)
    if found.answer is not Answer.SOLVED or found.x is None:
        return None
    x = [found.x[c] for c in columns]
    P = np.array([node.found(own) for node, own in zip(parts, x, strict=False)])
    if np.linalg.eigvalsh(P).min() <= 0:
        return None
    by = [part.found(own) for part, own in zip(made, x[len(parts) :], strict=True)]
    return Found(P, by, float(cost @ found.x))


class _Node:
    """P at a node in the coordinates z, e = root z, and its part of the size."""

    def __init__(self, root: Array, sizes: Array, nodes: int):
        self.root, self.program = root, AffineProgram()
        self.P = self.program.symmetric(len(root), CONSTANT)
        inverse = self.program.symmetric(len(root), CONSTANT)
        P, above = (self.program.value(v) for v in (self.P, inverse))
        identity = self.program.known(np.eye(len(root)))
        self.program.positive(POINT, from_lower([[above], [identity, P]]))
        self.cost = np.zeros(self.program.count)
        weight = root.T @ np.diag(1 / sizes**2) @ root / (len(root) * nodes)
        self.cost[inverse.columns[0]] = np.tensordot(inverse.entries, weight, axes=2)

    def found(self, x: Array) -> Array:
        back = np.linalg.inv(self.root)
        return back.T @ self.P.coefficients(x)[0] @ back


class _Inequality:
    """The inequality of a cell in the coordinates of its factor."""

    def __init__(self, cell: Enclosed, roots: Array, decay: float, spare: float):
        self.cell, self.decay, self.program = cell, decay, AffineProgram()
        program, n, over = self.program, len(cell.factor), cell.over.scaled(cell.factor)
        given = [program.symmetric(n, CONSTANT) for _ in cell.nodes]
        terms = np.eye(len(over.left))
        self.variables: dict[str, Variable] = {
            "tube": program.symmetric(n, CONSTANT),
            "gust": program.symmetric(n, CONSTANT),
            "terms": program.variable(terms[:, :, None] * terms, CONSTANT),
            "wind": program.variable(np.ones((1, 1, 1)), CONSTANT),
        }
        shares = [program.symmetric(n, CONSTANT) for _ in range(3 * len(given))]
        nodes = []
        for variable, i in zip(given, cell.nodes, strict=True):
            turn = np.linalg.solve(roots[i], cell.factor)
            nodes.append(turn.T @ program.value(variable) @ turn)
        values = {name: program.value(v) for name, v in self.variables.items()}
        by = Multipliers(decay=decay, **values)
        P = motion(nodes, cell.width, *cell.cell.domain)
        X = [
            Shares(*(program.value(v) for v in shares[3 * k : 3 * k + 3]))
            for k in range(len(given))
        ]
        bounds, falls = conditions(P, X, over, by)
        least = program.known(spare * np.eye(over.corners.shape[-1]))
        for F in [*bounds, *(M - least for M in falls)]:
            program.positive(POINT, F)
        program.nonnegative(POINT, by.wind)
        self.cost = np.zeros(program.count)
        for variable in self.variables.values():
            self.cost[variable.columns[0]] = PRICE * np.einsum("eii->e", variable.entries)

    def found(self, x: Array) -> Multipliers:
        back = np.linalg.inv(self.cell.factor)
        own = {name: v.coefficients(x)[0] for name, v in self.variables.items()}
        own["tube"], own["gust"] = (back.T @ own[name] @ back for name in ("tube", "gust"))
        return Multipliers(decay=self.decay, **own)
