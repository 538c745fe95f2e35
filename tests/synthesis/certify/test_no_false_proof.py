"""Models built so that a constant somewhere in the program might overlook what makes them unstable
or large: nothing false is proven of them, by any route.
"""

import json
from dataclasses import replace

import numpy as np
import pytest

from symheli import LPVStateSpace, Scheduling
from symheli.errors import CertificateError, InputError
from symheli.lpv import PiecewiseLinear, Polynomial, Product
from symheli.lpv.bases import Patches
from symheli.lpv.bases.spaces import product_space, sum_space
from synthesis import Certificate, l2_gain, stability
from synthesis.certify.assemble.unknowns import scaled_problem
from synthesis.certify.proof import box, one_parameter
from synthesis.certify.statement.box import BoxLyapunov
from synthesis.certify.statement.demand import Demand
from synthesis.certify.statement.kind import DECAY_RATE, STABILITY
from synthesis.certify.statement.spline import SplineLyapunov
from synthesis.certify.statement.units import Scaling
from synthesis.forms import Spline
from synthesis.impose import SumOfSquares
from synthesis.numerics.polynomial.motion import Motion
from synthesis.numerics.polynomial.pieces import model_pieces, pieces

PLACE = 0.5123
"""Of the narrow piece: no point of a usual grid."""
ROUTES = pytest.mark.parametrize("impose", [None, SumOfSquares()], ids=["one parameter", "box"])
CONSTANT = Spline(degree=0)


def through_narrow_pieces(width, A=None, B=1.0, dt=None, others=()):
    """dx/dt = a x + b u, y = x, a = -1 (sampled .5) and b = 1, but for lines to `A` and `B` at
    PLACE and back within `width`; over `others` too, on which nothing depends.
    """
    basis = PiecewiseLinear((0.0, PLACE - width, PLACE, PLACE + width, 1.0))
    rest = -1.0 if dt is None else 0.5

    def hat(outside, at):
        return np.array([outside, outside, at, outside, outside]).reshape(-1, 1, 1)

    matrices = [hat(rest, rest if A is None else A), hat(1.0, B), hat(1.0, 1.0), hat(0.0, 0.0)]
    if others:
        factors = (basis, *(Polynomial(1, s.low, s.high) for s in others))
        matrices = [np.kron(M, factors[1].constant().reshape(-1, 1, 1)) for M in matrices]
        basis = Product(factors)
    p = Scheduling("p", "1", 0.0, 1.0, 0.5)
    return LPVStateSpace(basis, *matrices, (p, *others), ("x",), ("u",), ("y",), dt)


def asked(impose):
    return {"search": None, "form": CONSTANT} | ({} if impose is None else {"impose": impose})


@ROUTES
@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("width", [1e-8, 3e-10, 1e-13])
def test_what_is_unstable_on_a_piece_however_narrow_is_not_proven_stable(width, dt, impose):
    model = through_narrow_pieces(width, A=1.0 if dt is None else 2.0, dt=dt)
    found = stability(model, **asked(impose))
    assert not found.verified
    assert not found.verify(rigorous=True)


@ROUTES
@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("width", [1e-8, 3e-10, 1e-13])
def test_a_gain_covers_a_piece_however_narrow(width, dt, impose):
    """At PLACE the frozen gain is 100, or 200 sampled."""
    found = l2_gain(through_narrow_pieces(width, B=100.0, dt=dt), **asked(impose))
    truth = 100.0 if dt is None else 200.0
    assert found.gamma >= truth
    assert found.frozen >= truth * (1 - 1e-9)


def test_a_narrow_piece_counts_among_several_parameters():
    q = Scheduling("q", "1", -1.0, 1.0, 0.1)
    assert not stability(
        through_narrow_pieces(3e-10, A=1.0, others=(q,)), search=None, form=CONSTANT
    ).verified
    found = l2_gain(through_narrow_pieces(3e-10, B=100.0, others=(q,)), search=None, form=CONSTANT)
    assert found.gamma >= 100.0


@ROUTES
@pytest.mark.parametrize("what", [{"A": 1.0}, {"B": 100.0}], ids=["unstable", "large"])
def test_a_file_whose_proof_overlooks_a_narrow_piece_is_refused(tmp_path, what, impose):
    """The proof of a harmless model, handed in for one that is harmful on a narrow piece."""
    harmless = l2_gain(through_narrow_pieces(3e-10), **asked(impose))
    assert harmless.verify(rigorous=True)
    harmful = through_narrow_pieces(3e-10, **what)
    content = json.loads(harmless.save(tmp_path / "proof.json").read_text())
    name = "lpv" if "lpv" in content["proof"] else "source"
    for matrix in "AB":
        values = getattr(harmful, matrix).ravel().tolist()
        content["proof"][name][matrix]["array"] = values
    (tmp_path / "proof.json").write_text(json.dumps(content))
    with pytest.raises(CertificateError, match="does not establish the certified bound"):
        Certificate.load(tmp_path / "proof.json")


@pytest.mark.parametrize("space", [sum_space, product_space])
def test_near_breaks_of_two_bases_stay_apart(space):
    near = 0.5 + 5e-10
    joined = space(PiecewiseLinear((0.0, 0.5, 1.0)), PiecewiseLinear((0.0, near, 1.0)))
    assert joined.breaks == (0.0, 0.5, near, 1.0)


def test_breaks_that_differ_by_the_last_place_are_one_where_nothing_jumps():
    third, again = 0.1 + 0.2, 0.3
    assert third != again
    hats = PiecewiseLinear((0.0, third, 1.0)), PiecewiseLinear((0.0, again, 1.0))
    assert product_space(*hats).breaks == (0.0, again, 1.0)
    jumps = Patches(1, (0.0, third, 1.0))
    with pytest.raises(InputError, match=r"breaks at 0\.3 and at 0\.30000000000000004"):
        product_space(jumps, hats[1])
    steep = PiecewiseLinear((0.0, third, third + 1e-13, 1.0))
    with pytest.raises(InputError, match="too near to one another"):
        product_space(steep, hats[1])


def test_where_the_basis_ends_by_rounding_before_the_range_its_last_piece_goes_on():
    basis = PiecewiseLinear((0.0, 0.5, 1.0 - 1e-10))
    one = np.ones((3, 1, 1))
    p = Scheduling("p", "1", 0.0, 1.0, 0.5)
    model = LPVStateSpace(
        basis, -one * [[[1.0]], [[1.0]], [[2.0]]], one, one, 0 * one, (p,), ("x",), ("u",), ("y",)
    )
    found = l2_gain(model, search=None, form=CONSTANT)
    assert found.verify(rigorous=True)
    slope = 1.0 / (0.5 - 1e-10)
    assert model.matrices(1.0).A.item() == pytest.approx(-2.0 - 1e-10 * slope, rel=1e-14)


LARGE = 2.0**22
"""The states of x'' + x' + d x = 0 are x and x' + LARGE x: the entries of A all but cancel."""


def nearly_cancelling(stiffness, basis):
    """x'' + x' + d x = 0 with d = `stiffness` at the coefficients of the basis, to the last bit."""
    A = [[[LARGE, 1.0], [-(LARGE**2 + LARGE) - d, -LARGE - 1.0]] for d in stiffness]
    n = len(A)
    nothing = np.zeros((n, 2, 0)), np.zeros((n, 0, 2)), np.zeros((n, 0, 0))
    p = Scheduling("p", "1", 0.0, 1.0, rate=0.0)
    q = Scheduling("q", "1", 0.0, 1.0, rate=0.0)
    every = (p, q)[: basis.dimension]
    return LPVStateSpace(basis, np.array(A), *nothing, every, ("x", "y"), (), (), None)


def energy():
    """x'Px in those states: V = .53125 x^2 + x x' + x'^2, which falls for d from .004 to .5."""
    T = np.array([[1.0, 0.0], [LARGE, 1.0]])
    return T.T @ np.array([[0.53125, 0.5], [0.5, 1.0]]) @ T


def test_a_slope_in_the_last_places_of_an_entry_counts():
    """d falls to -2^-8 at p = 1, which is unstable: some 1e-14 of the entry that d stands in."""
    last = float(np.spacing(LARGE**2))
    harmful = nearly_cancelling([80 * last, -last], PiecewiseLinear((0.0, 1.0)))
    assert np.linalg.det(np.longdouble(harmful.matrices(1.0).A).astype(float)) < 0
    P = SplineLyapunov(np.array([0.0, 1.0]), 0, energy()[None])
    units = scaled_problem(harmful, 0.0, 1.0, with_gain=False).units
    for model, holds in (
        (harmful, False),
        (nearly_cancelling([80 * last, last], PiecewiseLinear((0.0, 1.0))), True),
    ):
        evidence = one_parameter.IntervalEvidence(model, model_pieces(model), units, 0.0, 0)
        assert evidence.fault(P, "stability", (0.0,)) is None
        assert evidence.exact(P, np.nan) is holds


def test_a_slope_in_the_last_places_counts_among_several_parameters():
    last = float(np.spacing(LARGE**2))
    basis = Product((PiecewiseLinear((0.0, 1.0)), PiecewiseLinear((0.0, 1.0))))
    P = BoxLyapunov((np.array([0.0, 1.0]),) * 2, (0, 0), energy()[None, None])
    for least, holds in ((-last, False), (last, True)):
        model = nearly_cancelling([80 * last, least, 80 * last, least], basis)
        demand = Demand(STABILITY, Motion.of(model.parameters))
        units = Scaling(np.eye(2), np.eye(2), 1.0, 1.0, np.eye(2))
        evidence = box.BoxEvidence(pieces(model), units, demand)
        assert evidence.fault(P, "stability", (0.0, 0.0)) is None
        assert evidence.exact(P, np.nan) is holds


def test_a_decay_rate_in_the_last_places_is_not_rounded_up():
    """x(k+1) = (1 - 2^-53) x(k) decays by 1.11e-16 a sample; exp of twice 1.6e-16 rounds down."""
    p = Scheduling("p", "1", 0.0, 1.0, rate=0.0)
    pole = 1.0 - 2.0**-53
    nothing = [np.zeros((1, 0))], [np.zeros((0, 1))], [np.zeros((0, 0))]
    slow = LPVStateSpace.polynomial([[[pole]]], *nothing, p, dt=1.0)
    P = BoxLyapunov((np.array([0.0, 1.0]),), (0,), np.ones((1, 1, 1)))
    units = Scaling(np.eye(1), np.eye(1), 1.0, 1.0, np.eye(1))
    demand = Demand(DECAY_RATE, Motion.of(slow.parameters))
    evidence = box.BoxEvidence(pieces(slow), units, demand)
    assert evidence.exact(P, 0.0)
    assert not evidence.exact(P, 1.6e-16)
    ten = replace(slow, A=np.full((1, 1, 1), np.exp(-1.0)))
    assert box.BoxEvidence(pieces(ten), units, demand).exact(P, 1.0 - 1e-14)
