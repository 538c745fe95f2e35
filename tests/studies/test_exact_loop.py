"""The exact models between their corners."""

import numpy as np
import pytest

import synthesis
from studies.loops.exact_lateral import ExactLateral
from symheli.lpv import Patches
from synthesis import Relaxation
from synthesis.cover import Remainder, covered_gain


@pytest.fixture(scope="module")
def models(ideal):
    return ExactLateral.of(ideal)


def test_patches_give_back_polynomials_that_jump():
    basis = Patches(2, (0.0, 1.0, 4.0))
    p = basis.points(5)
    values = np.where(p < 1, 1 + p**2, 7 - p)
    np.testing.assert_allclose(basis(p) @ basis.fit(p, values), values, atol=1e-12)
    sides = [piece.bernstein.T @ basis.fit(p, values) for piece in basis.pieces()]
    # Bernstein coefficients begin and end with the values at the ends: 2 on one side of the jump, 6
    # on the other
    assert (sides[0][-1], sides[1][0]) == pytest.approx((2.0, 6.0))


@pytest.mark.parametrize("dt", [None, 0.02])
def test_between_the_nodes_the_exact_models_are_met(models, dt):
    loop = models.loop(dt=dt)
    # degree 4 on at most 3 m/s; entries are up to 410
    assert np.abs(models.missed(loop)).max() < 1e-5


def test_the_models_jump_where_the_fin_stalls(models):
    stall = models.between.kinks["fin stalls"][0]
    before, after = (models.loop().at(stall + side).A for side in (-1e-6, 1e-6))
    assert np.abs(after - before).max() > 0.05


def test_the_covered_gain_is_hardly_above_that_of_the_polynomials(ideal):
    models = ExactLateral.of(ideal, 5.0, 8.0)
    loop = models.loop()
    plain = synthesis.l2_gain(loop, 1.0, relaxation=Relaxation(segments=(2,)), search=None)
    covered, certificate = covered_gain(
        loop, Remainder.of(models.missed(loop)), 1.0, Relaxation(segments=(2,)), plain.gamma
    )
    assert plain.frozen < covered < 1.01 * plain.gamma
    assert certificate.verify(rigorous=True)
