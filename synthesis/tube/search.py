"""Search for the ellipsoids of a tube and for the multipliers that prove it, in floating point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symheli.lpv import Polynomial
from synthesis.lpv.affine_program import AffineProgram, BernsteinCell, Variable, from_lower
from synthesis.program.cone_program import Answer, Solver
from synthesis.tube.inequality import Coefficients, Multipliers, block

Array = np.ndarray

POINT = BernsteinCell(np.zeros((1, 1)), np.ones((1, 1)))
"""Where there is no parameter."""
CONSTANT = Polynomial(0, 0.0, 1.0)


def _multipliers(program: AffineProgram, over: Coefficients) -> dict[str, Variable]:
    n, terms = len(over.centre), len(over.left)
    number = np.ones((1, 1, 1))
    return {
        "tube": program.symmetric(n, CONSTANT),
        "gust": program.symmetric(n, CONSTANT),
        "terms": program.variable(np.eye(terms)[:, :, None] * np.eye(terms), CONSTANT),
        "wind": program.variable(number, CONSTANT),
        "motion": program.variable(number, CONSTANT),
    }


def smallest(
    over: Sequence[Coefficients],
    moving: Sequence[Array],
    factor: Array,
    sizes: Array,
    decay: float,
    within: bool,
    margin: float = 0.0,
    solver: Solver | None = None,
) -> tuple[Array, float] | None:
    """The P (n, n) of the smallest ellipsoid that satisfies the inequality for each set and each
    `moving` = dP/dt, and its size: the mean square of its half widths over `sizes` (n,).

    e = factor z are the coordinates of the program. `within`: the ellipsoid lies in |z| <= 1. None
    where the solver finds none.
    """
    program, n = AffineProgram(), len(factor)
    unknown, inverse = program.symmetric(n, CONSTANT), program.symmetric(n, CONSTANT)
    scaled = [c.scaled(factor) for c in over]
    held = [_multipliers(program, c) for c in scaled]
    P, identity = program.value(unknown), program.known(np.eye(n))
    for c, variables in zip(scaled, held, strict=True):
        values = {name: program.value(v) for name, v in variables.items()}
        by = Multipliers(decay=decay, **values)
        for change in moving:
            F = block(P, program.known(factor.T @ change @ factor), c, by)
            lifted = np.zeros(F.shape[-1])
            lifted[: n + 5] = margin
            program.positive(POINT, F - program.known(np.diag(lifted)))
        program.nonnegative(POINT, values["wind"])
        program.nonnegative(POINT, values["motion"])
    program.positive(POINT, from_lower([[program.value(inverse)], [identity, P]]))
    if within:
        program.positive(POINT, P - identity)
    cost = np.zeros(program.count)
    weight = factor.T @ np.diag(1 / sizes**2) @ factor / n
    cost[inverse.columns[0]] = np.tensordot(inverse.entries, weight, axes=2)
    found = program.minimise(cost, solver or Solver())
    if found.answer is not Answer.SOLVED or found.x is None:
        return None
    back = np.linalg.inv(factor)
    P_z = unknown.coefficients(found.x)[0]
    if np.linalg.eigvalsh(P_z)[0] <= 0:
        return None
    return back.T @ P_z @ back, float(cost @ found.x)
