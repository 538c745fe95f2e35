"""Least level of the two inequalities: from another start, or given up above a level."""

import numpy as np
import pytest
from scheduled_plants import spring

from synthesis.design.lpv.existence import FINE_TOLERANCE, MATRIX_BOUNDS, Existence
from synthesis.design.lpv.output_feedback import USUAL
from synthesis.design.lpv.scaled_plant import scaled_plant_of
from synthesis.numerics.program.bases import candidates


def program(rate=0.5):
    plant = spring(rate)
    (shape, *_) = candidates(plant.parameters, None, None, False, [True], 2)
    return Existence(scaled_plant_of(plant, 1.0), shape.X, shape.Y)


@pytest.fixture(scope="module")
def least():
    return program().least_gamma(USUAL)


def test_a_program_with_more_points_starts_near_its_own_solution(least):
    """Two starts, one level; from the point of fewer points in a fraction of the steps."""
    more = program()
    first = more._least(USUAL, None)
    middles = 0.5 * (more.points[1:] + more.points[:-1])
    more.points = np.concatenate([more.points, middles])
    cold, warm = (more._least(USUAL, start) for start in (None, first.early))
    assert warm.gamma == pytest.approx(cold.gamma, rel=2 * USUAL.tolerance)
    steps = [int(found.message.split(" after ")[1].split()[0]) for found in (cold, warm)]
    assert steps[1] < 0.7 * steps[0]


@pytest.mark.parametrize("share", [0.5, 0.9, 0.99])
def test_a_level_is_given_up_where_the_multipliers_exclude_it(least, share):
    found = program().least_gamma(USUAL, share * least.gamma)
    assert found.gamma == np.inf
    assert share * least.gamma < found.lower <= least.gamma * (1 + FINE_TOLERANCE)
    assert "not below" in found.message


def test_a_level_that_can_be_reached_is_not_given_up(least):
    found = program().least_gamma(USUAL, 1.01 * least.gamma)
    assert found.gamma == pytest.approx(least.gamma, rel=2 * FINE_TOLERANCE)


def test_larger_bounds_on_both_matrices_are_worth_nothing_here(least):
    solved = program()
    found = solved.least_gamma(USUAL)
    assert not solved.could_fall(found, MATRIX_BOUNDS[-1], 0.995, USUAL)


def test_small_bounds_on_both_matrices_could_be_worth_more():
    solved = program()
    solved.largest = 2.0
    found = solved.least_gamma(USUAL)
    assert not np.isfinite(found.gamma) or solved.could_fall(found, 1e5, 0.995, USUAL)
