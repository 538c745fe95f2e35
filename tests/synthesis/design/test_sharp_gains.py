"""Plants whose frozen optimum or whose gains have a narrow peak over p, and parameters that stand
still.
"""

import numpy as np
import pytest

from benchmarks.random_plants import random_plant
from symheli import Scheduling
from symheli.lpv import BSpline
from synthesis import output_feedback
from synthesis.certify.statement.outcome import Attempt
from synthesis.design.lpv.at_rest import at_rest
from synthesis.design.lpv.fitted import cut_to_serve
from synthesis.design.lpv.worst_optimum import worst_optimum

P = Scheduling("p", "1", -1.0, 1.0, rate=0.0)
WIDTH = 0.01
BACK_OFF = 1.02, 1.04, 1.1


def peak(p):
    return 1 / (1 + (p[:, :, None] / WIDTH) ** 2)


def near(within):
    return lambda fit, p: (np.abs(fit(p) - peak(p)) <= within).all(axis=(1, 2))


def test_a_spline_has_knots_where_it_would_not_serve():
    fit = cut_to_serve(peak, P, near(1e-3))
    fine = np.linspace(-1, 1, 4001)[:, None]
    assert np.abs(fit(fine) - peak(fine)).max() < 1.1e-3
    assert isinstance(fit.basis, BSpline)
    lengths = np.diff(fit.basis.breakpoints)
    assert lengths.max() >= 16 * lengths.min()


def test_what_no_spline_serves_comes_to_an_end():
    assert cut_to_serve(peak, P, lambda fit, p: np.zeros(len(p), bool)) is None


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1])
def test_a_narrow_peak_of_the_frozen_optimum_is_found(seed):
    """The plants were drawn with more values of p, and one where B2 or C2 passes zero."""
    drawn = random_plant(seed)
    found = worst_optimum(drawn.plant)
    assert found.level >= drawn.worst * (1 - 1e-3)
    assert found.level <= drawn.worst * (1 + 2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2])
def test_central_controllers_keep_their_level_between_the_points(seed):
    """Frozen gain recomputed where nothing was fitted or judged."""
    plant = random_plant(seed).plant.with_rate(0.0)
    worst = worst_optimum(plant)
    attempts: list[Attempt] = []
    found = next(at_rest(plant, worst, BACK_OFF, attempts))
    level = found.gamma / worst.level
    assert min(abs(level - factor) for factor in BACK_OFF) < 1e-12
    p = np.append(np.random.default_rng(seed).uniform(-1, 1, 40), worst.p)[:, None]
    plants, K = found.scaled.at(p), found.fit(p)
    n = plants.A.shape[-1]
    loop = plants.closed(K[:, :n, :n], K[:, :n, n:], K[:, n:, :n], K[:, n:, n:])
    w = np.logspace(-4, 4, 400)
    for A, B, C, D in zip(*loop, strict=True):
        assert np.linalg.eigvals(A).real.max() < 0
        G = C @ np.linalg.solve(1j * w[:, None, None] * np.eye(len(A)) - A, B) + D
        assert np.linalg.norm(G, 2, axis=(1, 2)).max() <= level * (1 + 1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1])
def test_plants_whose_gains_turn_sharply_are_settled_near_their_optimum(seed):
    drawn = random_plant(seed)
    made = output_feedback(drawn.plant, 0.0)
    assert drawn.worst * (1 - 2e-3) <= made.optimum <= 1.02 * drawn.worst
    assert made.promised <= 1.05 * made.optimum
