"""Search for invariant ellipsoids, gains on them, and their multipliers, in floating point."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy import sparse

from symheli.values.arrays import Array
from synthesis.numerics.program.affine_program import (
    CONSTANT,
    POINT,
    AffineProgram,
    MatrixVariable,
    from_lower,
)
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.cone_program import ConeProgram, Solver, solve
from synthesis.tubes.deviations import CommandCell
from synthesis.tubes.inequality import (
    MatrixSet,
    Multipliers,
    Shares,
    bounded,
    conditions,
    invariant,
    motion,
)

CONSTANT_SPARE = 1e-6
"""Spare of the constant in the inequality of a gain, 1/s: its bias is no less."""
JUMP_SPARE = 1e-4
"""Spare of the fall of V at a jump, as a share of V."""
PRICE = 1e-8
"""Cost of the traces of multipliers: they stay finite where nothing else bounds them."""
NEGLIGIBLE = 1e-12
"""Size of entries that are left out of a program: numbers near underflow upset solvers."""


class Enclosed(NamedTuple):
    """A cell of commands with the nodes at the ends of its interval, one or two, their distance,
    and the set of F for e = factor z, |z| <= 1.
    """

    cell: CommandCell
    nodes: tuple[int, ...]
    width: float
    over: MatrixSet
    factor: Array


class TubeSolution(NamedTuple):
    """P (nodes, n, n), the multipliers of each cell, and what was made small: the mean square of
    the half widths over those of equal weight, or wind + bias of a gain.
    """

    P: Array
    multipliers: list[Multipliers]
    size: float
    bias: float = 0.0


def smallest(
    cells: Sequence[Enclosed],
    roots: Array,
    sizes: Array,
    decay: float,
    spare: float,
    solver: Solver,
    jump: Array | None = None,
) -> TubeSolution | None:
    """The smallest ellipsoids that satisfy the inequality of every cell with `spare` (1/s) left,
    None: the solver has none.

    roots (nodes, n, n): e = root z are the coordinates at a node in the program. sizes (n,): half
    widths of equal weight. jump (n, n): takes the last ellipsoid into the first.
    """
    nodes = [_Node(root) for root in roots]
    for node in nodes:
        node.is_small(sizes, len(roots))
    made = [_Inequality(cell, roots, decay, spare) for cell in cells]
    for part in made:
        part.is_invariant()
    jumps = [] if jump is None else [_Jump(roots, jump)]
    return _solved(nodes, None, [*made, *jumps], solver)


def least_gain(
    cells: Sequence[Enclosed],
    roots: Array,
    output: Array,
    energy: bool,
    spare: float,
    solver: Solver,
) -> TubeSolution | None:
    """V = e'Q e whose growth is at most wind |w|^2 + bias, |w| <= 1, less |output e|^2 where
    `energy`, else V >= |output e|^2: the one with the least wind + bias. As `smallest`.
    """
    nodes, price = [_Node(root) for root in roots], _Price()
    for node in nodes:
        node.is_above(0 * output if energy else output)
    made = [_Inequality(cell, roots, 0.0, spare, price) for cell in cells]
    for part in made:
        part.is_bounded(output if energy else 0 * output)
    return _solved(nodes, price, made, solver)


def _solved(
    nodes: Sequence[_Node],
    price: _Price | None,
    made: Sequence[_Inequality | _Jump],
    solver: Solver,
) -> TubeSolution | None:
    common = [*nodes, *([] if price is None else [price])]
    starts = np.cumsum([0, *(part.program.count for part in common)])
    columns = [a + np.arange(b - a) for a, b in pairwise(starts)]
    prices = columns[len(nodes) :]
    count = int(starts[-1])
    for part in made:
        shared = [columns[i][nodes[i].P.columns[0]] for i in part.nodes] + prices
        own = part.program.count - sum(map(len, shared))
        columns.append(np.concatenate([*shared, count + np.arange(own)]).astype(int))
        count += own
    programs = [part.program for part in (*common, *made)]
    rows = [program.placed(c, count) for program, c in zip(programs, columns, strict=True)]
    cost = np.zeros(count)
    for part, c in zip((*common, *made), columns, strict=True):
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
    P = np.array([node.found(own) for node, own in zip(nodes, x, strict=False)])
    if np.linalg.eigvalsh(P).min() <= 0:
        return None
    found_in = zip(made, x[len(common) :], strict=True)
    by = [part.found(own) for part, own in found_in if isinstance(part, _Inequality)]
    bias = 0.0 if price is None else float(x[len(nodes)][1])
    return TubeSolution(P, by, float(cost @ found.x), bias)


class _Price:
    """wind and bias, the same in all inequalities."""

    def __init__(self) -> None:
        self.program = AffineProgram()
        made = [self.program.variable(np.ones((1, 1, 1)), CONSTANT) for _ in range(2)]
        for variable in made:
            self.program.nonnegative(POINT, self.program.value(variable))
        self.cost = np.ones(self.program.count)


class _Node:
    """P at a node in the coordinates z, e = root z."""

    def __init__(self, root: Array):
        self.root, self.program = root, AffineProgram()
        self.P = self.program.symmetric(len(root), CONSTANT)
        self.cost = np.zeros(self.program.count)

    def is_small(self, sizes: Array, nodes: int) -> None:
        """Let its part of the size be the cost."""
        root, identity = self.root, np.eye(len(self.root))
        inverse = self.program.symmetric(len(root), CONSTANT)
        P, above = (self.program.value(v) for v in (self.P, inverse))
        self.program.positive(POINT, from_lower([[above], [self.program.known(identity), P]]))
        self.cost = np.zeros(self.program.count)
        weight = root.T @ np.diag(1 / sizes**2) @ root / (len(root) * nodes)
        self.cost[inverse.columns[0]] = np.tensordot(inverse.entries, weight, axes=2)

    def is_above(self, output: Array) -> None:
        """Impose P > output'output."""
        z = output @ self.root
        self.program.positive(POINT, self.program.value(self.P) - self.program.known(z.T @ z))

    def found(self, x: Array) -> Array:
        back = np.linalg.inv(self.root)
        return back.T @ self.P.coefficients(x)[0] @ back


class _Jump:
    """V after a jump R e, at the first node, is at most V before it, at the last."""

    def __init__(self, roots: Array, jump: Array):
        self.program = program = AffineProgram()
        self.nodes = (0, len(roots) - 1)
        after, before = (program.symmetric(len(jump), CONSTANT) for _ in range(2))
        R = np.linalg.solve(roots[0], jump @ roots[-1])
        least = program.known(JUMP_SPARE * np.eye(len(R)))
        fall = program.value(before) - R.T @ program.value(after) @ R - least
        program.positive(POINT, fall)
        self.cost = np.zeros(program.count)


class _Inequality:
    """The inequality of a cell in the coordinates of its factor."""

    def __init__(
        self,
        cell: Enclosed,
        roots: Array,
        decay: float,
        spare: float,
        price: _Price | None = None,
    ):
        self.cell, self.roots, self.decay, self.spare = cell, roots, decay, spare
        self.nodes = cell.nodes
        self.program = program = AffineProgram()
        n, self.over = len(cell.factor), cell.over.scaled(cell.factor)
        self.given = [program.symmetric(n, CONSTANT) for _ in cell.nodes]
        one = np.ones((1, 1, 1))
        common = [] if price is None else [program.variable(one, CONSTANT) for _ in range(2)]
        terms, r = np.eye(len(self.over.left)), self.over.onto.shape[1]
        self.variables: dict[str, MatrixVariable] = {
            "tube": program.symmetric(r, CONSTANT),
            "gust": program.symmetric(r, CONSTANT),
            "terms": program.variable(terms[:, :, None] * terms, CONSTANT),
            "wind": common[0] if common else program.variable(one, CONSTANT),
        }
        self.shares = [program.symmetric(n, CONSTANT) for _ in range(3 * len(cell.nodes))]
        self.bias = common[1:]

    def is_invariant(self) -> None:
        """Impose that the ellipsoid is."""
        by = self._multipliers()
        self._impose(invariant(by, self.over.corners.shape[-2:]), self.spare)
        self.program.nonnegative(POINT, by.wind)

    def is_bounded(self, output: Array) -> None:
        """Impose the growth of V by the price."""
        by, bias = self._multipliers(), self.program.value(self.bias[0])
        shape = self.over.corners.shape[-2:]
        self._impose(bounded(by.wind, bias, output @ self.cell.factor, shape), CONSTANT_SPARE)

    def _multipliers(self) -> Multipliers:
        values = {name: self.program.value(v) for name, v in self.variables.items()}
        return Multipliers(decay=self.decay, **values)

    def _impose(self, supply: Array, constant: float) -> None:
        """Impose the inequality with the spare, of the constant another."""
        program, cell = self.program, self.cell
        nodes = []
        for k, i in enumerate(cell.nodes):
            turn = np.linalg.solve(self.roots[i], cell.factor)
            nodes.append(turn.T @ program.value(self.given[k]) @ turn)
        P = motion(nodes, cell.width, *(part[:2] for part in cell.cell.domain))
        values = [program.value(v) for v in self.shares]
        X = [Shares(*values[k : k + 3]) for k in range(0, len(values), 3)]
        bounds, falls = conditions(P, X, self.over, self._multipliers(), supply)
        least = program.known(np.diag([self.spare] * (len(supply[0, 0]) - 1) + [constant]))
        for F in [*bounds, *(M - least for M in falls)]:
            program.positive(POINT, F)
        self.cost = np.zeros(program.count)
        for variable in self.variables.values():
            self.cost[variable.columns[0]] = PRICE * np.einsum("eii->e", variable.entries)

    def found(self, x: Array) -> Multipliers:
        back = np.linalg.inv(self.cell.over.unit(self.cell.factor))
        own = {name: v.coefficients(x)[0] for name, v in self.variables.items()}
        own["tube"], own["gust"] = (back.T @ own[name] @ back for name in ("tube", "gust"))
        return Multipliers(decay=self.decay, **own)
