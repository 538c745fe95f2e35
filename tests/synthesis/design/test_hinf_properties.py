"""H-infinity designs of random plants: what the theory promises of each, by other routes."""

import math

import control
import numpy as np
import pytest
from design_plants import matrices, named, random_plant
from scipy import linalg

from symheli import LinearModel
from synthesis import hinf
from synthesis.design.lti.central import Obstacle, RiccatiTrial
from synthesis.design.lti.hinf import ROUGH_ACCURACY, _smallest
from synthesis.design.plant.generalized import Generalized, continuous_plant, sampled_controller
from synthesis.numerics.linear.norm import norm, to_continuous

SEEDS = range(1, 12, 2)


def generalized(plant):
    return Generalized.of(*plant)


@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_loop_keeps_its_level_on_a_grid_of_frequencies(seed, dt):
    """The response of the loop made of the model and the controller alone, by `control`."""
    model, u, y = random_plant(seed, dt)
    design = hinf(model, u, y)
    K, P = design.controller, generalized((model, u, y))
    loop = control.ss(*P.joined, dt or 0).lft(control.ss(*matrices(K), dt or 0))
    assert np.all(np.real(loop.poles()) < 0 if dt is None else np.abs(loop.poles()) < 1)
    omega = np.geomspace(1e-3, 1e3, 400) if dt is None else np.linspace(0, math.pi / dt, 400)
    gains = np.linalg.norm(
        np.moveaxis(loop(1j * omega if dt is None else np.exp(1j * omega * dt)), -1, 0),
        2,
        axis=(1, 2),
    )
    assert gains.max() <= design.hinf_norm * (1 + 1e-6)  # gains to 1e4 raise the rounding of both
    assert gains.max() >= 0.9 * design.hinf_norm  # the grid sees most of the peak
    assert design.optimum <= design.hinf_norm
    assert K.inputs == tuple(y)
    assert K.outputs == tuple(u)


@pytest.mark.parametrize("seed", [1, 5, 8, 9, 10, 11])
def test_no_controller_undercuts_the_optimum(seed):
    """The LMIs of Gahinet and Apkarian (1994), of which none of the two Riccati equations is a
    part.
    """
    model, u, y = random_plant(seed)
    P = generalized((model, u, y))
    assert by_lmi(P) == pytest.approx(hinf(model, u, y).optimum, rel=1e-5)  # Clarabel's accuracy


def by_lmi(P):
    """The smallest gamma with R, S and the projected bounded real inequalities."""
    import cvxpy as cp

    n, nw, nz = len(P.A), P.B1.shape[1], len(P.C1)
    R, S = (cp.Variable((n, n), symmetric=True) for _ in range(2))
    gamma = cp.Variable()
    NR, NS = (
        linalg.null_space(np.hstack([P.B2.T, P.D12.T])),
        linalg.null_space(np.hstack([P.C2, P.D21])),
    )
    NR = linalg.block_diag(NR, np.eye(nw))
    NS = linalg.block_diag(NS, np.eye(nz))
    first = cp.bmat(
        [
            [P.A @ R + R @ P.A.T, R @ P.C1.T, P.B1],
            [P.C1 @ R, -gamma * np.eye(nz), P.D11],
            [P.B1.T, P.D11.T, -gamma * np.eye(nw)],
        ]
    )
    second = cp.bmat(
        [
            [P.A.T @ S + S @ P.A, S @ P.B1, P.C1.T],
            [P.B1.T @ S, -gamma * np.eye(nw), P.D11.T],
            [P.C1, P.D11, -gamma * np.eye(nz)],
        ]
    )

    def symmetric(M):
        return 0.5 * (M + M.T)

    problem = cp.Problem(
        cp.Minimize(gamma),
        [
            symmetric(NR.T @ first @ NR) << 0,
            symmetric(NS.T @ second @ NS) << 0,
            cp.bmat([[R, np.eye(n)], [np.eye(n), S]]) >> 0,
        ],
    )
    problem.solve(solver=cp.CLARABEL)
    return float(gamma.value)


@pytest.mark.slow(but=("3", "7"))
@pytest.mark.parametrize("seed", SEEDS)
def test_random_controllers_nearby_do_not_undercut_the_optimum(seed):
    design_of = random_plant(seed)
    design, P = hinf(*design_of), generalized(design_of)
    rng = np.random.default_rng(seed)
    for size in np.repeat([1e-4, 1e-2, 0.3], 20):
        K = [M + size * rng.standard_normal(M.shape) for M in matrices(design.controller)]
        assert norm(*P.closed(*K))[0] >= design.optimum * (1 - 1e-7)


@pytest.mark.slow(only=("1", "7"))
@pytest.mark.parametrize("seed", SEEDS)
def test_a_sampled_plant_has_the_optimum_of_its_bilinear_image(seed):
    model, u, y = random_plant(seed, 0.1)
    image = named(*to_continuous(*generalized((model, u, y)).joined), len(u), len(y))
    assert hinf(model, u, y).optimum == pytest.approx(hinf(*image).optimum, rel=1e-7)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_bilinear_image_of_a_loop_has_its_norm(seed):
    """Plant there, controller back: the loops are the same."""
    plant = random_plant(seed, 0.1)
    P = generalized(plant)
    K = hinf(*plant).controller
    image = to_continuous(*matrices(K))
    again = sampled_controller(*image)
    for M, N in zip(again, matrices(K), strict=True):
        # a pole of the controller near z = -1 raises the rounding
        np.testing.assert_allclose(M, N, atol=1e-6 * (1 + np.abs(N).max()))
    assert norm(*continuous_plant(P).closed(*image))[0] == pytest.approx(
        norm(*P.closed(*matrices(K)), 0.1)[0], rel=1e-5
    )


@pytest.mark.slow(only=("1-None", "1-0.1", "7-0.1"))
@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_transposed_plant_has_the_same_optimum(seed, dt):
    model, u, y = random_plant(seed, dt)
    dual = named(*generalized((model, u, y)).dual.joined, len(y), len(u), dt)
    assert hinf(*dual).optimum == pytest.approx(hinf(model, u, y).optimum, rel=1e-6)


@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("seed", SEEDS)
def test_controllers_follow_the_coordinates_of_the_plant(seed, dt):
    """With x = T v the state of the controller is T times the other: an estimate of the plant's,
    which is what lets neighbours be interpolated.
    """
    model, u, y = random_plant(seed, dt)
    n = len(model.A)
    T = np.eye(n) + 0.3 * np.random.default_rng(seed).standard_normal((n, n))
    turned = LinearModel(
        np.linalg.solve(T, model.A @ T),
        np.linalg.solve(T, model.B),
        model.C @ T,
        model.D,
        model.states,
        model.inputs,
        model.outputs,
        dt,
    )
    level = 1.3 * hinf(model, u, y).optimum
    K, L = (hinf(m, u, y, gamma=level).controller for m in (model, turned))
    for M, N in ((K.A, T @ L.A @ np.linalg.inv(T)), (K.B, T @ L.B), (K.C @ T, L.C), (K.D, L.D)):
        np.testing.assert_allclose(M, N, atol=1e-6 * (1 + np.abs(M).max()))
    assert K.states[0] == "x1_estimate"


@pytest.mark.parametrize("seed", range(6))
def test_slicot_reaches_no_lower_level(seed):
    """`sb10fd` at the same level has the same controller as a transfer function; below the optimum
    it has none that keeps it.
    """
    slycot = pytest.importorskip("slycot")
    model, u, y = random_plant(seed)
    P = generalized((model, u, y))
    A, B, C, D = P.joined
    sizes = len(A), B.shape[1], len(C), len(u), len(y)
    optimum = hinf(model, u, y).optimum
    K = hinf(model, u, y, gamma=1.5 * optimum).controller
    theirs = slycot.sb10fd(*sizes, 1.5 * optimum, A, B, C, D)[:4]
    other = LinearModel(*theirs, K.states, K.inputs, K.outputs)
    omega = np.geomspace(0.01, 100, 50)
    ours = K.frequency_response(omega)
    np.testing.assert_allclose(
        other.frequency_response(omega), ours, atol=1e-6 * np.abs(ours).max()
    )
    try:
        below = slycot.sb10fd(*sizes, 0.999 * optimum, A, B, C, D)[:4]
    except slycot.exceptions.SlycotError:
        return
    assert norm(*P.closed(*below))[0] >= optimum * (1 - 1e-7)


def test_a_level_at_the_feedthrough_is_bracketed_by_what_was_tried():
    """The Riccati equations have a solution at `high` and none at exp(log(high)), one bit below."""
    feedthrough = next(
        D for D in np.arange(2.0, 3.0, 0.01) if math.exp(math.log(D * (1 + 1e-6))) < D * (1 + 1e-6)
    )
    high = feedthrough * (1 + 1e-6)

    class OnTheEdge:
        def least(self):
            return feedthrough

        def trial(self, gamma):
            reached = gamma >= high
            obstacle = None if reached else Obstacle.CONTROL
            return RiccatiTrial(gamma, obstacle, 1.0 if reached else -1.0)

    found = _smallest(OnTheEdge(), 1.0, ROUGH_ACCURACY)
    assert found == (high, Obstacle.CONTROL)


def test_python_control_finds_a_controller_no_better():
    """`hinfsyn` judged by the loop it makes: the level it reports here is one that no controller
    reaches, its own included.
    """
    pytest.importorskip("slycot")
    model, u, y = random_plant(8)
    P = generalized((model, u, y))
    K = control.hinfsyn(control.ss(*P.joined), len(y), len(u))[0]
    assert norm(*P.closed(K.A, K.B, K.C, K.D))[0] >= hinf(model, u, y).optimum * (1 - 1e-7)
