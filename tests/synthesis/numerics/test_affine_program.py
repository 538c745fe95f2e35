"""Programs in unknown functions of p: those whose answer is known."""

import numpy as np
import pytest

from symheli.lpv.bases.polynomials import polynomials
from synthesis.numerics.program.affine_program import AffineProgram, cells, from_lower
from synthesis.numerics.program.cone_program import Solver

BOX = [(0.0, 2.0)]
SOLVER = Solver("CLARABEL")


def program_of(degree, cell_degree):
    """A program with the unknown x(p) of this degree and a number g, on one cell."""
    program = AffineProgram()
    x = program.full(1, 1, polynomials([degree], BOX))
    g = program.full(1, 1, polynomials([0], BOX))
    (cell,) = cells(BOX, [cell_degree])
    cost = np.zeros(program.count)
    cost[g.columns.item()] = 1.0
    return program, x, g, cell, cost


def test_the_least_bound_of_a_polynomial_is_its_largest_value():
    """[g, 1 + p; 1 + p, 1] >= 0: g is at least (1 + 2)^2."""
    program, x, g, cell, cost = program_of(1, 1)
    program.zero(cell, program.value(x) - program.known(1.0 + cell.nodes[:, :, None]))
    block = from_lower([[program.value(g)], [program.value(x), program.known(np.eye(1))]])
    program.positive(cell, block)
    found = program.minimise(cost, SOLVER)
    assert found.x[g.columns.item()] == pytest.approx(9.0, rel=1e-6)
    np.testing.assert_allclose(x.at(found.x, np.array([[0.5]])), [[[1.5]]], atol=1e-6)


def test_the_slope_is_that_along_the_motion():
    """x = p^2 with dp/dt = -3: dx/dt = -6 p is at least -12, so g + dx/dt >= 0 means g >= 12."""
    program, x, g, cell, cost = program_of(2, 2)
    program.zero(cell, program.value(x) - program.known(cell.nodes[:, :, None] ** 2))
    motion = np.full(cell.nodes.shape, -3.0)
    program.positive(cell, program.value(g) + program.slope(x), motion)
    found = program.minimise(cost, SOLVER)
    assert found.x[g.columns.item()] == pytest.approx(12.0, rel=1e-6)


def test_a_number_is_bounded_once():
    program, _, g, cell, cost = program_of(0, 3)
    program.nonnegative(cell, program.value(g) - program.known(np.array([[4.0]])))
    found = program.minimise(cost, SOLVER)
    assert found.x[g.columns.item()] == pytest.approx(4.0, rel=1e-6)


def test_a_symmetric_block_matrix_is_made_of_its_lower_triangle():
    A, C = np.array([[1.0, 2.0], [2.0, 3.0]]), np.array([[5.0]])
    B = np.array([[7.0, 8.0]])
    np.testing.assert_array_equal(from_lower([[A], [B, C]]), np.block([[A, B.T], [B, C]]))
    np.testing.assert_array_equal(
        from_lower([[A], [None, C]]), np.block([[A, 0 * B.T], [0 * B, C]])
    )
