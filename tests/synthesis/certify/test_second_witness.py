"""An error that the search for P and the proof of P share is found by the second witness: `verify`
says no.
"""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from models import random_stable, spring

from symheli import LPVStateSpace, Scheduling
from symheli.errors import CertificateError
from synthesis import decay_rate, h2_gain, l2_gain, stability
from synthesis.analysis import energy_to_peak
from synthesis.certify.assemble import box as program
from synthesis.certify.assemble import unknowns as forms
from synthesis.certify.proof import box as proof
from synthesis.certify.proof import inequalities
from synthesis.certify.proof import one_parameter as verify
from synthesis.certify.questions import admitted_bound
from synthesis.forms import HigherOrder, LaggedParameter, Spline
from synthesis.impose import SumOfSquares
from synthesis.numerics.polynomial import pieces, regions

pytestmark = pytest.mark.guard

COARSE = Spline(segments=4, degree=2, grading=1.0)
BOX = {"form": Spline(segments=4, degree=2, grading=1.0), "impose": SumOfSquares()}


def two_ends(rate, dt=None):
    """The input acts at one end of p and is seen at the other: P must vary, and pays for it where p
    moves.
    """
    a = -1.0 if dt is None else 0.6
    return LPVStateSpace.polynomial(
        [[[a]]],
        [[[2.0]], [[-1.0]]],
        [[[1.0]], [[1.0]]],
        [[[0.0]]],
        Scheduling("p", "1", -1.0, 2.0, rate),
        dt=dt,
    )


def everywhere(monkeypatch, name, mutant, *modules):
    for module in modules:
        monkeypatch.setattr(module, name, mutant)


def forget_the_rate(monkeypatch):
    """dP/dt left out of assembly and proof."""
    blocks, decrease = forms.continuous_blocks, program.decrease
    monkeypatch.setattr(
        forms,
        "continuous_blocks",
        lambda cells, knots, degree, rate, *rest: blocks(cells, knots, degree, 0.0, *rest),
    )

    def still(model, region, P, demand, number, level=0):
        resting = demand.motion._replace(rates=tuple(0.0 for _ in demand.rates))
        return decrease(model, region, P, demand._replace(motion=resting), number, level)

    everywhere(monkeypatch, "decrease", still, inequalities, program, proof, admitted_bound)


def flip_a_sign(monkeypatch):
    """The drift has one sign only."""
    blocks, decrease = forms.continuous_blocks, program.decrease
    monkeypatch.setattr(forms, "continuous_blocks", lambda *args: list(blocks(*args))[::2])
    everywhere(
        monkeypatch,
        "decrease",
        lambda *args: list(decrease(*args))[:1],
        *(inequalities, program, proof, admitted_bound),
    )


def drop_strips(monkeypatch):
    """p(k+1) stays on its segment."""
    strips = regions.strips

    def fewer(pieces, knots, span, cuts=()):
        return tuple(
            s for s in strips(pieces, knots, span, cuts) if s.next_segment == s.cell.segment
        )

    everywhere(monkeypatch, "strips", fewer, forms, regions)


def drop_cells(monkeypatch):
    """The second half of the range is not looked at."""
    cells, strips = forms.cells, regions.strips
    monkeypatch.setattr(forms, "cells", lambda *args: cells(*args)[: len(cells(*args)) // 2])
    monkeypatch.setattr(regions, "strips", lambda *args: strips(*args)[: len(strips(*args)) // 2])


def perturb_a_weight(monkeypatch):
    """The middle coefficients of every piece of the model are smaller by a tenth."""
    original = pieces.model_pieces

    def weaker(lpv):
        return tuple(
            q._replace(**{name: _weakened(getattr(q, name)) for name in "ABCD"})
            for q in original(lpv)
        )

    everywhere(monkeypatch, "model_pieces", weaker, forms, verify, pieces)


def _weakened(coefficients):
    out = coefficients.copy()
    out[1:-1] *= 0.9
    return out


CASES = {
    "forget the rate": (forget_the_rate, lambda: two_ends(3.0)),
    "flip a sign": (flip_a_sign, lambda: two_ends(3.0)),
    "drop strips": (drop_strips, lambda: two_ends(1.0, dt=0.3)),
    "drop cells": (drop_cells, lambda: two_ends(3.0)),
    "perturb a weight": (perturb_a_weight, lambda: random_stable(3)),
}
ANALYSES = {
    "splines": lambda lpv: l2_gain(lpv, form=COARSE, search=None),
    "box": lambda lpv: l2_gain(lpv, **BOX, search=None),
    "energy to peak": lambda lpv: energy_to_peak(no_feedthrough(lpv), **BOX, search=None),
    "variance": lambda lpv: h2_gain(no_feedthrough(lpv), **BOX, search=None),
}


def no_feedthrough(lpv):
    return replace(lpv, D=0 * lpv.D)


REPEATED = {
    *(("perturb a weight", "box"), ("drop strips", "box")),
    *(("perturb a weight", "variance"), ("drop strips", "variance")),
}
"""Analyses of one solver, of which "energy to peak" is the richer."""


@pytest.mark.parametrize(
    ("case", "analysis"),
    [pair for pair in product(CASES, ANALYSES) if pair not in REPEATED],
)
def test_an_error_shared_by_assembly_and_proof_is_found(case, analysis, monkeypatch):
    mutate, model = CASES[case]
    assert ANALYSES[analysis](model()).verify(rigorous=True)
    mutate(monkeypatch)
    # the witness in floating point is kept out, so that what the mutant believes becomes a
    # certificate
    with monkeypatch.context() as blind:
        blind.setattr(verify.IntervalEvidence, "on_grid", lambda *args: True)
        blind.setattr(proof.BoxEvidence, "on_grid", lambda *args: True)
        try:
            cert = ANALYSES[analysis](model())
        except CertificateError:
            # so wrong that it contradicts the frozen model
            return
    assert cert.proof is not None, "the mutant found nothing"
    judge, P = cert.proof
    number = verify.rational()
    believed = (
        verify.proven(judge._statement(P), cert.gamma)
        if analysis == "splines"
        else all(
            map(
                proof.negative_definite_exactly,
                proof.polynomials(judge.model, P, judge.demand, cert.gamma, number),
            )
        )
    )
    assert believed, "the mutant does not believe itself: this tests nothing"
    assert not cert.verify(rigorous=True)


def test_the_witness_of_the_decay_and_of_higher_degrees_looks_too(monkeypatch):
    decay = decay_rate(spring(damping=0.4), 0.2, **BOX, search=None)
    quartic = stability(spring(damping=0.4), 0.2, form=HigherOrder(2, segments=2), search=None)
    memory = l2_gain(
        spring(damping=0.4),
        0.5,
        form=LaggedParameter(1.0, segments=3, degree=2),
        search=None,
    )
    for cert in (decay, quartic, memory):
        assert cert.verify(rigorous=True)
        judge, P = cert.proof
        assert judge.checked_independently(P, cert.bound, verify.rational())
        # the same P against a model that grows: without proof and pieces the witness must see it
        lpv = judge.model.source if cert is decay else judge.lpv
        grows = replace(
            lpv, A=lpv.A + np.array([np.eye(2) * 0.5, *(np.zeros((2, 2)) for _ in lpv.A[1:])])
        )
        with monkeypatch.context() as blind:
            blind.setattr(type(judge), "_reproduced", lambda *args: True)
            other = (
                judge._replace(model=judge.model._replace(source=grows))
                if cert is decay
                else judge._replace(lpv=grows)
            )
            assert not other.checked_independently(P, cert.bound, verify.rational())
