"""The implicit inflow: residual, branch, closed forms, derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from symheli.physics import inflow

A, SIGMA, ETA = 5.5, 0.0476, 0.9


def residual(lam, c0, c1, ct_max, mu2, mu_z):
    return 2 * ETA * lam * np.sqrt(mu2 + (lam - mu_z) ** 2) - np.clip(
        c0 - c1 * lam, -ct_max, ct_max
    )


def random_flow(seed, n=20000):
    rng = np.random.default_rng(seed)
    pitch, mu, mu_z = (
        rng.uniform(-0.2, 0.25, n),
        rng.uniform(0, 0.2, n),
        rng.uniform(-0.06, 0.04, n),
    )
    mu[: n // 10] = 0.0
    c0, c1 = inflow.thrust_line(pitch, mu**2, mu_z, A, SIGMA)
    return c0, np.full(n, c1), np.full(n, 0.0055), mu**2, mu_z


@pytest.mark.parametrize("rotor", ["main", "tail"])
def test_the_momentum_balance_holds_to_rounding_wherever_it_promises_accuracy(rotor):
    """Stalled or not, climbing, descending or reversed, with and without forward speed down to 1e-7
    of the tip speed.
    """
    lift_slope, solidity, top, pitches = {
        "main": (A, SIGMA, 0.0055, 0.3),
        "tail": (5.0, 0.142, 0.05, 0.6),
    }[rotor]
    rng, n = np.random.default_rng(1), 300_000
    pitch = rng.uniform(-pitches, pitches, n)
    mu = rng.uniform(0.0, 0.25, n) * rng.choice([0.0, 1e-6, 1e-3, 0.03, 0.1, 0.3, 1.0], n)
    mu_z = rng.uniform(-0.12, 0.1, n) * rng.choice([0.0, 1e-6, 1e-3, 0.1, 0.3, 1.0], n)
    c0, c1 = inflow.thrust_line(pitch, mu**2, mu_z, lift_slope, solidity)
    lam = inflow.solve(c0, np.full(n, c1), top, mu**2, mu_z, ETA)
    assert np.all(np.isfinite(lam))
    hover = np.sqrt(np.abs(np.clip(c0 - c1 * lam, -top, top)) / (2 * ETA))
    promised = inflow.vortex_ring(hover, mu**2, np.sign(c0) * mu_z) <= 0
    assert promised.mean() > 0.8
    # terms are at most 0.1: this is rounding. Without flow the guard under the root moves it by
    # 1e-10 of lam^2
    assert np.abs(residual(lam, c0, c1, top, mu**2, mu_z))[promised].max() < 1e-15


def test_axial_flow_agrees_with_the_quadratic_root():
    mu_z = np.linspace(-0.05, 0.0, 11)
    c0, c1 = inflow.thrust_line(0.1, 0.0, mu_z, A, SIGMA)
    lam = inflow.solve(c0, c1, 0.0055, np.zeros(11), mu_z, ETA)
    b = -2 * ETA * mu_z + c1  # 2 eta lam (lam - mu_z) = c0 - c1 lam
    np.testing.assert_allclose(lam, (-b + np.sqrt(b**2 + 8 * ETA * c0)) / (4 * ETA), rtol=1e-12)


def test_the_branch_followed_is_the_one_continued_from_hover():
    pitch, mu = 0.1, 0.0
    previous = None
    for mu_z in np.linspace(
        0.0, 0.06, 61
    ):  # descending ever faster: the hover branch grows continuously
        c0, c1 = inflow.thrust_line(pitch, mu**2, mu_z, A, SIGMA)
        lam = float(inflow.solve(c0, c1, 0.02, mu**2, mu_z, ETA))
        assert lam > mu_z
        assert previous is None or 0 < lam - previous < 2e-3
        previous = lam


def test_negative_thrust_is_the_mirror_image():
    c0, c1, top, mu2, mu_z = random_flow(2, 500)
    np.testing.assert_array_equal(
        inflow.solve(-c0, c1, top, mu2, -mu_z, ETA), -inflow.solve(c0, c1, top, mu2, mu_z, ETA)
    )


@pytest.mark.parametrize("pitch", [0.0, 0.1, 0.6])
def test_one_newton_step_from_the_root_carries_its_derivatives(pitch):
    import casadi

    x = casadi.SX.sym("x", 3)  # pitch, mu2, mu_z

    def arguments(z):
        c0, c1 = inflow.thrust_line(z[0], z[1], z[2], A, SIGMA)
        return c0, c1, 0.0055, z[1], z[2], ETA

    lam = casadi.SX.sym("lam")
    step = casadi.Function(
        "J", [x, lam], [casadi.jacobian(inflow.newton_step(lam, *arguments(x)), x)]
    )
    point = np.array([pitch, 0.004, -0.004])
    exact = np.array(step(point, float(inflow.solve(*arguments(point))))).ravel()
    # central differences of the solved root: truncation and rounding meet near 1e-7 for h = 1e-6
    h = 1e-6
    difference = [
        (
            float(inflow.solve(*arguments(point + h * e)))
            - float(inflow.solve(*arguments(point - h * e)))
        )
        / (2 * h)
        for e in np.eye(3)
    ]
    np.testing.assert_allclose(exact, difference, atol=2e-7)
