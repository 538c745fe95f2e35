"""Several uncertain blocks beside a parameter that moves: a scaling for each."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from test_several_uncertain_things import RING, two_lags

from symheli import LinearModel, LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError
from symheli.lpv import connect
from symheli.lpv.uncertain_state_space import DeltaPart
from synthesis import frozen_gain, l2_gain, stability
from synthesis.forms import Spline
from synthesis.robust import DynamicBlock, robust_margin
from synthesis.robust.uncertain import uncertain

QUICK = {"search": None, "form": Spline(degree=1, segments=2)}


def loop(rate=0.5, seed=3):
    """Four states, A affine in p, with two blocks 1 x 1 and 2 x 1 and a channel u to y."""
    rng = np.random.default_rng(seed)
    A0, A1 = rng.standard_normal((2, 4, 4))
    A0 -= (np.linalg.eigvals(A0).real.max() + 1.0) * np.eye(4)
    B, C = rng.standard_normal((4, 4)), rng.standard_normal((3, 4))
    B[:, :1] *= 8  # channels of different units
    return LPVStateSpace.polynomial(
        [A0, 0.3 * A1],
        [B],
        [C],
        [np.zeros((3, 4))],
        Scheduling("p", "1", -1.0, 1.0, rate=rate),
        inputs=["a", "b1", "b2", "u"],
        outputs=["v", "w", "y"],
    )


BLOCKS = [DynamicBlock("a", "v", 0.05), DynamicBlock(["b1", "b2"], "w", 0.2)]


@pytest.mark.parametrize(("a", "b"), [(4.0, 0.25), (1.0, 1.0)])
def test_a_ring_of_two_in_closed_form(a, b):
    """mu = sqrt(a b) = 1, with D at its optimum; one full block would be lost at 1/max(a, b)."""
    for share, proven in ((0.998, True), (1.002, False)):
        loops = uncertain(two_lags(a, b), RING).with_bound(share)
        assert stability(loops, 1.0, **QUICK).verified is proven


@pytest.mark.slow
def test_the_optimum_of_constant_scalings_where_p_is_constant():
    """min over d of the largest gain of D M D^-1 of the frozen model, by a search of one number
    over Hamiltonian norms: an independent route. The margin is proven to .2 %.
    """
    model = loop()
    still = LPVStateSpace.constant(model.at(0.3), model.scheduling)
    found = robust_margin(still, BLOCKS, rate=1.0)
    by = {"v": 1 / 0.05, "w": 1 / 0.2}
    block = still.scaled(outputs=by).select(inputs=["a", "b1", "b2"], outputs=["v", "w"])

    def gain(x):
        d = math.exp(x)
        return frozen_gain(block.scaled({"a": d}, {"v": d}), points=2).gain

    optimum = 1 / minimize_scalar(gain, bounds=(-6, 6), method="bounded").fun
    assert found.lower == pytest.approx(optimum, rel=3e-3)
    assert found.lower <= optimum * (1 + 1e-6) <= found.upper * (1 + 1e-5)


@pytest.mark.slow
def test_what_is_borne_while_p_moves_is_less_than_frozen_and_more_than_in_jumps():
    margins = [robust_margin(loop(), BLOCKS, rate=rate) for rate in (0.0, 0.5, math.inf)]
    lower = [found.lower for found in margins]
    assert lower == sorted(lower, reverse=True)
    assert 0 < lower[-1] < 0.99 * lower[0]
    assert all(found.lower <= found.upper for found in margins)
    one = replace(uncertain(loop(), BLOCKS), parts=())
    assert robust_margin(one, rate=0.5).lower < 0.9 * lower[1]  # one full block covers both


@pytest.mark.slow
def test_no_member_has_more_than_the_gain_of_the_set():
    """Constant matrices, and an all-pass lag in place of a block of dynamics, along p(t)."""
    model = loop()
    unc = uncertain(model, BLOCKS).with_bound(0.6)
    cert = l2_gain(unc, search=None)
    assert cert.verified
    assert cert.verify(rigorous=True)
    for member in unc.draws(3, 1, "boundary"):
        assert l2_gain(member, search=None).frozen <= cert.gamma
    all_pass = LinearModel([[-2.0]], [[4.0]], [[-1.0]], [[1.0]], ["z"], ["v"], ["a"])
    into = {"a": {"a_out": 0.6 * 0.05}}
    late = replace(all_pass, outputs=("a_out",))
    closed = connect(model, late, inputs=["b1", "b2", "u"], outputs=["w", "y"], sums=into)
    assert abs(late.frequency_response([3.0]).item()) == pytest.approx(1.0)
    rest = uncertain(closed, BLOCKS[1:]).with_bound(0.6)
    assert l2_gain(rest, search=None).lower <= cert.gamma


def test_a_multiplier_of_dynamics_that_moves_proves_nothing():
    unc = uncertain(two_lags(2.0, 0.25), RING)
    cert = stability(unc, **QUICK)
    assert cert.verified
    assert np.ptp(cert.proof.lyapunov.multiplier, axis=0).max() == 0
    assert cert.proof.evidence.fault(cert.proof.lyapunov, "stability", cert.rates) is None
    moved = np.array(cert.proof.lyapunov.multiplier)
    moved[0] *= 1.001
    forged = replace(cert.proof.lyapunov, multiplier=moved)
    fault = cert.proof.evidence.fault(forged, "stability", cert.rates)
    assert "does not depend on p" in fault
    fewer = replace(cert.proof.lyapunov, multiplier=moved[:, :1])
    assert "each of 2 parts" in cert.proof.evidence.fault(fewer, "stability", cert.rates)


def test_functions_in_sectors_have_a_multiplier_each():
    """The ring through two functions of slope up to 1: stable up to a b = 1, whatever a/b."""
    loops = UncertainStateSpace.in_sector(two_lags(8.0, 0.1), ["d1", "d2"], ["v1", "v2"], -1.0, 1.0)
    assert loops.parts == (DeltaPart(1, 1), DeltaPart(1, 1))
    assert stability(loops, **QUICK).verified
    assert not stability(replace(loops, parts=()), **QUICK).verified


def test_a_block_beside_one_that_the_model_has():
    first = uncertain(two_lags(4.0, 0.25), RING[:1], "a promise")
    both = uncertain(first.with_bound(0.5), RING[1:])
    assert both.bound == 1.0
    assert both.source.startswith("a promise; ")
    # the first counts half: mu = sqrt(1/2)
    assert stability(both.with_bound(0.99 * math.sqrt(2)), **QUICK).verified
    draws = both.perturbations(4, 0)
    assert np.all(draws[:, 0, 1] == 0)
    assert np.all(draws[:, 1, 0] == 0)
    with pytest.raises(InputError, match="outside its parts"):
        both.perturbed([[0.1, 0.1], [0.0, 0.1]])


@pytest.mark.parametrize(
    ("parts", "words"),
    [(((1, 1),), "make a Delta of"), (((2, 1), (0, 1)), "at least 1 x 1")],
)
def test_parts_that_are_not_those_of_delta_are_refused(parts, words):
    unc = uncertain(two_lags(1.0, 1.0), RING)
    with pytest.raises(InputError, match=words):
        replace(unc, parts=parts)


def test_blocks_of_no_lpv_model_are_refused():
    with pytest.raises(InputError, match="expected an LPVStateSpace"):
        uncertain(two_lags(1.0, 1.0).to_lft(), RING)
    with pytest.raises(InputError, match="expected one or more"):
        uncertain(two_lags(1.0, 1.0), [])
