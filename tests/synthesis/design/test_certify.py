"""The proof of a controller: by the adjoint of its loop where that is as good, and only there."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scheduled_plants import RATE, spring

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from synthesis import l2_gain, lower_bound, output_feedback
from synthesis.analysis import LowerBoundSearch
from synthesis.certify.questions.adjoint import ADJOINT, FAR_ABOVE, backwards
from synthesis.certify.questions.problem import pose
from synthesis.certify.statement.spline import MemoryLyapunov
from synthesis.forms import LaggedParameter, Spline

GLANCE = LowerBoundSearch(levels=6, dwells=5, starts=1, nodes=30, evaluations=8, samples=5000)


@pytest.fixture(scope="module")
def made():
    return output_feedback(spring(), RATE, X=0, Y=2)


@pytest.fixture(scope="module")
def loop(made):
    return made.closed()


def test_the_adjoint_has_the_transposed_responses_and_its_adjoint_is_the_model(loop):
    omega = np.array([0.1, 1.0, 7.0])
    there = loop.adjoint().at(0.3).frequency_response(omega)
    np.testing.assert_allclose(
        np.swapaxes(there, 1, 2), loop.at(0.3).frequency_response(omega), rtol=1e-12, atol=1e-14
    )
    back = loop.adjoint().adjoint()
    assert (back.inputs, back.outputs) == (loop.inputs, loop.outputs)
    for one, other in zip(back.matrices(0.7), loop.matrices(0.7), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.slow
@pytest.mark.parametrize("dt", [None, pytest.param(0.05, marks=pytest.mark.slow)])
def test_the_gain_of_the_adjoint_is_that_of_the_loop(loop, dt):
    """Both bounds enclose the same number: rich forms of P come within a percent of one another,
    and nothing flown on the one exceeds what is proven of the other.
    """
    model = loop if dt is None else loop.discretize(dt, degree=6)
    form = Spline(degree=2, segments=8)
    own, turned = (l2_gain(m, 2.0, form=form, search=None) for m in (model, model.adjoint()))
    assert own.verified
    assert turned.verified
    assert turned.gamma == pytest.approx(own.gamma, rel=1e-2)
    assert lower_bound(model, 2.0, search=GLANCE).gain <= turned.gamma


@pytest.mark.slow
def test_a_controller_is_proven_by_the_adjoint_where_y_moves(made):
    proof = made.certify(RATE, search=None)
    assert ADJOINT in proof.hypotheses
    assert proof.gamma <= made.promised * (1 + 1e-6)
    fixed = output_feedback(spring(), RATE, X=2, Y=0)
    assert ADJOINT not in fixed.certify(RATE, search=None).hypotheses


def wandering():
    """b c = (2 - p)(1 + p): the gain of the moving p is above the worst frozen one."""
    p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    B, C = [[[2.0]], [[-1.0]]], [[[1.0]], [[1.0]]]
    return LPVStateSpace.polynomial([[[-1.0]]], B, C, [[[0.0]]], p)


@pytest.mark.slow
def test_a_gain_far_above_the_frozen_one_is_looked_for_of_the_adjoint_too(monkeypatch):
    alone = l2_gain(wandering(), search=None)
    assert alone.gamma < FAR_ABOVE * alone.frozen
    assert ADJOINT not in alone.hypotheses
    monkeypatch.setattr("synthesis.certify.questions.certify.FAR_ABOVE", 1.0)
    both = l2_gain(wandering(), search=None)
    # the lower of two proven gains, and the programs of both
    assert both.gamma <= alone.gamma
    assert both.verify(rigorous=True)
    assert len(both.attempts) > len(alone.attempts)


@pytest.mark.parametrize(
    ("kind", "rate", "form", "tried"),
    [
        ("l2 gain", 0.5, None, True),
        # what the user chose is done as it is
        ("l2 gain", 0.5, Spline(), False),
        # P is constant: its inverse proves the same
        ("l2 gain", math.inf, None, False),
        ("decay rate", 0.5, None, False),
    ],
)
def test_when_the_adjoint_is_of_use(kind, rate, form, tried):
    problem = backwards(pose(wandering(), rate, kind, form, None, None, None))
    assert (problem is not None) == tried
    if problem:
        assert np.array_equal(problem.model.source.B, wandering().C)
        assert backwards(problem) is None


def test_a_rate_that_is_another_parameter_is_not_turned_around(loop):
    wide = loop.with_parameter(Scheduling("acceleration", "1/s", -0.5, 0.5, rate=1.0))
    with pytest.raises(InputError, match="backwards the rate of p is not acceleration"):
        wide.with_rate({"p": "acceleration"}).adjoint()


@pytest.mark.slow
def test_nor_where_the_rate_is_said_with_the_question():
    wide = spring().model.with_parameter(Scheduling("acceleration", "1/s", -0.5, 0.5, rate=1.0))
    own = spring()
    plant = type(own)(
        wide,
        disturbances=own.disturbances,
        performance=own.performance,
        controls=own.controls,
        measurements=own.measurements,
    )
    made = output_feedback(plant, {"p": RATE, "acceleration": 1.0}, X=0, Y=(2, 0))
    assert made.by_adjoint
    proof = made.certify({"p": "acceleration"}, search=None, form=Spline(degree=(2, 0), segments=1))
    assert ADJOINT not in proof.hypotheses


@pytest.mark.slow
def test_another_form_or_solver_is_taken_as_it_is_asked_for(made):
    proof = made.certify(RATE, search=None, form=LaggedParameter(0.5, segments=2))
    assert isinstance(proof.lyapunov, MemoryLyapunov)
    assert "CLARABEL" in made.certify(RATE, search=None, solver="CLARABEL").solver
