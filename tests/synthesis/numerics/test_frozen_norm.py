"""The H-infinity norm of frozen models keeps its promise of 1e-8 where damping is light."""

import math

import mpmath
import numpy as np
import pytest
from models import lag, random_stable
from scipy.linalg import block_diag

from symheli import LPVStateSpace, Scheduling
from synthesis import frozen_gain, l2_gain
from synthesis.numerics.linear.norm import gain_at_poles, norm


def lightly_damped(seed, decades=0.7, least=-3.5):
    """Modes of nearly equal peaks, damping 10^least .. 0.1, mixed, in units that differ by up to
    1e6.
    """
    rng = np.random.default_rng(seed)
    m = rng.integers(1, 6)
    w, z = 10 ** rng.uniform(-decades, decades, m), 10 ** rng.uniform(least, -1, m)
    A = block_diag(
        *(
            v * np.array([[-d, np.sqrt(1 - d**2)], [-np.sqrt(1 - d**2), -d]])
            for v, d in zip(w, z, strict=True)
        )
    )
    T = (np.eye(2 * m) + 0.3 * rng.standard_normal((2 * m, 2 * m))) * 10 ** rng.uniform(
        -3, 3, 2 * m
    )
    nu, ny = rng.integers(1, 4, 2)
    size = np.repeat(np.sqrt(z * w), 2)
    B, C = rng.standard_normal((2 * m, nu)) * size[:, None], rng.standard_normal((ny, 2 * m)) * size
    D = rng.standard_normal((ny, nu)) * (rng.random() < 0.5)
    return np.linalg.solve(T, A @ T), np.linalg.solve(T, B), C @ T, D


def dense(A, B, C, D):
    """The largest gain by a grid that is dense around every pole and refined around its five
    highest points.
    """

    def gains(omega):
        pencil = 1j * omega[:, None, None] * np.eye(len(A)) - A
        return np.linalg.norm(
            C @ np.linalg.solve(pencil, np.broadcast_to(B, (len(omega), *B.shape))) + D,
            2,
            axis=(1, 2),
        )

    around = np.sinh(np.linspace(-10, 10, 301))
    poles = np.linalg.eigvals(A)
    points = np.unique(
        np.abs(
            np.concatenate([[0.0], *(p.imag + abs(p.real) * around for p in poles if p.imag >= 0)])
        )
    )
    values = gains(points)
    best = max(float(values.max()), float(np.linalg.norm(D, 2)))
    tops = [k for k in range(1, len(points) - 1) if values[k - 1] <= values[k] >= values[k + 1]]
    for k in sorted(tops, key=lambda k: -values[k])[:5]:
        low, high = points[k - 1], points[k + 1]
        for _ in range(6):
            finer = np.linspace(low, high, 21)
            top = int((found := gains(finer)).argmax())
            best = max(best, float(found[top]))
            low, high = finer[max(top - 1, 0)], finer[min(top + 1, 20)]
    return best


def agree(seeds):
    for seed in seeds:
        model = lightly_damped(seed)
        # the grid's own responses are exact to 1e-9 at this damping; the norm may be higher where
        # the grid missed the top
        assert norm(*model)[0] == pytest.approx(dense(*model), rel=1.1e-8), seed


@pytest.mark.slow
def test_the_norm_of_lightly_damped_models_is_that_of_a_dense_grid():
    agree(range(60))


@pytest.mark.slow
def test_the_norms_of_more_lightly_damped_models_are_those_of_dense_grids():
    agree(range(60, 160))


def exact_gain(model, omega):
    """The gain at omega in 40 digits."""
    with mpmath.workdps(40):
        A, B, C, D = (mpmath.matrix(M.tolist()) for M in model)
        G = C * (mpmath.inverse(mpmath.mpc(0, 1) * omega * mpmath.eye(A.rows) - A) * B) + D
        return mpmath.sqrt(max(mpmath.eigh(G.H * G, eigvals_only=True)))


@pytest.mark.parametrize("seed", [5, 33, 89, 126])
def test_stiff_models_of_the_lightest_damping_are_right_in_forty_digits(seed):
    """Frequencies four decades apart, damping 1e-6: one response in doubles is off by 1e-7 of the
    peak, by rounding alone.
    """
    model = lightly_damped(seed, decades=2, least=-6)
    gain, omega = norm(*model)
    width = float(np.abs(np.linalg.eigvals(model[0]) - 1j * omega).min())
    around = max(
        exact_gain(model, mpmath.mpf(omega) + width * mpmath.mpf(x))
        for x in np.linspace(-0.01, 0.01, 9)
    )
    assert gain == pytest.approx(float(around), rel=1e-8)


@pytest.mark.parametrize("seed", range(12))
def test_a_sampled_model_has_the_norm_of_its_bilinear_twin(seed):
    A, B, C, D = lightly_damped(seed)
    h = 0.05  # z = (1 + h s)/(1 - h s)
    inverse = np.linalg.inv(np.eye(len(A)) - h * A)
    sampled = (
        inverse @ (np.eye(len(A)) + h * A),
        math.sqrt(2 * h) * inverse @ B,
        math.sqrt(2 * h) * C @ inverse,
        D + h * C @ inverse @ B,
    )
    # what A lost when it was made discrete, by the damping of 1e-3 of a sample
    assert norm(*sampled, dt=0.1)[0] == pytest.approx(norm(A, B, C, D)[0], rel=1e-7)


@pytest.mark.slow(but="0.001")
@pytest.mark.parametrize("dt", [1e-3, 1e-5, 1e-7])
def test_the_frozen_gain_of_a_finely_sampled_model_is_that_of_the_continuous_one(dt):
    lpv = random_stable(3)
    assert frozen_gain(lpv.discretize(dt)).gain == pytest.approx(
        frozen_gain(lpv).gain, rel=2 * dt + 1e-7
    )


def test_the_norm_does_not_depend_on_the_units_of_states():
    A, B, C, D = lightly_damped(5)
    T = 10.0 ** np.random.default_rng(0).integers(-12, 13, len(A))
    assert norm(T[:, None] * A / T, T[:, None] * B, C / T, D)[0] == pytest.approx(
        norm(A, B, C, D)[0], rel=1e-8
    )


@pytest.mark.slow
@pytest.mark.parametrize("box", [False, True])
def test_a_gain_that_is_loose_for_its_sample_period_says_so(box):
    """A gain of 1 is proven within a percent where a sample is 1e-3 s; at 1e-7 s the margins of the
    LMIs are larger than its decay.
    """
    for dt in (0.1, 1e-3, 1e-7):
        sampled = lag().discretize(dt)
        proven = l2_gain(sampled.to_lft() if box else sampled, search=None)
        said = any("the bound may be loose for that alone" in line for line in proven.hypotheses)
        assert said or proven.gamma <= 1.01 * proven.lower
        assert not (said and dt > 0.01)


@pytest.mark.parametrize("dt", [None, 0.1])
def test_gains_at_poles_are_below_the_norm_and_meet_it_at_a_light_damping(dt):
    stack = [random_stable(seed, dt=dt).matrices(0.5) for seed in range(8)]
    rough = gain_at_poles(*(np.stack(M) for M in zip(*stack, strict=True)), dt)
    exact = np.array([norm(*each, dt)[0] for each in stack])
    assert np.all(rough <= exact * (1 + 1e-9))
    assert np.all(rough >= 0.3 * exact)
    # x'' + 2 d x' + x = u has a peak of 1/(2 d sqrt(1 - d^2)) at its resonance
    d = 1e-3
    one = LPVStateSpace.polynomial(
        [[[0.0, 1.0], [-1.0, -2 * d]]],
        [[[0.0], [1.0]]],
        [[[1.0, 0.0]]],
        [[[0.0]]],
        Scheduling("p", "1", 0.0, 1.0),
    )
    assert gain_at_poles(*one.matrices([0.5]))[0] == pytest.approx(
        1 / (2 * d * math.sqrt(1 - d**2)), rel=1e-9
    )
    unstable = np.array([[[-1.0]], [[0.1]]])
    some = np.ones((2, 1, 1))
    assert gain_at_poles(unstable, some, some, some).tolist() == [0.0, math.inf]


def test_the_frozen_gain_over_a_box_is_the_worst_corner():
    """1/(1 + p)(2 - q): 1/((1)(2 - 1)) at p = 0, q = 1; as an LFT the same."""
    p, q = (Scheduling(name, "1", 0.0, 1.0) for name in ("p", "q"))
    one, two = p.symbol, q.symbol
    model = LPVStateSpace.from_expressions(
        [[-(1 + one), 0], [1, -(2 - two)]], [[1], [0]], [[0, 1]], [[0]], [p, q]
    )
    for each in (model, model.to_lft()):
        found = frozen_gain(each)
        assert found.gain == pytest.approx(1.0, rel=1e-8)
        assert found.p == pytest.approx((0.0, 1.0))
        assert found.omega == 0.0
