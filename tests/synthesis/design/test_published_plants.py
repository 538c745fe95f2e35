"""Plants of published designs: frozen optima, and polynomials that stand for functions."""

import math
from itertools import product

import numpy as np
import pytest
from published_plants import DEGREE, grid_to_lft, lft_tutorial, spinning_disks, wu_1996
from scheduled_plants import frozen

from synthesis import hinf, output_feedback


def test_the_worst_frozen_optimum_of_the_disks_is_what_was_found_by_other_means():
    found = [
        hinf(*frozen(spinning_disks(0.0), *p)).optimum for p in product((0.0, 9.0), (0.0, 25.0))
    ]
    # four digits are known
    assert max(found) == found[-1] == pytest.approx(0.8149, abs=1e-4)


@pytest.mark.parametrize("half", [math.pi, math.pi / 4])
def test_polynomials_stand_for_sine_and_cosine(half):
    p = np.linspace(-half, half, 101)
    A = wu_1996(1.0, half).matrices(p).A
    # the remainder of an interpolation at the nodes of Chebyshev
    bound = 2 * (half / 2) ** (DEGREE + 1) / math.factorial(DEGREE + 1)
    assert np.abs(A[:, 0, 2] - np.cos(p)).max() <= bound + 1e-12
    assert np.abs(A[:, 1, 2] + np.sin(p)).max() <= bound + 1e-12


@pytest.mark.slow
def test_the_loop_of_the_disks_is_proven_near_what_its_design_promised():
    made = output_feedback(spinning_disks(math.inf))
    # the printed optimum has five digits, a design is within a thousandth of it or below
    assert made.optimum <= 1.1299 * 1.001
    certificate = made.certify(search=None)
    assert certificate.frozen <= certificate.gamma <= 1.05 * made.promised
    assert certificate.verify()


@pytest.mark.slow
def test_the_least_gain_of_the_lft_tutorial_is_no_more_than_the_printed_one():
    """LPVTools' documentation prints 2.1480, backed off by 1.2."""
    made = output_feedback(lft_tutorial(math.inf))
    # the least gain is found to 1e-4
    assert made.optimum == pytest.approx(1.7877, rel=2e-4)
    assert 1.2 * made.optimum <= 2.1480


@pytest.mark.slow
def test_the_loop_of_two_parameters_that_jump_is_proven_near_what_its_design_promised():
    made = output_feedback(grid_to_lft(math.inf))
    assert made.optimum <= 1.996
    certificate = made.certify(search=None)
    assert certificate.frozen <= certificate.gamma <= 1.05 * made.promised
    assert certificate.verify()
