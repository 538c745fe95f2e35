"""Certificates of uncertain LPV models hold for every model of the set, and come close to the worst
of them.
"""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from models import constant, forged, random_uncertain, searched, uncertain_pole
from scipy.optimize import minimize_scalar

from symheli import LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import CertificateError, InputError, UnknownNameError
from symheli.lpv import PiecewiseLinear, Product
from synthesis import Certificate, decay_rate, frozen_gain, l2_gain, stability
from synthesis.analysis import Status, energy_to_peak
from synthesis.certify.assemble import bounded_real
from synthesis.certify.proof import inequalities, one_parameter
from synthesis.forms import HigherOrder, LaggedParameter, Spline
from synthesis.impose import SumOfSquares
from synthesis.numerics.linear.norm import norm

COARSE = Spline(segments=2, degree=2)
# the solver's tolerance on a squared gain and the room left for rounding are of order 1e-6
CLOSE = 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pole", "bound", "dt", "truth"),
    [
        (0.5, 0.499, 0.1, 1 / 0.001),
        (-1.0, 0.5, None, 1 / 0.5),
    ],
)
def test_a_pole_known_within_a_margin_has_the_gain_of_the_slowest(pole, bound, dt, truth):
    cert = l2_gain(uncertain_pole(pole, bound, dt))
    assert cert.lower == pytest.approx(truth, rel=1e-6)
    assert truth <= cert.gamma < (1 + CLOSE) * truth
    assert cert.verify(rigorous=True)
    assert stability(uncertain_pole(pole, bound, dt)).verify(rigorous=True)


@pytest.mark.slow
@pytest.mark.parametrize(("pole", "dt"), [(0.5, 0.1), (-1.0, None)])
def test_a_pole_that_may_be_unstable_has_no_certificate(pole, dt):
    unc = uncertain_pole(pole, 1.001 * (0.5 if dt else 1.0), dt)
    for cert in (l2_gain(unc), stability(unc)):
        assert (cert.status, cert.proof) == (Status.UNSTABLE, None)
        assert np.linalg.norm(cert.perturbation) <= unc.bound * (1 + 1e-12)
    # nor where nobody looks at the poles
    assert searched(unc, 0.5, "l2 gain").proof is None
    assert searched(unc, 0.5, "stability").proof is None


@pytest.mark.slow
def test_a_block_that_feeds_itself_counts_as_closed():
    """d = delta (x + j d) is delta/(1 - delta j) x; at delta j = 1 it is none."""
    a, b, j = 0.5, 0.2, 1.0
    unc = uncertain_pole(a, b, dt=0.1)
    D = np.zeros((unc.model.basis.size, 2, 2))
    D[:, 1, 1] = j * unc.model.basis.constant()
    unc = replace(unc, model=replace(unc.model, D=D))
    truth = 1 / (1 - a - b / (1 - b * j))
    cert = l2_gain(unc)
    assert cert.lower == pytest.approx(truth, rel=1e-6)
    assert truth <= cert.gamma < (1 + CLOSE) * truth
    assert cert.verify(rigorous=True)
    assert searched(unc.with_bound(1.01), 0.5, "l2 gain").proof is None


def scaled_norm(A, B, C, D, bound, dt):
    """The least gain g such that, for some t, (u, d) -> (y/g, t bound v) with d in units of t is a
    contraction: the bound by a constant scaling, with no LMI.
    """

    def largest(log_t, g):
        t = math.exp(log_t)
        into = np.r_[np.ones(2), np.full(2, 1 / t)]
        out = np.r_[np.full(2, 1 / g), np.full(3, t * bound)][:, None]
        return norm(A, B * into, C * out, D * into * out, dt)[0]

    def contracts(g):
        grid = np.linspace(-6, 6, 25)
        start = grid[np.argmin([largest(x, g) for x in grid])]
        found = minimize_scalar(
            lambda x: largest(x, g), bounds=(start - 0.5, start + 0.5), method="bounded"
        )
        return found.fun < 1

    low, high = 0.01, 1000.0
    while high / low > 1 + 1e-5:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if contracts(middle) else (middle, high)
    return high


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "dt"),
    [(1, None), (2, 0.1)],
)
def test_of_a_time_invariant_model_it_is_the_norm_with_the_best_scaling(seed, dt):
    unc = random_uncertain(seed, 0.3, dt)
    frozen = unc.model.at(0.4)
    model = constant(frozen.A, frozen.B, frozen.C, frozen.D, dt)
    model = replace(model, inputs=unc.model.inputs, outputs=unc.model.outputs)
    still = replace(unc, model=model)
    expected = scaled_norm(frozen.A, frozen.B, frozen.C, frozen.D, 0.3, dt)
    assert l2_gain(still, form=COARSE, search=None).gamma == pytest.approx(expected, rel=CLOSE)


@pytest.mark.slow
@pytest.mark.parametrize("dt", [None, pytest.param(0.1, marks=pytest.mark.slow)])
def test_without_perturbation_it_is_the_certificate_of_the_model(dt):
    for bound in (0.0, 1e-9):
        unc = random_uncertain(2, bound, dt)
        own = l2_gain(unc.nominal, form=COARSE, search=None).gamma
        assert l2_gain(unc, form=COARSE, search=None).gamma == pytest.approx(own, rel=CLOSE)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "dt"),
    [(1, None), (0, 0.1)],
)
def test_no_model_of_the_set_exceeds_the_bound_and_the_worst_one_found_is_one(seed, dt):
    unc = random_uncertain(seed, 0.3, dt)
    cert = l2_gain(unc, form=COARSE, search=None)
    assert cert.verified
    every = [*unc.draws(8, seed), *unc.draws(8, seed, "boundary")]
    gains = [frozen_gain(lpv, points=9).gain for lpv in every]
    worst = frozen_gain(unc.perturbed(cert.perturbation)).gain
    assert max(gains) <= worst == pytest.approx(cert.frozen, rel=1e-6)
    assert worst <= cert.lower <= cert.gamma


@pytest.mark.slow
def test_the_bound_holds_while_p_and_the_perturbation_move():
    unc = random_uncertain(1, 0.3, dt=0.1)
    cert = l2_gain(unc, form=COARSE, search=None)
    rng, count = np.random.default_rng(0), 400
    swing = unc.perturbations(2, seed=0, where="boundary")
    for period in (4, 9, 25):
        p = 0.5 + 0.5 * np.sin(2 * 0.3 * 0.1 * np.arange(count))  # as fast as it may be
        A, B, C, D = unc.model.matrices(p)
        x, energy, u = np.zeros(3), 0.0, rng.standard_normal((count, 2))
        u[count // 2 :] = 0.0
        for k in range(count):
            delta = swing[(k // period) % 2]
            d = delta @ (C[k, 2:] @ x + D[k, 2:, :2] @ u[k])
            w = np.concatenate([u[k], d])
            energy += float(np.sum((C[k, :2] @ x + D[k, :2] @ w) ** 2))
            x = A[k] @ x + B[k] @ w
        assert math.sqrt(energy) <= cert.gamma * np.linalg.norm(u)


@pytest.mark.slow
def test_the_rate_still_costs_around_a_block():
    unc = random_uncertain(0, 0.2)
    slow, fast = (l2_gain(unc, rate, form=COARSE, search=None) for rate in (0.0, 3.0))
    jump = l2_gain(unc, math.inf, search=None)
    # solver's tolerance
    assert slow.gamma <= fast.gamma * (1 + CLOSE) <= jump.gamma * (1 + 2 * CLOSE)
    for cert in (slow, fast, jump):
        assert cert.verify(rigorous=True)


@pytest.mark.slow
def test_a_larger_set_has_no_smaller_bound():
    gammas = [
        l2_gain(random_uncertain(2, bound), form=COARSE, search=None).gamma
        for bound in (0.1, 0.5, 1.0)
    ]
    assert gammas == sorted(gammas)


def hat(values):
    return np.asarray(values, dtype=float)[:, None, None]


def kinked(C, E):
    """dx/dt = -x + u + E d, v = C x on a basis that holds no products."""
    one = np.ones(3)
    model = LPVStateSpace(
        PiecewiseLinear((0.0, 0.4, 1.0)),
        *(hat(-one), np.concatenate([hat(one), hat(E)], 2), np.concatenate([hat(one), hat(C)], 1)),
        *(np.zeros((3, 2, 2)), (Scheduling("p", "1", 0.0, 1.0, 0.5),)),
        *(("x",), ("u", "d"), ("y", "v")),
    )
    return UncertainStateSpace(model, "d", "v", 0.5, 1.0, "by choice")


@pytest.mark.slow
def test_a_spline_that_holds_no_products_is_certified_too():
    cert = l2_gain(kinked([0.5, 1.0, 0.2], [1.0, 1.0, 1.0]))
    assert cert.lower == pytest.approx(2.0, rel=1e-6)  # 1/(1 - 0.5) at the kink
    assert cert.verify(rigorous=True)
    both = l2_gain(kinked([0.5, 1.0, 0.2], [0.5, 1.0, 0.2]))
    # no member can be written down, but each can be frozen
    assert both.lower == pytest.approx(2.0, rel=1e-6)
    assert 2.0 <= both.gamma < 2.0 * (1 + CLOSE)
    assert stability(kinked([1.0, 2.1, 1.0], [0.5, 1.0, 0.2])).status is Status.UNSTABLE


@pytest.mark.slow
def test_a_certificate_says_for_which_perturbations_and_with_what_promise():
    cert = l2_gain(uncertain_pole(0.5, 0.2, 0.1))
    text = cert.details
    assert "for every Delta (1 x 1) with |Delta|_2 <= 0.2, constant or moving in any way" in text
    assert "the bound on Delta holds with probability 0.95: a pole read off a plot" in text
    assert "multiplier of degree" in text


@pytest.mark.slow
def test_a_file_holds_the_multiplier_and_no_other_bound_than_its_words(tmp_path):
    cert = l2_gain(random_uncertain(2, 0.3, dt=0.1), form=COARSE, search=None)
    path = cert.save(tmp_path / "proof.json")
    loaded = Certificate.load(path)
    np.testing.assert_array_equal(loaded.lyapunov.multiplier, cert.lyapunov.multiplier)
    np.testing.assert_array_equal(loaded.perturbation, cert.perturbation)
    assert loaded.verify(rigorous=True)
    content = json.loads(path.read_text())
    content["proof"]["block"]["bound"] = 0.2
    path.write_text(json.dumps(content))
    with pytest.raises(CertificateError, match="for which perturbations"):
        Certificate.load(path)


@pytest.mark.slow
def test_files_from_before_there_were_blocks_are_read(tmp_path):
    cert = l2_gain(uncertain_pole(0.5, 0.0, 0.1).nominal, search=None)
    path = cert.save(tmp_path / "proof.json")
    content = json.loads(path.read_text())
    del content["perturbation"], content["proof"]["block"]
    del content["proof"]["units"]["multiplier"], content["proof"]["lyapunov"]["multiplier"]
    path.write_text(json.dumps(content))
    assert Certificate.load(path).verify(rigorous=True)


@pytest.mark.slow
def test_a_forged_block_or_multiplier_is_refused():
    cert = l2_gain(random_uncertain(2, 0.3), form=COARSE, search=None)
    evidence, P = cert.proof.evidence, cert.lyapunov
    block = evidence.block
    for change in (
        {"bound": 0.4},
        {"bound": math.nan},
        {"bound": -0.3},
        {"outputs": 9},
        {"inputs": 0},
    ):
        other = forged(cert, evidence=evidence._replace(block=block._replace(**change)))
        assert not other.verify(), change
        assert not other.verify(rigorous=True), change
    for evidently in (
        forged(cert, evidence=evidence._replace(block=None)),
        forged(cert, lyapunov=replace(P, multiplier=None)),
        forged(cert, lyapunov=replace(P, multiplier=0 * P.multiplier)),
        forged(cert, lyapunov=replace(P, multiplier=100 * P.multiplier)),
    ):
        assert not evidently.verify()
        assert not evidently.verify(rigorous=True)
    with pytest.raises(InputError, match="multiplier must be finite numbers >= 0"):
        replace(P, multiplier=-P.multiplier)
    with pytest.raises(InputError, match="multiple of that many coefficients and one"):
        replace(P, multiplier=P.multiplier[:-1])


@pytest.mark.slow
def test_half_a_block_in_search_and_proof_is_found_by_the_second_witness(monkeypatch):
    """An error that both would believe."""
    unc = random_uncertain(2, 1.0)
    assert l2_gain(unc, form=COARSE, search=None).verify(rigorous=True)
    terms, supply = bounded_real.supply_terms, inequalities._supply

    def halved(block):
        return block and block._replace(bound=0.5 * block.bound)

    monkeypatch.setattr(
        bounded_real,
        "supply_terms",
        lambda cell, m: terms(cell, m and m._replace(block=halved(m.block))),
    )
    monkeypatch.setattr(
        inequalities,
        "_supply",
        lambda model, region, P, block, number: supply(model, region, P, halved(block), number),
    )
    with monkeypatch.context() as blind:
        blind.setattr(one_parameter.IntervalEvidence, "on_grid", lambda *args: True)
        # the worst model is known, and would contradict it
        found = searched(unc, 0.3, "l2 gain", form=COARSE)
    assert found.proof.evidence.floating(found.proof.lyapunov, found.bound) is False
    assert found.proof.evidence.exact(found.proof.lyapunov, found.bound) is False


def two_parameters():
    """`uncertain_pole` over one more parameter."""
    unc = uncertain_pole(0.5, 0.2, 0.1)
    wider = unc.model.with_parameter(Scheduling("q", "1", 0.0, 1.0, 1.0))
    assert isinstance(wider.basis, Product)
    return replace(unc, model=wider)


@pytest.mark.parametrize(
    "ask",
    [
        lambda: l2_gain(two_parameters()),
        lambda: l2_gain(uncertain_pole(-1.0, 0.2), form=LaggedParameter(1.0)),
        lambda: stability(uncertain_pole(-1.0, 0.2), form=HigherOrder(2)),
        lambda: l2_gain(uncertain_pole(-1.0, 0.2), impose=SumOfSquares()),
        lambda: decay_rate(uncertain_pole(-1.0, 0.2)),
        lambda: energy_to_peak(uncertain_pole(-1.0, 0.2)),
    ],
)
def test_what_is_not_asked_of_a_set_is_refused_with_what_to_do(ask):
    with pytest.raises(InputError, match="an UncertainStateSpace is for l2_gain and stability"):
        ask()


@pytest.mark.slow
@pytest.mark.parametrize("dt", [None, pytest.param(0.1, marks=pytest.mark.slow)])
def test_the_method_for_many_states_finds_what_the_general_solver_finds(dt):
    unc = random_uncertain(1, 0.3, dt)
    own, general = (
        l2_gain(unc, form=COARSE, search=None, solver=solver) for solver in ("LYAPUNOV", "CLARABEL")
    )
    assert own.gamma == pytest.approx(general.gamma, rel=CLOSE)
    assert own.verify(rigorous=True)
    assert stability(unc, form=COARSE, search=None, solver="LYAPUNOV").verify(rigorous=True)
    wide = uncertain_pole(0.5, 0.6, 0.1)
    assert searched(wide, 0.5, "l2 gain", solver="LYAPUNOV").proof is None


def test_wrong_rates_and_channels_are_refused():
    unc = uncertain_pole(-1.0, 0.2)
    with pytest.raises(UnknownNameError, match="airspeed"):
        l2_gain(unc, {"airspeed": 1.0})
    with pytest.raises(InputError, match="a gain needs inputs and outputs, got 0 and 1"):
        l2_gain(unc.select(inputs=[]))
