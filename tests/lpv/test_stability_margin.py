"""The margin b(P, C) against closed forms, another norm, and what it promises."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from symheli import LinearModel
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import nu_gap, stability_margin
from symheli.lpv.stability_margin import as_controller, closed_loop
from symheli.values import signals
from synthesis.numerics.linear.norm import norm


def model(A, B, C, D, dt=0.1, inputs=("u",), outputs=("y",)):
    names = signals([f"x{i}" for i in range(len(A))])
    return LinearModel(A, B, C, D, names, signals(inputs), signals(outputs), dt=dt)


def gain(k):
    return model(np.array([[0.5]]), np.zeros((1, 1)), np.zeros((1, 1)), np.array([[k]]))


def two_by_two(seed):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((4, 4))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    B, C = rng.standard_normal((4, 2)), rng.standard_normal((2, 4))
    return model(A, B, C, np.zeros((2, 2)), inputs=("u", "w"), outputs=("y", "z"))


GAINS = {("u", "y"): 0.02, ("w", "z"): -0.03}


@pytest.mark.parametrize(("k", "c"), [(0.5, -3.0), (2.0, 0.1), (1.0, -1.0)])
def test_two_static_graphs_stand_at_their_angle(k, c):
    """1/b is the norm of [k; 1][-c, 1] / (1 - c k)."""
    expected = abs(1 - c * k) / np.sqrt((1 + k**2) * (1 + c**2))
    assert stability_margin(gain(k), {("u", "y"): c}) == pytest.approx(expected, rel=1e-12)


def test_it_is_the_norm_that_level_sets_find():
    """By Hamiltonian level sets, without a grid: `synthesis.numerics.linear.norm.norm`."""
    plant = two_by_two(0)
    K = np.diag([0.02, -0.03])
    # from (v, w) in y = P (u + w) + v, u = K (y) to (y, u): [P; I] (I - K P)^-1 [-K, I] up to signs
    A = plant.A + plant.B @ K @ plant.C
    B = np.hstack([-plant.B @ K, plant.B])
    C = np.vstack([plant.C, K @ plant.C])
    D = np.block([[np.zeros((2, 2)), np.zeros((2, 2))], [-K, np.eye(2)]])
    expected = 1 / norm(A, B, C, D, plant.dt)[0]
    assert stability_margin(plant, GAINS) == pytest.approx(expected, rel=1e-6)


def test_continuous_loops_have_the_margins_of_their_closed_forms():
    """1/s with u = -y: 1/sqrt(2). 1/(s - 1) with u = -(1 + sqrt(2)) y, its best controller:
    sin(pi/8).
    """
    for pole, k, b in ((0.0, -1.0, np.sqrt(0.5)), (1.0, -1 - np.sqrt(2.0), np.sin(np.pi / 8))):
        plant = model([[pole]], [[1.0]], [[1.0]], [[0.0]], dt=None)
        assert stability_margin(plant, {("u", "y"): k}) == pytest.approx(b, rel=1e-9)


def test_a_loop_that_is_unstable_has_none():
    integrator = model([[1.0]], [[1.0]], [[1.0]], [[0.0]])
    assert stability_margin(integrator, {("u", "y"): 0.1}) == 0.0
    assert stability_margin(integrator, {("u", "y"): -0.1}) > 0.0


def test_no_plant_closer_than_the_margin_is_lost():
    """Vinnicombe's theorem, on plants in every direction."""
    plant = two_by_two(0)
    b, rng, near = stability_margin(plant, GAINS), np.random.default_rng(0), 0
    for size in (0.001, 0.003, 0.01, 0.03) * 10:
        other = replace(plant, A=plant.A + size * rng.standard_normal((4, 4)))
        if nu_gap(plant, other) < b:
            near += 1
            poles = np.linalg.eigvals(closed_loop(other, as_controller(GAINS, other))[0])
            assert np.abs(poles).max() < 1
    assert near > 5  # the promise was put to the test


def test_a_controller_with_states_counts_as_the_gain_it_is_at_every_frequency():
    """Poles far inside the circle, hidden from the output: the same static controller."""
    plant = two_by_two(0)
    fast = model(
        [[0.0]], [[0.0, 0.0]], [[0.0], [0.0]], np.diag([0.02, -0.03]), 0.1, ("y", "z"), ("u", "w")
    )
    assert stability_margin(plant, fast) == pytest.approx(stability_margin(plant, GAINS), rel=1e-6)
    swapped = fast.select(inputs=("z", "y"), outputs=("w", "u"))
    assert stability_margin(plant, swapped) == pytest.approx(
        stability_margin(plant, fast), rel=1e-9
    )


def test_what_cannot_be_closed_is_refused():
    with pytest.raises(InputError, match="sample period"):
        stability_margin(replace(gain(1.0), dt=None), gain(1.0))
    with pytest.raises(InputError, match="sample period"):
        stability_margin(gain(1.0), replace(gain(1.0), dt=0.2))
    with pytest.raises(UnknownNameError):
        stability_margin(gain(1.0), {("v", "y"): -1.0})
