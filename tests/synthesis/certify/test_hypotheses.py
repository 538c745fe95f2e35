"""What a certificate rests on can be read in it."""

from dataclasses import replace

import numpy as np
import pytest
from models import lag, spring

from symheli import LPVStateSpace, Scheduling
from symheli.lpv.lpv_state_space import FitResiduals
from synthesis import decay_rate, l2_gain, lft_gain, stability
from synthesis.certify.questions.hypotheses import fitted
from synthesis.forms import Spline
from synthesis.impose import SumOfSquares

COARSE = Spline(segments=2, degree=2)
SOS = {"form": Spline(degree=1, segments=1), "impose": SumOfSquares()}


@pytest.mark.slow(only="l2_gain-options0")
@pytest.mark.parametrize("options", [{"form": COARSE}, SOS])
@pytest.mark.parametrize("analysis", [l2_gain, stability])
def test_the_misfit_of_a_fitted_model_is_among_the_hypotheses(analysis, options):
    lpv = lag()
    s = lpv.scheduling
    # the family had 2 % more in A at one node, and only that: A is -1 .. -2
    off = [np.zeros((3, *M.shape[1:])) for M in (lpv.A, lpv.B, lpv.C, lpv.D)]
    off[0][1, 0, 0] = 0.04
    text = analysis(
        replace(lpv, residuals=FitResiduals(np.linspace(s.low, s.high, 3), *off)),
        **options,
        search=None,
    ).details
    assert (
        "differs from what it was fitted to by at most 2 % of its largest value, 2, from x1 to x1"
        in text
    )
    assert "fitted to" not in analysis(lpv, **options, search=None).details


def test_rounding_of_a_row_is_no_misfit():
    """A servo driven by the command of another by 1e-18, all of it misfit, beside a misfit of
    0.1 %.
    """
    s = Scheduling("p", "1", 0.0, 1.0, rate=1.0)
    A, B = [[-1.0, 0.5], [0.0, -20.0]], [[0.0, 0.0], [20.0, 1e-18]]
    names = {"states": ("q", "servo"), "inputs": ("mine", "other"), "outputs": ("y",)}
    model = LPVStateSpace.polynomial([A], [B], [[[1.0, 0.0]]], [[[0.0, 0.0]]], s, **names)
    off = [np.zeros((2, *M.shape[1:])) for M in (model.A, model.B, model.C, model.D)]
    off[0][1, 0, 1], off[1][0, 1, 1] = 0.0005, 1e-18
    (said,) = fitted(replace(model, residuals=FitResiduals(np.array([0.0, 1.0]), *off)))
    assert said.endswith(
        "by at most 0.1 % of its largest value, 0.5, from servo to q, which"
        " is 0.05 % of the largest entry of its row"
    )


def test_the_misfit_of_a_sampled_model_is_measured_from_its_own_samples():
    lpv = spring(damping=0.4).discretize(1.0)
    text = l2_gain(lpv, 0.1, form=COARSE, search=None).details
    # by another route: the zero-order hold at the nodes of the fit
    p = -np.cos(np.pi * np.arange(41) / 40)
    exact = np.array([spring(damping=0.4).at(q).discretize(1.0).A for q in p])
    own = lpv.matrices(p).A
    worst = (np.abs(own - exact).max(axis=0) / np.abs(own).max(axis=0)).max()
    assert "the sampled model (p held over each 1 s, entries fitted in p)" in text
    assert f"at most {100 * worst:.2g} %" in text


@pytest.mark.parametrize(
    "change",
    [lambda m: m.feedback({("u1", "y1"): -0.5}), lambda m: m.discretize(0.2)],
    ids=["closed", "sampled"],
)
def test_the_misfit_survives_closing_a_loop_and_sampling(change):
    """What a closed or sampled fit is off by is what the same loop, or hold, makes of the
    family.
    """
    lpv = lag()
    nodes = np.linspace(lpv.scheduling.low, lpv.scheduling.high, 3)
    exact = lpv.matrices(nodes)
    fitted = lpv.with_residuals(nodes, exact._replace(A=exact.A - 0.1 * nodes[:, None, None]))
    changed = change(fitted)
    for k, p in enumerate(nodes):
        plain = LPVStateSpace.polynomial(
            [exact.A[k] - 0.1 * p],
            [exact.B[k]],
            [exact.C[k]],
            [exact.D[k]],
            scheduling=lpv.scheduling,
        )
        off = changed.at(p).A - change(plain).at(p).A
        np.testing.assert_allclose(changed.residuals.A[k - len(nodes)], off, atol=1e-12)
    assert "fitted to by at most" in stability(changed, form=COARSE, search=None).details


def test_what_is_trusted_is_said():
    for cert in (
        l2_gain(lag(), form=COARSE, search=None),
        decay_rate(lag(), **SOS, search=None),
    ):
        assert "through the model's own matrices" in cert.details
        assert "are shared by the search for P and the proof" in cert.details
    assert "only the matrices of the LFT are shared" in (
        lft_gain(lag().to_lft().reduce(), search=None).details
    )
