"""The algebra under the LMIs: identities of Bernstein forms, coverage of the band of p and its next
value.
"""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from models import lag, random_stable

from synthesis.certify.proof.inequalities import Statement, lmi_polynomials
from synthesis.certify.statement.spline import SplineLyapunov, graded_knots
from synthesis.numerics.polynomial.bernstein import blossom, composition, restriction
from synthesis.numerics.polynomial.cells import strips
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.polynomial.pieces import ModelPiece, model_pieces, pieces
from synthesis.numerics.polynomial.symmetric import smat, svec


def value(F, x, s=0.0):
    a = blossom([x] * (F.shape[0] - 1))
    b = blossom([s] * (F.shape[1] - 1))
    return np.einsum("i,k,iknm->nm", a, b, F)


def test_products_and_elevations_keep_their_values():
    rng = np.random.default_rng(0)
    f, g = rng.standard_normal((4, 2, 2, 3)), rng.standard_normal((3, 3, 3, 2))
    F, G = (PolynomialMatrix(((0.0, 1.0), (0.0, 1.0)), c) for c in (f, g))
    product, raised = (F @ G).coefficients, F.elevate((6, 4)).coefficients
    for x, s in rng.uniform(0, 1, (5, 2)):
        assert np.allclose(value(product, x, s), value(f, x, s) @ value(g, x, s), atol=1e-12)
        assert np.allclose(value(raised, x, s), value(f, x, s), atol=1e-12)


def test_restriction_and_composition_are_the_same_polynomial_elsewhere():
    rng = np.random.default_rng(1)
    f = rng.standard_normal(4)
    part = restriction(3, 0.2, 0.7) @ f
    corners = [[0.1, 0.4], [0.3, 0.9]]
    both = composition(3, corners) @ f
    for x, s in rng.uniform(0, 1, (5, 2)):
        assert blossom([x] * 3) @ part == pytest.approx(blossom([0.2 + 0.5 * x] * 3) @ f)
        t = (1 - x) * ((1 - s) * 0.1 + s * 0.4) + x * ((1 - s) * 0.3 + s * 0.9)
        assert blossom([x] * 3) @ both @ blossom([s] * 3) == pytest.approx(blossom([t] * 3) @ f)


def test_rational_arithmetic_is_exact():
    third = Fraction(1, 3)
    assert list(
        restriction(1, third, 2 * third) @ np.array([Fraction(0), Fraction(1)], dtype=object)
    ) == [third, 2 * third]


def test_vectors_keep_inner_products():
    rng = np.random.default_rng(2)
    M, N = (a + np.swapaxes(a, 1, 2) for a in rng.standard_normal((2, 3, 4, 4)))
    assert np.allclose(np.sum(svec(M) * svec(N), axis=1), np.einsum("kij,kij->k", M, N))
    assert np.allclose(smat(svec(M), 4), M)


def test_model_pieces_give_back_the_model():
    lpv = random_stable(0)
    (piece,) = model_pieces(lpv)
    for x in (0.0, 0.3, 1.0):
        assert np.allclose(value(piece.A[:, None], x), lpv.at(x).A, atol=1e-13)
    assert len(piece.C) == 1, "a constant matrix has degree 0"


@pytest.mark.parametrize("step", [0.01, 0.07, 0.4, 5.0])
def test_strips_cover_every_p_and_next_p_inside_the_right_segment(step):
    knots = graded_knots(0.0, 1.0, 6, 2.0)
    regions = strips(model_pieces(lag()), knots, (-step, step))
    rng = np.random.default_rng(3)
    for p, d in zip(rng.uniform(0, 1, 400), rng.uniform(-1, 1, 400), strict=True):
        after = float(np.clip(p + d * step, 0, 1))
        hit = []
        for strip in regions:
            cell = strip.cell
            if cell.low <= p <= cell.high:
                x = (p - cell.low) / (cell.high - cell.low)
                bottom, top = (
                    (1 - x) * strip.corners[0][f] + x * strip.corners[1][f] for f in (0, 1)
                )
                if bottom <= after <= top:
                    hit.append(strip)
        assert hit, (p, after)
        assert all(knots[s.next_segment] <= after <= knots[s.next_segment + 1] for s in hit)
        assert all(knots[s.cell.segment] <= p <= knots[s.cell.segment + 1] for s in hit)


@pytest.mark.parametrize("low", [0.0, 1e6, -3e9])
def test_strips_cover_every_next_p_in_exact_arithmetic_however_far_from_zero(low):
    """Of a band that is only as wide as some digits of p, no sliver is left out by rounding."""
    width = 1024 * float(np.spacing(max(abs(low), 1.0)))
    knots = low + width * np.array([0.0, 0.25, 0.5, 1.0])
    nothing = np.zeros((1, 0, 0))
    piece = ModelPiece(knots[0], knots[-1], nothing, nothing, nothing, nothing)
    step = width * 0.1008  # 103.2 units in the last place of p
    regions = strips((piece,), knots, (-step, step))
    rng = np.random.default_rng(0)
    ends = Fraction(knots[0]), Fraction(knots[-1])
    for p in (*rng.uniform(*knots[[0, -1]], 60), *(s.cell.low for s in regions)):
        p = Fraction(float(p))
        reached = []
        for strip in regions:
            a, b = Fraction(strip.cell.low), Fraction(strip.cell.high)
            if a <= p <= b:
                (c, d), (e, f) = strip.corners
                x = (p - a) / (b - a)
                reached.append(
                    tuple((1 - x) * Fraction(at) + x * Fraction(to) for at, to in ((c, e), (d, f)))
                )
        least, most = max(p - Fraction(step), ends[0]), min(p + Fraction(step), ends[1])
        cells_at_p = sorted(reached)
        assert cells_at_p[0][0] <= least
        assert max(top for _, top in cells_at_p) >= most
        for below, above in pairwise(cells_at_p):
            assert above[0] <= below[1]


@pytest.mark.parametrize("dt", [None, 0.1])
def test_lmi_polynomials_are_the_lmi_at_every_point(dt):
    lpv = random_stable(5, dt=dt)
    rng = np.random.default_rng(4)
    coefficients = rng.standard_normal((5, 3, 3))
    P = SplineLyapunov(
        np.array([0.0, 0.25, 1.0]), 2, coefficients + np.swapaxes(coefficients, 1, 2)
    )
    forms = [form.block for form in lmi_polynomials(Statement(pieces(lpv), P, 0.7), float)]
    p = 0.6
    A, B, C, D = lpv.matrices(p)
    Y = np.hstack([C, D])
    if dt is None:
        assert len(forms) == 4
        for form, nu in zip(forms[2:], (-0.7, 0.7), strict=True):
            top = A.T @ P.at(p) + P.at(p) @ A + nu * P.derivative(p)
            expected = np.block([[top, P.at(p) @ B], [B.T @ P.at(p), np.zeros((2, 2))]]) + Y.T @ Y
            assert np.allclose(form([p]), expected, atol=1e-10)
    else:
        M, corner = np.hstack([A, B]), np.zeros((5, 5))
        corner[:3, :3] = P.at(p)
        regions = strips(model_pieces(lpv), P.knots, (-0.07, 0.07))
        k = next(i for i, s in enumerate(regions) if s.cell.low < p < s.cell.high)
        s = 0.8
        after = (1 - s) * (p - 0.07) + s * (p + 0.07)
        assert np.allclose(forms[k]([p, s]), M.T @ P.at(after) @ M - corner + Y.T @ Y, atol=1e-9)


def test_graded_knots_move_onto_breaks_of_the_model_and_keep_their_distance():
    knots = graded_knots(0.0, 13.0, 8, 2.0, breaks=[6.5, 3.0])
    assert 3.0 in knots or 6.5 in knots
    assert np.all(np.diff(knots) > 0)
    assert knots[1] < 0.3, "graded towards the low end"
    assert np.diff(graded_knots(0.0, 13.0, 16, 2.0, shortest=0.5)).min() >= 0.5
