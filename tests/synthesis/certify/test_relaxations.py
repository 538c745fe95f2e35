"""Whichever relaxation finds P: closed forms, their order, and never a proof of what is not
true.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from models import forged, lag, random_stable, searched, spring
from test_never_call_unstable_stable import unstable

from symheli import LFT, LPVStateSpace, Scheduling
from symheli.errors import CertificateError, InputError, UnknownNameError
from synthesis import Solver, decay_rate, l2_gain, stability
from synthesis.analysis import Status, energy_to_peak, installed_solvers
from synthesis.certify.statement.demand import Demand
from synthesis.certify.statement.kind import STABILITY
from synthesis.forms import LaggedParameter, Spline
from synthesis.impose import Bernstein, Grid, SumOfSquares, Vertices
from synthesis.numerics.polynomial.pieces import pieces

PROOFS = {"bernstein": Bernstein(), "sos": SumOfSquares(), "vertices": Vertices()}
QUICK = Spline(degree=1)


def two_lags(rate=(0.5, 2.0), dt=None):
    """x' = -(1 + 0.3 a + 0.4 b) x + u, |a|, |b| <= 1: slowest at the corner (-1, -1), where it
    decays at 0.3.
    """
    h = 1.0 if dt is None else dt
    A = {(0, 0): [[-1.0 * h + (dt is not None)]], (1, 0): [[-0.3 * h]], (0, 1): [[-0.4 * h]]}
    parameters = [
        Scheduling("a", "1", -1.0, 1.0, rate[0]),
        Scheduling("b", "1", -1.0, 1.0, rate[1]),
    ]
    return LPVStateSpace.polynomial(
        A, {(0, 0): [[h]]}, {(0, 0): [[1.0]]}, {(0, 0): [[0.0]]}, parameters, dt
    )


def mass_spring(rate=0.1, dt=None, spring=0.3):
    """x'' + (0.6 + 0.2 d) x' + (1 + 0.3 k) x = u, |k|, |d| <= 1."""
    A = {
        (0, 0): np.array([[0, 1.0], [-1, -0.6]]),
        (1, 0): np.array([[0, 0], [-spring, 0]]),
        (0, 1): np.array([[0, 0], [0, -0.2]]),
    }
    if dt is not None:
        A = {e: dt * M + np.eye(2) * (e == (0, 0)) for e, M in A.items()}
    parameters = [Scheduling("k", "1", -1.0, 1.0, rate), Scheduling("d", "1", -1.0, 1.0, rate)]
    return LPVStateSpace.polynomial(
        A, {(0, 0): [[0.0], [dt or 1.0]]}, {(0, 0): [[1.0, 0]]}, {(0, 0): [[0.0]]}, parameters, dt
    )


@pytest.mark.slow(but="sos-0.1")
@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("kind", PROOFS)
def test_a_scalar_system_of_two_parameters_has_its_closed_forms(kind, dt):
    """Constant P = 1 proves what the slowest corner attains: gain 1/0.3, peak 1/sqrt(0.6), decay
    0.3.
    """
    options, model = {"form": Spline(degree=0), "impose": PROOFS[kind]}, two_lags(dt=dt)
    slow = 0.3 if dt is None else (1 - 0.03)
    expected = {
        l2_gain: 1 / 0.3,
        energy_to_peak: 1 / math.sqrt(0.6) if dt is None else dt / math.sqrt(1 - slow**2),
        decay_rate: slow if dt is None else -math.log(slow) / dt,
    }
    for analysis, value in expected.items():
        cert = analysis(model, **options, search=None)
        assert cert.verified
        assert cert.verify(rigorous=True)
        # 5e-7 and more of loosening, the solver's gap, and the margin of the state block
        assert cert.bound == pytest.approx(value, rel=2e-5)
        assert cert.frozen == pytest.approx(value, rel=1e-7)
    assert stability(model, **options).verify(rigorous=True)


@pytest.mark.slow
def test_sums_of_squares_lie_between_grid_and_bernstein():
    """The same P: every Bernstein proof is a sum of squares, and what holds in the box holds on the
    grid.
    """
    model = mass_spring()
    for analysis in (l2_gain, energy_to_peak):
        found = {
            kind: analysis(model, form=QUICK, impose=impose, search=None)
            for kind, impose in {**PROOFS, "grid": Grid()}.items()
            if kind != "vertices"
        }
        # gamma is loosened by 1e-6 .. 1e-5 where it is proven; the grid is the solver's
        assert found["sos"].gamma <= found["bernstein"].gamma * (1 + 1e-4)
        assert found["grid"].indicative <= found["sos"].gamma * (1 + 1e-4)
        assert found["sos"].gamma < found["bernstein"].gamma * 0.998
        assert found["sos"].verify(rigorous=True)


@pytest.mark.slow
def test_subdivision_and_elevation_bring_bernstein_to_the_sums_of_squares():
    model = replace(spring(0.3), B=spring().B)
    one = Spline(degree=2, segments=1)
    exact = l2_gain(model, 0.02, form=one, impose=SumOfSquares(), search=None).gamma
    plain = l2_gain(model, 0.02, form=one, search=None).gamma
    cut = l2_gain(model, 0.02, form=one, impose=Bernstein(subdivision=3), search=None).gamma
    raised = l2_gain(model, 0.02, form=one, impose=Bernstein(elevation=6), search=None).gamma
    # exact in one parameter: nothing that proves can be better, to the loosening of 1e-4
    assert exact * (1 - 1e-4) <= cut <= plain * (1 + 1e-4)
    assert exact * (1 - 1e-4) <= raised <= plain * (1 + 1e-4)
    # eight parts: the gap falls at least with their width
    assert cut - exact <= (plain - exact) / 8 + 1e-4 * exact


@pytest.mark.slow
@pytest.mark.parametrize("dt", [None, 0.1])
def test_both_routes_to_one_parameter_agree(dt):
    model = random_stable(1, dt=dt)
    spline = Spline(segments=2, degree=2)
    old = l2_gain(model, form=spline, search=None)
    # a total degree of 2 on one segment takes the other route with the same P
    one = l2_gain(model, form=Spline(segments=1, degree=2), search=None)
    new = l2_gain(model, form=Spline(segments=1, degree=2, total_degree=2), search=None)
    assert new.gamma == pytest.approx(one.gamma, rel=1e-3)
    if dt is not None:
        return  # p and p(k+1) make sums of squares in two variables: slow
    sos = l2_gain(model, form=spline, impose=SumOfSquares(), search=None)
    assert sos.frozen == pytest.approx(old.frozen, rel=1e-7)
    assert sos.frozen <= sos.gamma <= old.gamma * (1 + 1e-4)


def test_several_parameters_of_an_lft_or_one_polynomial_alike():
    A, B = {(0,): [[-1.0]], (1,): [[-1.0]]}, {(0,): [[1.0]]}
    lft = LFT.polynomial(
        A, B, {(0,): [[1.0]]}, {(0,): [[0.0]]}, [Scheduling("p", "1", 0.0, 1.0, 1.0)]
    )
    for model in (lft, lag().to_lft()):
        assert l2_gain(model, form=QUICK, search=None).gamma == pytest.approx(1.0, rel=5e-6)


@pytest.mark.slow
def test_faster_parameters_cost_and_slower_ones_gain():
    gains = [l2_gain(mass_spring(rate), form=QUICK, search=None).gamma for rate in (0.0, 0.1, 0.4)]
    assert gains == sorted(gains)
    assert l2_gain(mass_spring(), {"k": 0.4, "d": 0.0}, form=QUICK, search=None).gamma <= gains[
        2
    ] * (1 + 1e-4)


def test_a_decay_rate_of_constant_coefficients_is_that_of_the_slowest_mode():
    model = mass_spring(spring=0.0)
    cert = decay_rate(model, 0.0, form=Spline(degree=2), impose=SumOfSquares(), search=None)
    # 0.2: damping 0.6 - 0.2 at d = -1, halved; exp(-alpha t) to the tolerance of the bisection and
    # the degree of P
    assert cert.frozen == pytest.approx(0.2, rel=1e-7)
    assert 0.97 * 0.2 <= cert.alpha <= 0.2
    assert cert.alpha <= cert.upper


def test_the_energy_to_peak_gain_of_an_oscillator():
    """x'' + 2 d x' + w^2 x = u: the peak of x is 1/sqrt(4 d w^2) for the energy of u (Lyapunov
    equation by hand).
    """
    model = mass_spring(spring=0.0)
    cert = energy_to_peak(model, {"k": 0.0, "d": 0.0}, form=Spline(degree=2), search=None)
    assert cert.frozen == pytest.approx(1 / math.sqrt(2 * 0.4), rel=1e-7)
    assert cert.frozen <= cert.gamma <= 1.05 * cert.frozen


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-4, 1e4])
def test_no_scaling_makes_an_unstable_plant_proven(scale):
    """By no relaxation."""
    never_proven("CLARABEL", scale, 1e-8)


@pytest.mark.slow(but="CLARABEL")
@pytest.mark.parametrize("solver", installed_solvers())
def test_an_unstable_plant_is_never_proven(solver):
    """Barely unstable, between the ends of the range."""
    never_proven(solver, 1.0, 1e-8)


def never_proven(solver, scale, excess):
    """First with the look at frozen poles, then by P alone."""
    quick = Solver(solver, iterations=100 if solver == "SCS" else None)
    for dt in (None, 0.1):
        model = unstable(excess, scale, dt)
        form = Spline(degree=1, segments=1)
        for impose in (Bernstein(subdivision=1), SumOfSquares(), Vertices(), Grid(4)):
            for analysis in (l2_gain, energy_to_peak, decay_rate, stability):
                cert = analysis(model, form=form, impose=impose, solver=quick, search=None)
                assert cert.status is Status.UNSTABLE
                assert not cert.verified
            if isinstance(impose, Grid):
                continue
            for kind, rate in (("stability", 0.0), ("l2 gain", 0.1), ("energy-to-peak gain", 0.1)):
                # one margin is enough of the gains
                once = replace(impose, margins=(1e-6,)) if kind.endswith("gain") else impose
                assert searched(model, rate, kind, form, once, quick).proof is None


def test_a_grid_sees_no_instability_between_its_points_and_says_so():
    """Unstable for p near 0.5, where a grid of two points does not look."""
    model = unstable(1e-3, 1.0)
    found = searched(model, 0.1, "l2 gain", Spline(degree=0), Grid(2))
    assert found.proof is not None
    assert not found.proof.floating(found.bound)
    assert not found.proof.exact(found.bound)


@pytest.mark.parametrize("analysis", [l2_gain, energy_to_peak, decay_rate, stability])
def test_a_grid_is_never_a_proof(analysis):
    cert = analysis(lag(), 1.0, form=Spline(degree=1), impose=Grid(), search=None)
    assert cert.status is Status.UNPROVEN
    assert not cert.verified
    assert not cert.verify()
    assert not cert.verify(rigorous=True)
    if analysis is not stability:
        assert math.isinf(cert.bound)
        assert cert.indicative == pytest.approx(
            {l2_gain: 1, energy_to_peak: math.sqrt(0.5), decay_rate: 1}[analysis], rel=1e-3
        )
    with pytest.raises(CertificateError):
        replace(cert, verified=True)


@pytest.mark.slow(but="0.2")
@pytest.mark.parametrize("dt", [None, 0.2])
def test_exact_arithmetic_rejects_a_tampered_certificate(dt):
    model = mass_spring(dt=dt, spring=0.3 if dt is None else 0.1)
    for analysis in (l2_gain, energy_to_peak, decay_rate):
        cert = analysis(model, form=Spline(degree=1 if dt is None else 0), search=None)
        assert cert.verify()
        assert cert.verify(rigorous=True)
        P = cert.lyapunov
        better = cert.bound * (1.02 if analysis is decay_rate else 0.98)
        # neither the bound nor P can be moved: negative P, or a bound better than P admits
        for bad in (
            replace(
                cert, verified=False, **{"alpha" if analysis is decay_rate else "gamma": better}
            ),
            forged(cert, lyapunov=replace(P, coefficients=-P.coefficients)),
        ):
            assert not bad.verify()
            assert not bad.verify(rigorous=True)


@pytest.mark.slow
def test_a_worst_trajectory_is_found_and_its_order_is_kept():
    model = mass_spring(0.8, spring=0.6)
    peak = energy_to_peak(model, form=QUICK)
    assert peak.frozen <= peak.lower <= peak.gamma * (1 + 1e-6)
    slow = decay_rate(spring(damping=0.3), 0.5, form=Spline(degree=2, segments=2))
    assert slow.alpha <= slow.upper < slow.frozen
    assert slow.worst is not None
    assert np.abs(np.diff(slow.worst.p)).max() <= 2.0


def test_a_certificate_that_contradicts_a_frozen_model_cannot_be_made():
    cert = decay_rate(two_lags(), form=QUICK, search=None)
    with pytest.raises(CertificateError, match="frozen decay rate"):
        replace(cert, alpha=1.01 * cert.frozen)
    gain = l2_gain(two_lags(), form=QUICK, search=None)
    with pytest.raises(CertificateError, match="frozen gain"):
        replace(gain, gamma=0.99 * gain.frozen)


def test_growth_along_a_trajectory_is_a_refusal():
    cert = decay_rate(spring(), math.inf)
    assert cert.status is Status.GROWING
    assert cert.worst is not None
    assert not cert.verified


def test_wrong_input_gets_a_sentence():
    with pytest.raises(InputError, match="impose must be Bernstein"):
        l2_gain(lag(), impose="sos")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="form must be a Spline"):
        l2_gain(lag(), form="spline")  # type: ignore[arg-type]
    for wrong in (
        lambda: Bernstein(elevation=-1),
        lambda: Bernstein(subdivision=0.5),
        lambda: Grid(1),
        lambda: SumOfSquares(margins=()),
        lambda: Vertices(floor=-1.0),
        lambda: Spline(grading=0.5),
        lambda: Spline(segments=0),
        lambda: Spline(total_degree=-1),
        lambda: Spline(accept=0.5),
    ):
        with pytest.raises(InputError):
            wrong()
    with pytest.raises(UnknownNameError, match="scheduling parameter"):
        l2_gain(two_lags(), {"c": 1.0})
    with pytest.raises(InputError, match="rate must be >= 0"):
        decay_rate(two_lags(), [1.0, -1.0])
    with pytest.raises(InputError, match="needs D = 0"):
        energy_to_peak(random_stable(0))
    with pytest.raises(InputError, match="or an LFT"):
        decay_rate(np.eye(2))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="total degree of P needs one segment"):
        l2_gain(lag(), form=Spline(degree=2, segments=2, total_degree=2), search=None)


@pytest.mark.slow
def test_a_program_too_large_for_the_memory_is_left_alone_and_says_so():
    """Sums of squares in p, q and their next values, of degree two: the process once was ended by
    the operating system.
    """
    cert = l2_gain(
        mass_spring(0.5, dt=0.1), form=Spline(degree=2), impose=SumOfSquares(), search=None
    )
    assert cert.status is Status.UNTRIED
    assert "would need several times" in cert.details
    assert "a lower degree" in cert.details


def test_a_next_value_that_may_be_anywhere_costs_no_degree_in_p():
    """P(p(k+1)) does not depend on p(k) where p jumps: its degree in p is that of A'A alone, two,
    and not two more.
    """
    from synthesis.certify.assemble.box import Shape, _pair
    from synthesis.certify.proof.inequalities import decrease
    from synthesis.numerics.polynomial.motion import Motion
    from synthesis.numerics.polynomial.regions import regions

    model, shape = pieces(mass_spring(dt=0.1)), Shape((np.array([-1.0, 1]),) * 2, (2, 2))
    degrees = {}
    for rate in (math.inf, 1.0):
        motion = Motion.of(model.parameters)._replace(rates=(rate, rate))
        demand = Demand(STABILITY, motion)
        region = next(regions(model, shape.knots, motion, demand.moving(shape.degrees)))
        degrees[rate] = [
            F.degrees for F in decrease(model, region, _pair(shape, region, 2)[1], demand, float)
        ]
    assert degrees == {math.inf: [(2, 2, 2, 2)], 1.0: [(4, 4, 2, 2)]}


@pytest.mark.parametrize(
    ("analysis", "options", "said"),
    [
        (stability, {"form": Spline(accept=2.0)}, "stability has none"),
        (stability, {"impose": Bernstein(margins=(1e-3,))}, "margins and floor are for gains"),
        (decay_rate, {"impose": SumOfSquares(floor=1e-3)}, "margins and floor are for gains"),
        (
            l2_gain,
            {"form": LaggedParameter(1.0), "impose": SumOfSquares()},
            "plain Bernstein coefficients",
        ),
        (
            l2_gain,
            {"form": LaggedParameter(1.0), "impose": Bernstein(subdivision=1)},
            "plain Bernstein",
        ),
        (energy_to_peak, {"form": LaggedParameter(1.0)}, "for l2_gain and stability"),
    ],
)
def test_an_option_without_a_meaning_for_the_question_is_refused(analysis, options, said):
    with pytest.raises(InputError, match=said):
        analysis(lag(), **options)


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: Spline(segments=10**6), "segments must be an integer from 1 to 1024"),
        (lambda: Spline(segments=(4, (8, 10**6))), "segments must be an integer from 1 to 1024"),
        (lambda: LaggedParameter(1.0, across_segments=10**6), "across_segments from 1 to 1024"),
        (lambda: Bernstein(subdivision=40), "subdivision must be an integer from 0 to 10"),
        (lambda: Bernstein(elevation=10**6), "elevation must be an integer from 0 to 64"),
        (lambda: SumOfSquares(elevation=10**6), "elevation must be an integer from 0 to 64"),
        (lambda: Grid(10**9), "points must be an integer from 2 to 1024"),
        (lambda: Spline(segments=100).segments_tried(2), "100 x 100 of 2 parameters are 10000"),
    ],
)
def test_a_program_that_no_solver_gets_through_is_refused_at_once(made, words):
    with pytest.raises(InputError, match=words):
        made()
