"""The exact models between their corners."""

import numpy as np
import pytest

import synthesis
from studies.loops.exact_lateral import ExactLateral
from symheli import UncertainStateSpace
from synthesis.forms import Spline


@pytest.fixture(scope="module")
def models(ideal):
    return ExactLateral.of(ideal)


@pytest.mark.parametrize("dt", [None, 0.02])
def test_between_the_nodes_the_exact_models_are_met(models, dt):
    loop = models.loop(dt=dt)
    # degree 4 on at most 3 m/s; entries are up to 410
    assert np.abs(models.missed(loop)).max() < 1e-5


def test_the_models_jump_where_the_fin_stalls(models):
    stall = models.between.kinks["fin stalls"][0]
    before, after = (models.loop().at(stall + side).A for side in (-1e-6, 1e-6))
    assert np.abs(after - before).max() > 0.05


@pytest.mark.slow
def test_the_covered_gain_is_hardly_above_that_of_the_polynomials(ideal):
    models = ExactLateral.of(ideal, 5.0, 8.0)
    loop = models.loop()
    plain = synthesis.l2_gain(loop, 1.0, form=Spline(segments=2), search=None)
    around = UncertainStateSpace.covering(loop, models.missed(loop))
    covered = synthesis.l2_gain(around, 1.0, form=Spline(segments=2), search=None)
    assert plain.frozen < covered.gamma < 1.01 * plain.gamma
    assert covered.verify(rigorous=True)
