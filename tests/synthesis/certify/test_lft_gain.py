"""LFT tests: their order, closed forms, published cases, independent routes, and that they never
prove what is false.
"""

import math
from dataclasses import replace

import control
import cvxpy as cp
import numpy as np
import pytest
from models import constant, lag, lateral, random_stable, spring

from symheli import LFT, LinearModel, LPVStateSpace, Scheduling
from symheli.errors import CertificateError, InputError, UnknownNameError
from symheli.lpv import connect
from synthesis import Solver, frozen_gain, l2_gain, lft_gain, lower_bound
from synthesis.analysis import SCALINGS, LowerBoundSearch, Status, frozen_box_gain, lft_stability
from synthesis.certify.lft.multipliers import Multiplier
from synthesis.impose import Bernstein

QUICK = LowerBoundSearch(levels=4, dwells=7, evaluations=8, steps=60)
CLOSE = 1e-5
"""gamma is inflated by 5e-7, the solver's gap is 1e-8 of gamma^2, the margins take the rest."""


def reduced(lpv):
    return lpv.to_lft().reduce(1e-12)


def gains(lft, scalings=SCALINGS, **options):
    return [lft_gain(lft, scaling, search=None, **options).gamma for scaling in scalings]


def oscillator(k):
    """x'' + 0.21 x' + (1 - d) x = f, |d| <= 0.8 k: the system of iqc_tvscalar_test.m of the IQC
    toolbox.
    """
    return LFT(
        [[0.0]],
        [[0, 0.8 * k, 0]],
        [[1.0], [0], [0]],
        [[-0.21, -1, 1], [1, 0, 0], [0, 1, 0]],
        ((Scheduling("d", "1", -0.8 * k, 0.8 * k), 1),),
        ("v", "x"),
        ("f",),
        ("x_out",),
    )


def two_parameters(a):
    """Delta = diag(d1, d2) in [-a, a]: the plant of IQClab's Demo_004 (J. Veenman), option 1,
    performance L2.
    """
    M11, M21 = np.array([[1.0, -2], [1, -1]]), np.array([[1.0, 0], [0, 0], [0, 1]])
    blocks = tuple((Scheduling(name, "1", -a, a), 1) for name in ("d1", "d2"))
    M22 = [[-2.0, -3, 1], [1, 1, 0], [1, 0, 0]]
    return LFT(
        a * M11, [[1.0, 0, 0], [0, 0, 1]], a * M21, M22, blocks, ("x1", "x2"), ("w",), ("z",)
    )


def gridded(lft, points):
    """The gain that one constant P allows on a grid of the box, by cvxpy: a lower bound of every
    constant-P test.
    """
    nx, nu = len(lft.states), len(lft.inputs)
    P, g = cp.Variable((nx, nx), symmetric=True), cp.Variable()
    grid = np.linspace(-1, 1, points)
    constraints = [P >> 0]
    for delta in np.stack(np.meshgrid(*[grid] * len(lft.blocks)), -1).reshape(-1, len(lft.blocks)):
        M = lft.matrix(delta)
        A, B, C, D = M[:nx, :nx], M[:nx, nx:], M[nx:, :nx], M[nx:, nx:]
        F = cp.bmat(
            [
                [A.T @ P + P @ A + C.T @ C, P @ B + C.T @ D],
                [B.T @ P + D.T @ C, D.T @ D - g * np.eye(nu)],
            ]
        )
        constraints.append(0.5 * (F + F.T) << 0)
    cp.Problem(cp.Minimize(g), constraints).solve(solver="CLARABEL")
    return math.sqrt(g.value)


def heavier():
    """m v' = -v - k x + f, x' = v with the mass in [1, 1.2] kg (rational) and the stiffness in
    [3.5, 4.5] N/m.
    """
    mass, stiffness = Scheduling("mass", "kg", 1.0, 1.2), Scheduling("stiffness", "N/m", 3.5, 4.5)
    body = LinearModel(
        np.array([[0.0, 0], [1, 0]]),
        [[1.0], [0]],
        [[1.0, 0], [0, 1]],
        np.zeros((2, 1)),
        ("vs", "xs"),
        ("acc",),
        ("v1", "x1"),
    )
    one = LinearModel(
        np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[1.0]], (), ("e",), ("acc",)
    )
    return connect(
        body,
        one,
        LFT.parameter(mass, "acc", "inertia"),
        LFT.parameter(stiffness, "x1", "spring"),
        inputs=["f"],
        outputs=["x1"],
        sums={"e": {"f": 1.0, "v1": -1.0, "spring": -1.0, "acc": 1.0, "inertia": -1.0}},
    )


@pytest.mark.slow(but="D")
@pytest.mark.parametrize("scaling", SCALINGS)
def test_a_lag_has_its_static_gain(scaling):
    # the search does not depend on the scaling, and finds nothing above the frozen gain
    cert = lft_gain(
        reduced(lag()),
        scaling,
        search=LowerBoundSearch(
            levels=3, dwells=3, starts=1, nodes=16, evaluations=4, steps=24, samples=1000
        ),
    )
    assert cert.frozen <= cert.lower <= cert.gamma <= 1 + CLOSE
    assert cert.frozen == pytest.approx(1.0, abs=1e-7)
    assert cert.verify()
    assert cert.verify(rigorous=True)


@pytest.mark.parametrize("dt", [None, 0.1])
def test_without_parameters_every_test_gives_the_h_infinity_norm(dt):
    m = random_stable(1, states=4, degree=0, dt=dt).at(0.5)
    expected = control.system_norm(control.ss(m.A, m.B, m.C, m.D, dt or 0), p="inf", tol=1e-8)
    for lft in (LFT.constant(m), constant(m.A, m.B, m.C, m.D, dt).to_lft()):
        for gamma in gains(lft, ("small gain", "full block")):
            assert gamma == pytest.approx(expected, rel=CLOSE)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "dt"),
    [(3, 0.1), (4, None)],
)
def test_richer_multipliers_prove_smaller_gains(seed, dt):
    lft = reduced(random_stable(seed, dt=dt))
    small, D, DG, full = gains(lft)
    assert lft_gain(lft, "DG", search=QUICK).lower <= full * (1 + 1e-6)
    assert full <= DG * (1 + CLOSE)
    assert DG <= D * (1 + CLOSE)
    assert D <= small * (1 + CLOSE)


@pytest.mark.slow(but="5")
@pytest.mark.parametrize("seed", [5, 7])
def test_for_one_parameter_d_and_g_lose_nothing_against_any_constant_p(seed):
    lpv = random_stable(seed)
    DG, full = gains(reduced(lpv), ("DG", "full block"))
    assert full == pytest.approx(DG, rel=CLOSE)
    # the Bernstein form of the same constant P can only be more conservative, and is not with its
    # degree raised
    bernstein = l2_gain(lpv, math.inf, impose=Bernstein(elevation=6), search=None).gamma
    assert DG <= bernstein * (1 + CLOSE)
    assert bernstein == pytest.approx(DG, rel=1e-3)


def test_the_oscillator_is_proven_exactly_up_to_the_circle_criterion():
    # the closed form 1/|G|_inf; the IQC toolbox reports 0.26 to two digits
    limit = 0.21 * math.sqrt(1 - 0.105**2) / 0.8
    assert limit == pytest.approx(0.26, abs=0.002)
    for scaling in SCALINGS:
        assert lft_gain(oscillator(0.999 * limit), scaling, search=None).verified
        beyond = lft_gain(oscillator(1.001 * limit), scaling, search=None)
        assert beyond.status is Status.INFEASIBLE
        assert math.isinf(beyond.gamma)


def test_the_gain_of_the_oscillator_in_closed_form():
    # small gain on both channels: |G|_inf/(1 - k' |G|_inf) with the parameter's own channel equal
    # to the performance's
    peak, k = 1 / (0.21 * math.sqrt(1 - 0.105**2)), 0.1
    assert gains(oscillator(k / 0.8), ("small gain",))[0] <= peak / (1 - k * peak) * (1 + CLOSE)
    # one scalar parameter of one copy: all the classes are the same
    assert np.ptp(gains(oscillator(0.2))) < 1e-4


@pytest.mark.slow
def test_two_parameters_in_the_order_of_the_theory_and_down_to_what_constant_p_allows():
    lft = two_parameters(0.2)
    small, D, DG, full = gains(lft)
    # one copy of each: there is no G, and D is strictly better than one number, the full block
    # strictly better than D
    assert DG == pytest.approx(D, rel=CLOSE)
    assert D < small * 0.99
    assert full < DG * 0.995
    assert full >= gridded(lft, 9) * (1 - 1e-6)


@pytest.mark.slow
def test_full_blocks_reach_the_gridded_gain_of_a_rational_model():
    lft = heavier().reduce()
    assert lft.order == 2
    full, DG = gains(lft, ("full block", "DG"))
    below = gridded(lft, 9)
    assert below * (1 - 1e-6) <= full <= DG * (1 + CLOSE)
    assert full == pytest.approx(below, rel=1e-3)


@pytest.mark.slow
def test_tustins_rule_keeps_every_gain():
    # the multiplier is static and the nominal loop undergoes a bilinear transform: the
    # frequency-domain inequality is the same
    lft = reduced(random_stable(4))
    for a, b in zip(gains(lft), gains(lft.discretize(0.1)), strict=True):
        assert b == pytest.approx(a, rel=CLOSE)


def test_units_of_states_channels_and_time_do_not_matter():
    lpv = random_stable(3)
    T = np.diag([1e3, 1.0, 1e-3])
    other = replace(
        lpv,
        A=1e-3 * T @ lpv.A @ np.linalg.inv(T),
        B=1e-3 * T @ lpv.B,
        C=1e4 * lpv.C @ np.linalg.inv(T),
        D=1e4 * lpv.D,
    )
    for a, b in zip(
        *(gains(reduced(m), ("D", "DG", "full block")) for m in (lpv, other)), strict=True
    ):
        assert b == pytest.approx(1e4 * a, rel=CLOSE)


def test_superfluous_copies_change_only_the_small_gain():
    lpv = random_stable(6, degree=1)
    for a, b in zip(
        *(gains(lft, ("D", "DG")) for lft in (lpv.to_lft(), reduced(lpv))), strict=True
    ):
        assert b == pytest.approx(a, rel=1e-4)


def test_resonance_pumped_by_a_jumping_parameter_is_never_proven():
    lft = reduced(spring())
    for scaling in SCALINGS:
        cert = lft_gain(lft, scaling, search=None)
        assert cert.status is Status.INFEASIBLE
        assert not cert.verified
        assert not cert.verify()
    growing = lft_gain(lft, "full block", search=QUICK)
    assert growing.status is Status.GROWING
    assert growing.worst is not None
    assert lft_stability(lft, search=QUICK).status is Status.GROWING


def test_growth_along_a_diagonal_of_two_parameters_is_found():
    # spring() with its change split over two parameters: both must jump together
    half = spring().to_lft().reduce()
    blocks = ((Scheduling("a", "1", -1.0, 1.0), 1), (Scheduling("b", "1", 0.0, 4.0), 1))
    M12, M21 = np.tile(half.M12, (2, 1)), 0.5 * np.tile(half.M21, (1, 2))
    lft = LFT(np.zeros((2, 2)), M12, M21, half.M22, blocks, half.states, half.inputs, half.outputs)
    cert = lft_stability(lft, "full block", search=QUICK)
    assert cert.status is Status.GROWING
    assert cert.worst is not None
    np.testing.assert_allclose(cert.worst.p[:, 1], 2 + 2 * cert.worst.p[:, 0], atol=1e-12)


@pytest.mark.slow
def test_an_lft_and_its_polynomial_model_have_the_same_lower_bound():
    quick, lpv = (
        LowerBoundSearch(
            levels=4, dwells=4, starts=1, nodes=16, evaluations=4, steps=40, samples=2000
        ),
        spring(damping=0.3),
    )
    # the same search on the same matrices, computed by another route: rounding, amplified a little
    # by the ascents
    found, expected = (lower_bound(model, 1.0, search=quick) for model in (reduced(lpv), lpv))
    assert found.gain == pytest.approx(expected.gain, rel=1e-6)
    assert expected.gain > 1.001 * frozen_gain(lpv).gain


@pytest.mark.slow
@pytest.mark.parametrize(
    "search",
    [
        LowerBoundSearch(
            levels=4, dwells=5, starts=1, nodes=32, evaluations=6, steps=60, samples=20_000
        ),
        pytest.param(
            LowerBoundSearch(levels=6, dwells=7, evaluations=12, steps=80), marks=pytest.mark.slow
        ),
    ],
    ids=["coarse", "fine"],
)
def test_the_lower_bound_sees_waves_at_the_parameters_own_rate(search):
    """A search over jumps alone ends at the frozen gain here, which slower waves exceed."""
    lpv = lateral().with_scheduling(Scheduling("airspeed", "m/s", 3.0, 10.0, 3.0))
    cert = lft_gain(reduced(lpv), search=search)
    assert 1.03 * cert.frozen < cert.lower < cert.gamma


def test_an_unstable_frozen_model_ends_the_search():
    lft = two_parameters(0.4)
    cert = lft_gain(lft)
    assert cert.status is Status.UNSTABLE
    assert math.isinf(cert.lower)
    frozen = frozen_box_gain(lft)
    assert not lft.at(*frozen.p).is_stable()


def test_the_frozen_gain_over_a_box_is_found_between_grid_points():
    # peak of x'' + 2 z x' + x with z = 0.1 + (a - 0.3137)^2 + (b + 0.77)^2
    def damping(power):
        return {
            (0, 0): power(0.2 + 2 * (0.3137**2 + 0.77**2)),
            (1, 0): power(-4 * 0.3137),
            (2, 0): power(2.0),
            (0, 1): power(4 * 0.77),
            (0, 2): power(2.0),
        }

    A = damping(lambda c: np.array([[0, 0], [0, -c]]))
    A[0, 0] = A[0, 0] + np.array([[0, 1], [-1, 0]])
    box = [Scheduling("a", "1", -1.0, 1.0), Scheduling("b", "1", -1.0, 1.0)]
    lft = LFT.polynomial(A, {(0, 0): [[0.0], [1]]}, {(0, 0): [[1.0, 0]]}, {(0, 0): [[0.0]]}, box)
    found = frozen_box_gain(lft.reduce())
    assert found.gain == pytest.approx(1 / (0.2 * math.sqrt(1 - 0.01)), rel=1e-5)
    # the peak is flat: its place is known to the square root of that
    np.testing.assert_allclose(found.p, (0.3137, -0.77), atol=5e-3)


def test_stability_needs_no_channels():
    cert = lft_stability(reduced(random_stable(8)))
    assert cert.verified
    assert math.isnan(cert.gamma)
    assert cert.verify(rigorous=True)


def test_a_proof_that_was_touched_is_no_longer_one():
    cert = lft_gain(reduced(random_stable(3)), "DG", search=None)
    proof = cert.lyapunov

    def verdicts(proof, gamma=cert.gamma):
        evidence = cert.proof.evidence
        return [evidence.floating(proof, gamma), evidence.exact(proof, gamma)]

    assert verdicts(proof) == [True, True]
    assert verdicts(proof, 0.999 * cert.gamma) == [False, False]
    assert verdicts(proof._replace(P=-proof.P)) == [False, False]
    m = proof.multiplier
    lopsided = np.array(m.S)
    lopsided[0, 1] += 1e-12
    for changed in (
        replace(m, S=lopsided),
        replace(m, R=-m.R, Q=-m.Q),
        replace(m, R=1.0000001 * m.R),
        replace(m, scaling="D"),
    ):
        assert verdicts(proof._replace(multiplier=changed)) == [False, False]


@pytest.mark.parametrize("scaling", SCALINGS)
def test_multipliers_hold_on_the_whole_box(scaling):
    cert = lft_gain(two_parameters(0.2), scaling, search=None)
    m = cert.lyapunov.multiplier
    rng = np.random.default_rng(0)
    for delta in rng.uniform(-1, 1, (200, 2)):
        outer = np.vstack([np.diag(delta), np.eye(2)])
        value = outer.T @ m.matrix @ outer
        # zero at the corners is allowed, to rounding
        assert np.linalg.eigvalsh(value)[0] > -1e-10 * np.abs(m.matrix).max()


def test_a_solver_that_stops_early_proves_nothing_and_says_so():
    # a hair below the limit, where nothing but a converged answer will do
    cert = lft_gain(oscillator(0.2609), "DG", solver=Solver("CLARABEL", iterations=1), search=None)
    assert cert.status is Status.FAILED
    assert math.isinf(cert.gamma)
    assert len(cert.attempts) > 1
    assert "not verified" in cert.details


def test_scs_agrees_with_clarabel():
    lft = two_parameters(0.1)
    # a first-order method: three digits
    assert gains(lft, ("full block",), solver="SCS")[0] == pytest.approx(
        gains(lft, ("full block",))[0], rel=5e-3
    )


def test_a_certificate_that_contradicts_its_bounds_cannot_be_made():
    cert = lft_gain(reduced(lag()), search=None)
    with pytest.raises(CertificateError, match="lower bound"):
        replace(cert, lower=1.1)
    with pytest.raises(CertificateError, match="frozen gain"):
        replace(cert, frozen=1.1)


def test_wrong_use_is_explained():
    with pytest.raises(InputError, match=r"to_lft\(\)\.reduce"):
        lft_gain(lag())  # type: ignore[arg-type]
    lft = reduced(lag())
    with pytest.raises(UnknownNameError, match="did you mean 'full block'"):
        lft_gain(lft, "full blok")
    with pytest.raises(InputError, match="needs inputs and outputs"):
        lft_gain(lft.select(inputs=()))
    with pytest.raises(InputError, match="no states"):
        lft_gain(LFT.parameter(Scheduling("p", "1", 0.0, 1.0), "u", "y"))
    seven = {
        name: {(0,) * 7: [[value]]}
        for name, value in (("A", -1.0), ("B", 1.0), ("C", 1.0), ("D", 0.0))
    }
    many = LFT.polynomial(
        **seven, parameters=[Scheduling(f"p{i}", "1", 0.0, 1.0) for i in range(7)]
    )
    with pytest.raises(InputError, match="corners"):
        lft_gain(many, "full block")
    with pytest.raises(InputError, match="Q of a multiplier"):
        Multiplier("D", (2,), np.eye(3), np.eye(2), np.eye(2))


@pytest.mark.slow
def test_on_the_lateral_loop_no_lft_test_proves_the_whole_range_and_a_varying_p_does():
    lft = reduced(lateral())
    for scaling in SCALINGS:
        assert lft_gain(lft, scaling, search=None).status is Status.INFEASIBLE
    assert lft_gain(lft).status is Status.GROWING
    assert l2_gain(lateral(), 1.0, search=None).verified


def test_a_loop_of_gains_of_a_hundred_million_is_refused_in_words():
    """A crane over 1/length; the responses by which coordinates are chosen are singular to
    rounding.
    """
    p = Scheduling("p", "1/m", 1 / 8, 1 / 2, 0.25)
    A0, A1 = np.diag([1.0, 0, 1], 1), np.zeros((4, 4))
    A1[3, 2], A0[3, 3] = -9.81, -0.05
    B0, B1 = np.eye(4)[:, [1]], -np.eye(4)[:, [3]]
    K = np.array([[-1.8584e8, -3.5902e8, 6.9817e8, 4.0393e8]])
    C = np.vstack([np.eye(4)[0], 5.0 * np.eye(4)[2], K])
    D = np.array([[0.0], [0.0], [0.1]])
    closed = [A0 + B0 @ K, A1 + B1 @ K]
    loop = LPVStateSpace.polynomial(closed, [0.1 * B0, 0.1 * B1], [C], [D], p)
    found = lft_gain(loop.to_lft(), search=None)
    assert not found.verified
    assert found.why
