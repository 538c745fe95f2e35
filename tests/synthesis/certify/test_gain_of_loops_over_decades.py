"""The proven gain of a loop that does not depend on p is its norm, whatever its poles and units."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.loops_over_decades import loop
from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from synthesis import Certificate, l2_gain
from synthesis.certify.questions.apart import apart
from synthesis.forms import Spline
from synthesis.numerics.program.answer import Answer

RATE = 0.1
CLOSE = 1.01
QUICK = (2, 3, 7, 11)
"""Of every kind, with units of many decades."""
ROUNDED = {758: 1.02}
"""A loop of 12 states of which A has a condition of 1e16: doubles in the units of the model leave
no P any margin, those in coordinates of P leave some.
"""


def proven(seed, dependence):
    own = loop(seed)
    return l2_gain(own.scheduled(dependence, RATE, seed), search=None), own.norm


@pytest.mark.slow(but="11")
@pytest.mark.parametrize("seed", QUICK)
def test_the_proven_gain_of_a_time_invariant_loop_is_its_norm(seed):
    certificate, norm = proven(seed, "none")
    # the response at one frequency is below the norm, a proof above it
    assert norm * (1 - 1e-12) <= certificate.gamma <= CLOSE * norm
    assert certificate.verify(rigorous=True)


def test_a_form_in_coordinates_of_its_own_is_proven_as_it_is(tmp_path):
    certificate, _ = proven(11, "none")
    units, P = certificate.proof.evidence.units, certificate.lyapunov
    own = P.in_units(units.right).kept_in(units.left)
    # rounding, of coordinates with a condition of 1e3 or so
    assert own.at(0.3) == pytest.approx(P.at(0.3), rel=1e-9, abs=1e-9 * np.abs(P.at(0.3)).max())
    assert P.degree == own.degree == 0

    def with_form(form):
        proof = certificate.proof._replace(lyapunov=form)
        return replace(certificate, proof=proof, gamma=1.001 * certificate.gamma)

    saved = Certificate.load(with_form(own).save(tmp_path / "proof.json"))
    assert np.array_equal(saved.lyapunov.coordinates, units.left)
    assert saved.verify(rigorous=True)
    # half the storage does not pay for the gain, and singular coordinates make no form
    half, flat = replace(own, coefficients=0.5 * own.coefficients), own.kept_in(0 * units.left)
    assert not with_form(half).verify(rigorous=True)
    assert not with_form(flat).verify(rigorous=True)
    with pytest.raises(InputError, match="coordinates must be a finite matrix"):
        own.kept_in(units.left[1:])


@pytest.mark.slow
def test_a_loop_whose_storage_function_no_double_holds_is_proven():
    certificate, norm = proven(769, "none")
    assert norm <= certificate.gamma <= CLOSE * norm
    assert certificate.lyapunov.coordinates is not None
    assert certificate.verify(rigorous=True)


@pytest.mark.slow
@pytest.mark.parametrize("first", [100])
def test_loops_are_proven_within_a_hundredth(first):
    found = {seed: proven(seed, "none") for seed in range(first, first + 20)}
    far = {s: c.gamma / norm for s, (c, norm) in found.items() if not c.gamma <= CLOSE * norm}
    assert all(ratio <= ROUNDED.get(seed, CLOSE) for seed, ratio in far.items()), far
    assert all(c.gamma >= norm * (1 - 1e-12) for c, norm in found.values())


@pytest.mark.slow
@pytest.mark.parametrize("first", [0])
def test_a_dependence_on_p_that_leaves_the_gain_leaves_the_proof(first):
    found = {seed: proven(seed, "hidden") for seed in range(first, first + 8)}
    assert not {s: c.gamma / n for s, (c, n) in found.items() if not c.gamma <= CLOSE * n}
    assert all(math.isfinite(c.gamma) for c, _ in found.values())


@pytest.mark.slow
def test_a_bound_far_above_what_trajectories_show_names_its_cause():
    p = Scheduling("p", "1", 0.0, 1.0, rate=0.01)
    # a spring that stiffens slowly
    A = [[[0.0, 1.0], [-1.0, -0.5]], [[0.0, 0.0], [-1.0, 0.0]]]
    constant = ([[[0.0], [1.0]]], [[[1.0, 0.0]]], [[[0.0]]])
    lpv = LPVStateSpace.polynomial(A, *constant, p)
    certificate = l2_gain(lpv, form=Spline(degree=0), search=None)
    assert certificate.gamma > 1.05 * certificate.lower
    (cause,) = [h for h in certificate.hypotheses if "apart" in h]
    assert "of the model frozen at mid-range the same program finds the gain" in cause
    # as P varies the bound falls: it was its class
    assert l2_gain(lpv, search=None).gamma < 0.99 * certificate.gamma


@pytest.mark.parametrize(
    ("rounding", "answer", "cause"),
    [
        (0.5, Answer.SOLVED, "rounding limits the bound"),
        (math.inf, Answer.SOLVED, "rounding limits the bound"),
        (1e-4, Answer.FAILED, "the search did not converge"),
        (1e-4, Answer.SOLVED, "P of a higher degree"),
        # where no frozen model was solved it is not blamed
        (math.nan, Answer.FAILED, "the search did not converge"),
        (math.nan, Answer.SOLVED, "P of a higher degree"),
    ],
)
def test_the_causes_are_told_apart(rounding, answer, cause):
    (said,) = apart(2.0, 1.0, rounding, answer)
    assert cause in said
    assert not apart(1.04, 1.0, rounding, answer)
    assert not apart(math.inf, 1.0, rounding, answer)
