"""Gains by multipliers: published numbers, truths by other routes, and what is refused.

The published loops are those of the examples and tests of iqc-beta (github.com/iqcbeta), and of
Kothare et al., Automatica 35 (1999); typed in as their sources have them.
"""

import math
from functools import cache

import numpy as np
import pytest
from scipy import linalg, optimize

from symheli import LinearModel
from symheli.errors import InputError, UnknownNameError
from synthesis.robust import (
    DelayBlock,
    DynamicBlock,
    OwnMultiplier,
    ParameterBlock,
    StaticBlock,
    multiplier_gain,
)
from synthesis.robust.multipliers.delays import KAPPA, phase, weight


def loop(A, B, C, D, inputs, outputs, dt=None):
    names = [f"x{i}" for i in range(len(A))]
    return LinearModel(A, B, C, D, names, inputs, outputs, dt)


def around(A, b, c, sign=1.0):
    """v = sign G (w + f), y = v, of one function."""
    b, c = sign * np.reshape(b, (-1, 1)), np.reshape(c, (1, -1))
    return loop(A, np.hstack([b, b]), np.vstack([c, c]), np.zeros((2, 2)), ["w", "f"], ["v", "y"])


def turning(damping, frequency, gain=1.0):
    return [[-damping, -frequency], [1.0, 0.0]], [gain, 0.0], [1.0, 1.0]


SECTOR = around(*turning(0.2, 1.0), -1.0)
CDELAY = around(*turning(1.0, 2.0))
WINDOW = around(*turning(0.3, 100.0, 1.4))


def slope_odd():
    """400 (s^2 - s/2 + 1)/((s + 10)(s + 20)(s + 30)), v = G (-w + f) up to the sign of f."""
    A = np.diag([-10.0, -20.0, -30.0])
    at = [400 * (a * a - 0.5 * a + 1) for a in (-10.0, -20.0, -30.0)]
    return around(A, [at[0] / 200, -at[1] / 100, at[2] / 200], np.ones(3), -1.0)


def late(damping=0.25):
    """.5/(s^2 + damping s + 1), w = v(t - T), v = G (-w + f), y = w."""
    B, C = [[-1.0, 1.0], [0.0, 0.0]], [[0.0, 0.5], [0.0, 0.0]]
    D = [[0.0, 0.0], [1.0, 0.0]]
    return loop([[-damping, -1.0], [1.0, 0.0]], B, C, D, ["w", "f"], ["v", "y"])


def two_lags(C):
    """w_i = phi(v_i), z_i' = -a_i z_i + w_i, v_i = f_i + C (z1 - z2), y = v."""
    own = C * np.array([[1.0, -1.0], [1.0, -1.0]])
    D = np.hstack([np.zeros((2, 2)), np.eye(2)])
    return loop(
        np.diag([-1.0, -1.01]),
        np.hstack([np.eye(2), np.zeros((2, 2))]),
        np.vstack([own, own]),
        np.vstack([D, D]),
        ["w1", "w2", "f1", "f2"],
        ["v1", "v2", "y1", "y2"],
    )


def windup():
    """Kothare's loop without states that cancel: x = z - Gt w, lags of Q1, Gt and Q2; y = w."""
    unit, none, K = np.eye(2), np.zeros((2, 2)), np.array([[4.0, -5.0], [-3.0, 4.0]])
    off, back = np.array([[0, -5.0], [-3.0, 0]]), np.array([[0, -125.0], [-75.0, 0]])
    A = np.block(
        [
            [-0.01 * unit, -0.1 * off, none, none, none],
            [none, -10 * unit, none, none, none],
            [0.05 * unit, none, -0.05 * unit, none, none],
            [none, none, 10 * unit, -10 * unit, none],
            [none, -0.09 * back, none, none, -0.01 * unit],
        ]
    )
    w = np.vstack([0.1 * off, 10 * unit, none, none, 0.99 * unit + 0.1 * back])
    f = np.vstack([0.1 * K, none, none, none, none])
    e, _, p, q, h = (np.hstack([unit if i == j else none for j in range(5)]) for i in range(5))
    slope = np.array([[1.6, 2.0], [1.2, 1.6]])
    v = -2.5 * (10 * p - 9 * q + slope @ (0.5 * (e - p) + 90 * (q - p))) - h
    C, D = np.vstack([v, 0 * v]), np.vstack([np.zeros((2, 4)), np.hstack([unit, none])])
    names = ["w1", "w2", "f1", "f2"], ["v1", "v2", "y1", "y2"]
    return loop(A, np.hstack([w, f]), C, D, *names)


BOTH = (["w1", "w2"], ["v1", "v2"])
PUBLISHED = {
    "sector": (SECTOR, StaticBlock("w", "v", sector=(0, 1)), 7.08, {}),
    "circle": (SECTOR, StaticBlock("w", "v", sector=(0, 1), constant=False), 25.97, {}),
    "slope_odd": (slope_odd(), StaticBlock("w", "v", slope=(0, 1), odd=True), 28.99, {}),
    "cdelay": (CDELAY, DelayBlock("w", "v", 0.5), 9.21, {}),
    "window": (WINDOW, DelayBlock("w", "v", 0.5, "window"), 105.7, {}),
    "delay1": (late(), DelayBlock("w", "v", 0.5, "delay"), 185.31, {}),
}


@cache
def published(name):
    model, block, _, options = PUBLISHED[name]
    return multiplier_gain(model, block, **options)


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_published_gain_is_reached_and_proven(name):
    found = published(name)
    assert found.verified
    assert found.lower <= found.upper <= PUBLISHED[name][2] * 1.0001  # as printed, to 4 digits
    assert found.verify()


TRUTHS = {"sector": 7.07997, "slope_odd": 7.46186, "window": 9.60535}


@pytest.mark.parametrize("name", TRUTHS)
def test_the_gain_of_a_linear_member_is_the_bound_to_a_thousandth(name):
    """Bounds are sought to 1e-4 of the optimum, one step coarser where that is not proven."""
    assert published(name).lower == pytest.approx(TRUTHS[name], rel=1e-6)
    assert published(name).upper < TRUTHS[name] * 1.002


def response(model, omega):
    return model.frequency_response([omega])[0]


def truth_of_delays(model, factor):
    """Largest gain over T in [0, .5] and frequency: the closed loop at each, on a grid, refined."""

    def gain(x):
        G = response(model, abs(x[1]))
        d = factor(1j * abs(x[1]), min(max(x[0], 0.0), 0.5))
        return abs(G[1, 1] + G[1, 0] * d / (1 - G[0, 0] * d) * G[0, 1])

    grid = [(T, w) for T in np.linspace(0, 0.5, 11) for w in np.geomspace(0.1, 30, 120)]
    best = max(grid, key=gain)
    found = optimize.minimize(lambda x: -gain(x), best, method="Nelder-Mead", tol=1e-10)
    return -found.fun


@pytest.mark.parametrize(
    ("name", "factor", "truth"),
    [
        ("cdelay", lambda s, T: np.exp(-s * T) - 1, 1.2339),
        ("window", lambda s, T: (np.exp(-s * T) - 1) / s, 9.60535),
        ("delay1", lambda s, T: np.exp(-s * T), 29.055),
    ],
)
def test_lower_bounds_of_delays_are_those_of_a_search_of_its_own(name, factor, truth):
    own = truth_of_delays(PUBLISHED[name][0], factor)
    assert own == pytest.approx(truth, rel=1e-4)
    assert published(name).lower == pytest.approx(own, rel=1e-6)


def test_phase_brings_the_bound_of_a_delay_near_its_truth():
    """1.4060 is the worst gain with delays of both signs: by size and energy alone, no less."""
    assert published("cdelay").upper < 1.24


@pytest.mark.parametrize("T", [0.3, 2.0])
def test_what_is_used_of_a_delay_is_true_of_every_shorter_one(T):
    """|e| below its weight, and 3 |K v|^2 + Re (L v)* (M e) >= 0, at v = 1, by evaluation."""
    for omega in np.geomspace(1e-2, 50, 400) / T:
        s = 1j * omega
        N, D, *of_phase = (
            sum(c * s**k for k, c in enumerate(p)) for p in (*weight(T, float), *phase(T, float))
        )
        e = np.exp(-s * np.linspace(0, T, 200)) - 1
        assert np.all(np.abs(D * e) <= np.abs(N) * (1 + 1e-12))
        K, L, M = of_phase
        left = KAPPA * abs(K) ** 2 + np.real(np.conj(L) * M * e)
        assert left.min() >= -1e-12 * abs(L * M)


def test_a_published_number_below_the_truth_is_not_reached():
    """1.87, printed for the loop of the late feedback, lies below the gain of one member."""
    assert 1.87 < 29.055 < published("delay1").lower * 1.0001
    assert published("delay1").upper < 29.7


@pytest.mark.parametrize(
    "C", [*(pytest.param(C, marks=pytest.mark.slow) for C in (-100.0, 100.0)), -790.0]
)
def test_one_function_at_two_places_is_stable_where_two_functions_are_not(C):
    """Published: -793 < C < 101 with the multiplier of a repeated function, |C| < 1 without."""
    found = multiplier_gain(two_lags(C), StaticBlock(*BOTH, slope=(0, 1), odd=True), poles=[1.0])
    assert found.verified
    apart = [StaticBlock(f"w{i}", f"v{i}", slope=(0, 1), odd=True) for i in (1, 2)]
    assert not multiplier_gain(two_lags(1.05), apart, poles=[1.0]).verified


@pytest.mark.parametrize("C", [102.0])
def test_beyond_the_limit_a_linear_function_is_not_stable(C):
    found = multiplier_gain(two_lags(C), StaticBlock(*BOTH, slope=(0, 1), odd=True), poles=[1.0])
    assert not found.verified
    assert math.isinf(found.lower)


@pytest.mark.slow
def test_the_windup_loop_with_a_full_block_multiplier_is_below_the_published_gain():
    """Published with the pole .3: 4.1323, and 3.2327 with a full block; linear functions 1.0002."""
    block = StaticBlock(*BOTH, slope=(0, 1), odd=True)
    one = multiplier_gain(windup(), block, poles=[0.3])
    two = multiplier_gain(windup(), block, poles=[0.1, 1.0])
    assert one.verified
    assert two.verified
    assert one.upper <= 3.2327
    assert two.lower <= two.upper < 2.9
    assert two.lower == pytest.approx(1.00023, rel=1e-4)


def norm(A, B, C, D):
    """H-infinity norm by bisection on the Hamiltonian, of a strictly proper model."""
    low, high = 0.0, 1e4
    while high > low * (1 + 1e-9) + 1e-12:
        g = 0.5 * (low + high)
        H = np.block([[A, B @ B.T / g**2], [-C.T @ C, -A.T]])
        crossing = np.min(np.abs(np.linalg.eigvals(H).real)) < 1e-7
        low, high = (g, high) if crossing else (low, g)
    return high


BLOCKS = {
    "sector": lambda k: StaticBlock("w", "v", sector=(-k, k)),
    "slope": lambda k: StaticBlock("w", "v", slope=(-k, k)),
    "odd": lambda k: StaticBlock("w", "v", slope=(-k, k), odd=True),
    "parameter": lambda k: ParameterBlock("w", "v", -k, k),
    "jumping": lambda k: ParameterBlock("w", "v", -k, k, math.inf),
    "dynamics": lambda k: DynamicBlock(["w"], ["v"], k),
    "delay": lambda k: DelayBlock("w", "v", k),
    "window": lambda k: DelayBlock("w", "v", k, "window"),
}


def random_loop(seed, n=3, dt=None):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    if dt is None:
        A -= (np.linalg.eigvals(A).real.max() + 0.5) * np.eye(n)
    else:
        A *= 0.7 / np.abs(np.linalg.eigvals(A)).max()
    B, C = rng.normal(size=(n, 2)), rng.normal(size=(2, n))
    return loop(A, B, C, np.zeros((2, 2)), ["w", "f"], ["v", "y"], dt)


def bounds_are_in_order(kind, seed, dt=None):
    model = random_loop(seed, dt=dt)
    own = loop(model.A, model.B[:, :1], model.C[:1], [[0.0]], ["w"], ["v"], dt)
    size = np.abs(own.frequency_response(np.geomspace(1e-3, 3 if dt else 1e3, 400))).max()
    found = multiplier_gain(model, BLOCKS[kind](float(0.3 / size)), poles=[1.0])
    assert found.verified
    assert 0 < found.lower <= found.upper
    return found


QUICK = "sector", "jumping"


@pytest.mark.parametrize("kind", QUICK)
def test_a_proven_gain_is_above_that_of_members(kind):
    bounds_are_in_order(kind, 1)


@pytest.mark.slow
@pytest.mark.parametrize("kind", BLOCKS)
@pytest.mark.parametrize("seed", range(1, 12))
def test_many_proven_gains_are_above_those_of_members(kind, seed):
    bounds_are_in_order(kind, seed)


@pytest.mark.parametrize("kind", ["odd", pytest.param("dynamics", marks=pytest.mark.slow)])
def test_sampled_loops_are_proven_too(kind):
    bounds_are_in_order(kind, 3, dt=1.0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["parameter", "dynamics"])
def test_the_bound_of_one_linear_block_is_its_worst_gain(kind):
    """Of one constant parameter, or one block of dynamics, D and G scalings lose nothing; lags of
    one pole lose up to 3 % on this loop.
    """
    found = bounds_are_in_order(kind, 5)
    assert found.upper < found.lower * 1.03


@pytest.mark.slow
def test_the_lower_bound_of_a_parameter_is_the_norm_of_its_loop():
    model = random_loop(4)
    found = multiplier_gain(model, ParameterBlock("w", "v", -0.05, 0.05), poles=[1.0])
    gains = [
        norm(model.A + k * model.B[:, :1] @ model.C[:1], model.B[:, 1:], model.C[1:], 0)
        for k in np.linspace(-0.05, 0.05, 5)
    ]
    assert found.lower == pytest.approx(max(gains), rel=1e-6)


@pytest.mark.slow
def test_several_blocks_of_different_kinds_are_taken_together():
    A = np.diag([-1.0, -2.0, -3.0])
    B, C = 0.3 * np.ones((3, 4)), np.ones((4, 3))
    names = ["d1", "d2", "d3", "f"], ["v1", "v2", "v3", "y"]
    blocks = [
        StaticBlock("d1", "v1", sector=(0, 0.5)),
        DelayBlock("d2", "v2", 0.1),
        ParameterBlock("d3", "v3", -0.2, 0.3),
    ]
    found = multiplier_gain(loop(A, B, C, np.zeros((4, 4)), *names), blocks)
    assert found.verified
    assert found.lower <= found.upper < 1.3 * found.lower
    assert len(found.member) == 3


@pytest.mark.slow
def test_a_simulated_saturation_stays_below_the_proven_gain():
    """Energies of a simulation by fixed steps of a hundredth of a second."""
    model = SECTOR
    found = published("sector")
    h, T = 0.01, 40.0
    step = linalg.expm(h * np.block([[model.A, model.B], [np.zeros((2, 4))]]))
    rng, worst = np.random.default_rng(0), 0.0
    for amplitude in (0.1, 1.0, 10.0):
        x, inside, outside = np.zeros(2), 0.0, 0.0
        phase = rng.uniform(0, 6)
        for k in range(int(T / h)):
            f = amplitude * math.sin(k * h + phase) * (k * h < 20)
            v = float(model.C[0] @ x)
            w = float(np.clip(v, -1, 1))
            x = step[:2] @ np.r_[x, w, f]
            inside, outside = inside + f * f, outside + v * v
        worst = max(worst, math.sqrt(outside / inside))
    assert worst < found.upper


def multiplier_at(block, omega):
    """M of a static function from its coefficients: a second writing, of one channel."""
    kind, c = block
    s, lags = 1j * omega, kind.lags
    E = [(a / (s + a)) ** r for a in lags.poles for r in range(1, lags.order + 1)]
    spare, rest, popov = c[0], list(c[1:-1]), c[-1]
    total = spare + 0j
    for sign in (-1, 1) if kind.odd else (-1,):
        for each in E:
            ahead, behind = rest.pop(0), rest.pop(0)
            total += ahead * (1 + sign * each) + behind * (1 + sign * np.conj(each))
    assert not rest
    return total + popov * s


def test_the_multiplier_of_the_proof_holds_at_single_frequencies():
    """The inequality over frequency, written with M(j w) and G(j w): e = d and u = v - d."""
    found = published("slope_odd")
    proof, model = found.proof, slope_odd()
    kind = proof.blocks[0].kind
    for omega in np.geomspace(0.1, 1e3, 60):
        G = response(model, omega)
        v, d, f = np.array(G[0]), np.array([1.0, 0.0]), np.array([0.0, 1.0])
        M = multiplier_at((kind, proof.coefficients[0]), omega)
        popov = proof.coefficients[0][-1] * 1j * omega
        u = (M - popov) * (v - d) + popov * v
        F = 0.5 * (np.outer(d, u) + np.outer(d, u).conj().T)
        F = F + np.outer(G[1].conj(), G[1]) - found.upper**2 * np.outer(f, f)
        assert np.linalg.eigvalsh(F)[-1] < 0


def own_multiplier(bound, dt=None):
    none = np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0))
    psi = LinearModel(*none, np.diag([bound, 1.0]), [], ["v", "d"], ["a", "b"], dt)
    return OwnMultiplier(["w"], ["v"], psi, [np.diag([1.0, -1.0])])


@pytest.mark.slow
def test_a_multiplier_of_ones_own_is_that_of_the_block_it_describes():
    """bound^2 |v|^2 - |d|^2 without lags, as of a parameter that jumps without its skew part."""
    own = multiplier_gain(CDELAY, own_multiplier(0.3))
    known = multiplier_gain(CDELAY, DynamicBlock(["w"], ["v"], 0.3))
    jumping = multiplier_gain(CDELAY, ParameterBlock("w", "v", -0.3, 0.3, math.inf))
    assert own.upper == pytest.approx(jumping.upper, rel=1e-3)  # both within 1e-4 of one optimum
    assert known.upper <= own.upper * 1.001


def peaks_of_two():
    """Published: 67.81, improved to 66.93170755766734 with free multipliers and the rate .46
    (Schwenkel, Koehler, Mueller and Allgoewer, robust peak-to-peak gain, IQC example 1).
    """
    A, B = [[0.2, 0.01], [-0.1, -0.01]], [[0.1, 0.2, 3, 2], [0.3, -0.2, 3, 1]]
    C = [[0.2, -0.3], [0.8, 0.5], [2, 1], [2, 3]]
    D = [[0.4, 0.3, 3, 1], [-0.6, 0.1, 2, 7], [1, 2, 1, -2], [-1, 4, -4, 3]]
    model = loop(A, B, C, D, ["p1", "p2", "w1", "w2"], ["q1", "q2", "z1", "z2"], 1.0)
    ranges = ("p1", "q1", -0.1, 0.5), ("p2", "q2", -0.3, 0.6)
    return model, [ParameterBlock(*own, rate=math.inf) for own in ranges]


def test_the_published_peak_to_peak_gain_is_reached_and_a_motion_comes_near():
    model, blocks = peaks_of_two()
    found = multiplier_gain(model, blocks, kind="peak to peak", decay=1 - 0.46**2)
    assert found.verified
    assert found.verify()
    assert found.upper <= 66.93170755766734
    assert 65.65 < found.lower <= found.upper


def test_a_peak_of_a_simulation_stays_below_the_proven_one():
    model, _ = peaks_of_two()
    upper, (A, B, C, D) = 66.931, (model.A, model.B, model.C, model.D)
    rng, worst = np.random.default_rng(0), 0.0
    for _ in range(200):
        x = np.zeros(2)
        for _ in range(12):
            d = np.diag([rng.choice([-0.1, 0.5]), rng.choice([-0.3, 0.6])])
            w = rng.normal(size=2)
            w /= np.linalg.norm(w)
            q = np.linalg.solve(
                np.eye(2) - model.D[:2, :2] @ d, model.C[:2] @ x + model.D[:2, 2:] @ w
            )
            into = np.r_[d @ q, w]
            worst = max(worst, np.linalg.norm(C[2:] @ x + D[2:] @ into))
            x = A @ x + B @ into
    assert 40 < worst < upper


def energies_of_ones_own():
    """Published: 2.683 (Abou Jaoude and Farhood), improved to 2.0078167230946775."""
    first, second = [[1.3, 0.0]], [[0.2, 0], [0, -0.1], [-0.5, 0.3], [0, 1.7]]
    psi = loop([[-0.3]], first, [[0], [-0.1], [0], [0]], second, ["q", "p"], [*"abcd"], 1.0)
    forms = [np.diag([1.0, -1.0, 0, 0]), np.diag([0, 0, 1.0, -1.0])]
    model = loop(
        [[-0.5]], [[0.5, 0.4]], [[2.5], [2.0]], [[0, 0.6], [0, 0.9]], ["p", "w"], ["q", "z"], 1.0
    )
    return model, OwnMultiplier("p", "q", psi, forms)


def test_the_published_energy_to_peak_gain_with_a_filter_of_ones_own_is_reached():
    found = multiplier_gain(*energies_of_ones_own(), kind="energy to peak")
    assert found.verified
    assert found.upper < 2.00782  # the optimum of this program is 2.007815
    assert 1.28 < found.lower < found.upper
    again = type(found).restored(found.stored)
    assert again.verified
    assert again.kind == "energy to peak"


@pytest.mark.parametrize("dt", [None, 0.1])
def test_a_block_that_is_nearly_none_leaves_the_closed_form_of_a_lag(dt):
    """A lag 1/(s + 1): energy to peak sqrt(1/2), peak to peak 1; sampled a = 1 - dt, b = dt:
    b/sqrt(1 - a^2) and b/(1 - a).
    """
    a, b = (-1.0, 1.0) if dt is None else (1.0 - dt, dt)
    model = loop([[a]], [[b, b]], [[1.0], [1.0]], np.zeros((2, 2)), ["d", "f"], ["v", "y"], dt)
    block = ParameterBlock("d", "v", -1e-4, 1e-4, math.inf)
    energy = math.sqrt(0.5) if dt is None else b / math.sqrt(1 - a * a)
    for kind, truth in (("energy to peak", energy), ("peak to peak", 1.0)):
        found = multiplier_gain(model, block, kind=kind)
        # the block shifts the pole by 1e-4; motions are followed for 12 time constants
        assert found.upper == pytest.approx(truth, rel=1e-3)
        assert found.lower == pytest.approx(truth, rel=1e-3)
        assert found.lower <= found.upper


@pytest.mark.parametrize(
    ("model", "block", "kind", "words"),
    [
        (CDELAY, DelayBlock("w", "v", 0.1), "peak to peak", "finite times"),
        (CDELAY, DynamicBlock("w", "v", 0.1), "energy to peak", "continuous time"),
        (random_loop(1, dt=1.0), DynamicBlock("w", "v", 0.1), "peak to peak", "peaks"),
    ],
)
def test_a_peak_that_is_not_known_is_refused(model, block, kind, words):
    with pytest.raises(InputError, match=words):
        multiplier_gain(model, block, kind=kind)


def test_files_are_proven_anew_and_words_come_from_their_numbers(tmp_path):
    found = published("cdelay")
    again = type(found).restored(found.stored)
    assert again.verified
    assert again.upper == found.upper
    assert "T constant, from 0 to 0.5 s" in again.conditions[1]
    assert f"{found.upper:.9g}" in again.claim
    assert found.save(tmp_path / "gain.json").exists()
    assert "proven in exact arithmetic" in str(found)
    assert found.facts == {"kind": "multiplier gain", "bound": found.upper}


@pytest.mark.parametrize("change", ["gain", "P", "coefficients", "longest"])
def test_a_changed_number_is_not_proven(change):
    found = published("window")
    content = found.stored
    own = content["blocks"][0]
    if change == "gain":
        content["gain"] *= 0.98
    elif change == "P":
        content["P"]["array"][0] *= 0.5
    elif change == "coefficients":
        own["coefficients"]["array"][-1] *= -1.0
    else:
        own["longest"] *= 1.5
    again = type(found).restored(content)
    assert not again.verified
    assert again.why
    with pytest.raises(InputError):
        again.save("nowhere.json")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: StaticBlock("w", "v"), "either"),
        (lambda: StaticBlock("w", "v", sector=(1, 0)), "low < high"),
        (lambda: StaticBlock(["w", "x"], ["v"], sector=(0, 1)), "an output for each"),
        (lambda: StaticBlock("w", "v", slope=(0, 1), constant=False), "constant in time"),
        (lambda: DelayBlock("w", "v", 0.0), "> 0 s"),
        (lambda: DelayBlock("w", "v", 1.0, "lag"), "form"),
        (lambda: ParameterBlock("w", "v", 0, 1, 2.0), "rate"),
        (lambda: multiplier_gain(SECTOR, []), "at least one"),
        (lambda: multiplier_gain(SECTOR, BLOCKS["slope"](1.0), poles=[-1.0]), "poles"),
        (lambda: multiplier_gain(SECTOR, BLOCKS["slope"](1.0), order=0), "order"),
        (lambda: multiplier_gain(SECTOR, BLOCKS["slope"](1.0), ["w"]), "no block"),
        (lambda: multiplier_gain(SECTOR, [BLOCKS["slope"](1.0)] * 2), "two blocks"),
        (lambda: multiplier_gain(random_loop(1, dt=1.0), BLOCKS["delay"](1.0)), "continuous"),
        (lambda: multiplier_gain(SECTOR, DynamicBlock("w", "v", 1.0, SECTOR)), "weight"),
        (lambda: multiplier_gain(SECTOR, DynamicBlock("w", "v", "1")), "bound"),
        (lambda: multiplier_gain(SECTOR, "w"), "expected StaticBlock"),
        (lambda: multiplier_gain(SECTOR, BLOCKS["slope"](1.0), decay=0.1), "leave it out"),
        (lambda: multiplier_gain(SECTOR, own_multiplier(0.3, 0.1)), "sampled every 0.1 s"),
    ],
)
def test_what_does_not_fit_is_refused_in_words(call, words):
    with pytest.raises(InputError, match=words):
        call()


def test_a_loop_without_stable_nominal_blocks_has_no_gain():
    found = multiplier_gain(around([[1.0]], [1], [1]), BLOCKS["odd"](1.0))
    assert not found.verified
    assert math.isinf(found.lower)
    assert "nominal loop is not stable" in found.why


@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize(
    "block",
    [StaticBlock("w", "v", slope=(-2.0, -1.0)), ParameterBlock("w", "v", -2.0, -1.0)],
)
def test_a_model_with_an_integrator_is_one_with_stable_blocks(block, dt):
    """x' = d + f, v = x/2, d = -k v, k from 1 to 2: |x|_2 <= 2 |f|_2, sampled x + dt x' next."""
    A, B = [[0.0 if dt is None else 1.0]], [[dt or 1.0, dt or 1.0]]
    model = loop(A, B, [[0.5], [1.0]], np.zeros((2, 2)), ["w", "f"], ["v", "y"], dt)
    found = multiplier_gain(model, block)
    assert found.lower == pytest.approx(2.0, rel=1e-9)
    assert found.upper == pytest.approx(2.0, rel=1e-3)


def test_an_unstable_nominal_loop_of_a_peak_is_told():
    """The middle of the range is an integrator."""
    model = loop([[0.0]], [[1.0, 1.0]], [[1.0], [1.0]], np.zeros((2, 2)), ["w", "f"], ["v", "y"])
    found = multiplier_gain(model, ParameterBlock("w", "v", -1.0, 1.0), kind="peak to peak")
    assert math.isinf(found.upper)
    assert "not stable" in found.why


def test_an_unknown_channel_or_kind_is_named():
    with pytest.raises(UnknownNameError):
        multiplier_gain(SECTOR, StaticBlock("w", "v", sector=(0, 1)), kind="L3")
    with pytest.raises(UnknownNameError):
        multiplier_gain(SECTOR, StaticBlock("w", "z", sector=(0, 1)))


def test_a_block_with_a_path_at_the_same_instant_is_refused():
    D = [[0.5, 0.0], [0.0, 0.0]]
    model = loop([[-1.0]], [[1.0, 1.0]], [[1.0], [1.0]], D, ["w", "f"], ["v", "y"])
    with pytest.raises(InputError, match="same instant"):
        multiplier_gain(model, StaticBlock("w", "v", sector=(0, 1)))
    assert multiplier_gain(model, ParameterBlock("w", "v", -0.2, 0.2)).verified
