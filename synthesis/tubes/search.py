"""Search for an invariant ellipsoid and its multipliers, in floating point."""

from __future__ import annotations

import numpy as np

from symheli.lpv import Polynomial
from synthesis.lpv.affine_program import AffineProgram, BernsteinCell, Variable, from_lower
from synthesis.program.cone_program import Answer, Solver
from synthesis.tubes.inequality import MatrixSet, Multipliers, block

Array = np.ndarray

POINT = BernsteinCell(np.zeros((1, 1)), np.ones((1, 1)))
"""The cell of a program without a scheduling parameter."""
CONSTANT = Polynomial(0, 0.0, 1.0)


def smallest(
    over: MatrixSet,
    factor: Array,
    sizes: Array,
    decay: float,
    spare: float,
    solver: Solver,
) -> tuple[Array, float] | None:
    """The P (n, n) of the smallest ellipsoid that satisfies the inequality with `spare` (1/s) left,
    and its size: the mean square of its half widths over `sizes` (n,). None: the solver has none.

    e = factor z are the coordinates of the program.
    """
    program, n = AffineProgram(), len(factor)
    scaled = over.scaled(factor)
    unknown, inverse = program.symmetric(n, CONSTANT), program.symmetric(n, CONSTANT)
    variables = _variables(program, scaled)
    P, identity = program.value(unknown), program.known(np.eye(n))
    _impose(program, P, scaled, variables, decay, program.known(np.array([[spare]])))
    program.positive(POINT, from_lower([[program.value(inverse)], [identity, P]]))
    cost = np.zeros(program.count)
    weight = factor.T @ np.diag(1 / sizes**2) @ factor / n
    cost[inverse.columns[0]] = np.tensordot(inverse.entries, weight, axes=2)
    found = program.minimise(cost, solver)
    if found.answer is not Answer.SOLVED or found.x is None:
        return None
    own = unknown.coefficients(found.x)[0]
    if np.linalg.eigvalsh(own)[0] <= 0:
        return None
    back = np.linalg.inv(factor)
    return back.T @ own @ back, float(cost @ found.x)


def multipliers(
    P: Array, over: MatrixSet, factor: Array, decay: float, solver: Solver
) -> Multipliers | None:
    """The multipliers that leave the inequality most to spare at a given P; None: no solution."""
    program = AffineProgram()
    scaled = over.scaled(factor)
    variables = _variables(program, scaled)
    spare = program.variable(np.ones((1, 1, 1)), CONSTANT)
    left = program.value(spare)
    known = program.known(factor.T @ P @ factor)
    _impose(program, known, scaled, variables, decay, left)
    program.nonnegative(POINT, program.known(np.ones((1, 1))) - left)
    cost = np.zeros(program.count)
    cost[spare.columns.ravel()] = -1.0
    found = program.minimise(cost, solver)
    if found.answer is not Answer.SOLVED or found.x is None:
        return None
    x, back = found.x, np.linalg.inv(factor)
    own = {name: v.coefficients(x)[0] for name, v in variables.items()}
    own["tube"], own["gust"] = (back.T @ own[name] @ back for name in ("tube", "gust"))
    return Multipliers(decay=decay, **own)


def _variables(program: AffineProgram, over: MatrixSet) -> dict[str, Variable]:
    n, terms = len(over.centre), np.eye(len(over.left))
    return {
        "tube": program.symmetric(n, CONSTANT),
        "gust": program.symmetric(n, CONSTANT),
        "terms": program.variable(terms[:, :, None] * terms, CONSTANT),
        "wind": program.variable(np.ones((1, 1, 1)), CONSTANT),
    }


def _impose(
    program: AffineProgram,
    P: Array,
    over: MatrixSet,
    variables: dict[str, Variable],
    decay: float,
    spare: Array,
) -> None:
    """The inequality with a multiple `spare` of the identity to spare."""
    values = {name: program.value(v) for name, v in variables.items()}
    F = block(P, over, Multipliers(decay=decay, **values))
    q = over.centre.shape[1]
    program.positive(POINT, F - spare * np.diag((np.arange(F.shape[-1]) < q).astype(float)))
    program.nonnegative(POINT, values["wind"])
