"""H2 designs: the norm by other routes, and that no other controller has a smaller one."""

from dataclasses import replace

import control
import numpy as np
import pytest
from design_plants import matrices, named, random_plant
from scipy import linalg

from symheli import LinearModel
from synthesis import h2
from synthesis.design.lti.h2 import h2_norm
from synthesis.design.plant.generalized import Generalized
from synthesis.designs import DesignStatus

SEEDS = range(1, 10, 2)


def size(P, K, dt):
    """Norm of the loop by its impulse response's energy: the observability Gramian, where the code
    takes the other.
    """
    A, B, C, D = P.closed(*K)
    if dt is None:
        W = linalg.solve_continuous_lyapunov(A.T, -C.T @ C)
        return np.sqrt(np.trace(B.T @ W @ B))
    W = linalg.solve_discrete_lyapunov(A.T, C.T @ C)
    return np.sqrt(np.trace(B.T @ W @ B) + np.sum(D**2))


@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("seed", SEEDS)
def test_no_controller_nearby_has_a_smaller_norm(seed, dt):
    model, u, y = random_plant(seed, dt, direct=dt is not None)
    design, P = h2(model, u, y), Generalized.of(model, u, y)
    K = matrices(design.controller)
    assert size(P, K, dt) == pytest.approx(design.hinf_norm, rel=1e-7)
    rng = np.random.default_rng(seed)
    for spread in np.repeat([1e-5, 1e-3, 1e-1], 20):
        near = [M + spread * np.abs(M).max(initial=0.1) * rng.standard_normal(M.shape) for M in K]
        if dt is None:
            near[3] = K[3]  # another one makes the norm infinite
        poles = np.linalg.eigvals(P.closed(*near)[0])
        if np.all(poles.real < 0) if dt is None else np.all(np.abs(poles) < 1):
            assert size(P, near, dt) >= design.hinf_norm * (1 - 1e-7)


@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_transposed_plant_has_the_same_norm(seed, dt):
    model, u, y = random_plant(seed, dt, direct=dt is not None)
    dual = named(*Generalized.of(model, u, y).dual.joined, len(y), len(u), dt)
    assert h2(*dual).hinf_norm == pytest.approx(h2(model, u, y).hinf_norm, rel=1e-7)


@pytest.mark.parametrize("seed", SEEDS)
def test_slicot_has_the_same_controller(seed):
    pytest.importorskip("slycot")
    model, u, y = random_plant(seed, direct=False)
    P = Generalized.of(model, u, y)
    K = control.h2syn(control.ss(*P.joined), len(y), len(u))
    ours = h2(model, u, y)
    omega = np.geomspace(0.01, 100, 30)
    np.testing.assert_allclose(
        np.moveaxis(K(1j * omega, squeeze=False), -1, 0),
        ours.controller.frequency_response(omega),
        atol=1e-6 * np.abs(ours.controller.frequency_response(omega)).max(),
    )


def test_sampled_fast_the_norm_is_that_of_the_continuous_plant():
    """White noise of unit intensity is noise of variance 1/dt held for dt; the bilinear rule is
    of second order.
    """
    A, C = np.array([[0.0, 1.0], [-4.0, -0.4]]), np.array([[1.0, 0], [0, 0], [0, 1.0]])
    D = np.array([[0, 0, 0], [0, 0, 1.0], [0, 0.5, 0]])
    plant = named(A, [[0, 0, 0], [1.0, 0, 1.0]], C, D, 1, 1)
    continuous = h2(*plant)
    errors = []
    for dt in (2e-2, 1e-2, 5e-3):
        eye = np.eye(2)
        step = np.linalg.solve(eye - A * dt / 2, eye + A * dt / 2)
        into = np.linalg.solve(eye - A * dt / 2, np.array([[0, 0, 0], [1.0, 0, 1.0]]) * dt)
        noise = np.array([dt**-0.5, dt**-0.5, 1.0])
        sampled = named(step, into * noise, C, D * noise, 1, 1, dt)
        errors.append(abs(h2(*sampled).hinf_norm / continuous.hinf_norm - 1))
    assert errors[2] < 0.1 * errors[0]


def test_a_static_gain_takes_away_the_direct_way():
    """z = u + w, y = x + w: u = -y leaves z = -x + ..., any other gain leaves white noise."""
    design = h2(*named([[-1]], [[1, 1]], [[0], [1]], [[1, 1], [1, 0]], 1, 1))
    assert design.controller.D[0, 0] == pytest.approx(-1)
    assert np.isfinite(design.hinf_norm)


def test_white_noise_that_comes_through_is_said():
    plant = named([[-1]], [[1, 0, 1]], [[1], [0], [1]], [[1, 0, 0], [0, 0, 1], [0, 1, 0]], 1, 1)
    design = h2(*plant)
    assert design.status is DesignStatus.IMPOSSIBLE
    assert design.controller is None
    assert "infinite variance" in design.reasons[0]


def mean_square(A, B, C, D, dt):
    """Of the outputs in white noise: the integral of the squared response over all frequencies, by
    the trapezoidal rule on the circle, which converges exponentially.
    """
    poles = np.abs(np.linalg.eigvals(A))
    pace = np.exp(np.log(poles).mean()) if dt is None else 1.0
    found = [np.inf]
    for count in 2 ** np.arange(9, 17):
        angle = np.pi * (2 * np.arange(count) + 1) / count
        if dt is None:
            omega = pace * np.tan(angle / 2)
            at, weight = 1j * omega, 0.5 * pace * (1 + np.tan(angle / 2) ** 2)
        else:
            at, weight = np.exp(1j * angle), np.ones(count)
        G = C @ np.linalg.solve(at[:, None, None] * np.eye(len(A)) - A, B) + D
        found.append(float(np.mean(weight * (np.abs(G) ** 2).sum(axis=(1, 2)))))
        if abs(found[-1] - found[-2]) <= 1e-11 * found[-1]:
            return found[-1]
    raise AssertionError(f"the integral does not converge: {found}")


@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("spread", [3, 6])
def test_the_norm_is_that_of_the_loop_in_any_units_of_the_states(seed, dt, spread):
    """Units from 10^-spread to 10^spread; the integral is taken of the loop in plain units."""
    model, u, y = random_plant(seed, dt, direct=dt is not None)
    units = 10.0 ** np.random.default_rng(seed).uniform(-spread, spread, len(model.A))
    other = replace(
        model, A=model.A * units / units[:, None], B=model.B / units[:, None], C=model.C * units
    )
    plain, far = h2(model, u, y), h2(other, u, y)
    A, B, C, D = Generalized.of(model, u, y).closed(*matrices(plain.controller))
    truth = np.sqrt(mean_square(A, B, C, D if dt else 0.0 * D, dt))
    assert plain.hinf_norm == pytest.approx(truth, rel=1e-8)
    assert far.hinf_norm == pytest.approx(truth, rel=1e-8)


@pytest.mark.parametrize("apart", [1e-15, 1e-12, 1e-10, 1e-8, 1e-6, 1e-5, 1e-4, 1e-2])
def test_what_all_but_cancels_is_never_told_too_small(apart):
    """Two modes, 1e9 (e^-t - e^-at), whose squares are 1e36 in size."""
    a = 1.0 + apart
    names = ["x1", "x2"], ["w"], ["z"]
    A, B, C = [[-1.0, 0.0], [0.0, -a]], [[1e9], [1e9]], [[1e9, -1e9]]
    found = h2_norm(LinearModel(A, B, C, [[0.0]], *names))
    truth = 1e18 * (a - 1.0) / np.sqrt(2 * a * (1 + a))
    no_longer = np.finfo(np.longdouble).eps > 1e-18  # a processor without more digits
    assert truth * (1 - 1e-6) <= found <= truth + 1e11 or (no_longer and np.isnan(found))
    assert apart < 1e-3 or found == pytest.approx(truth, rel=1e-9)
