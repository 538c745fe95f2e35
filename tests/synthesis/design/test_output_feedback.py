"""Output feedback by inequalities against closed forms, printed optima, Riccati equations and
itself.
"""

import math

import numpy as np
import pytest
from design_plants import (
    first_order,
    named,
    random_plant,
    scherer_gahinet_chilali,
    slicot_sb10fd,
)
from scheduled_plants import (
    MISSILE,
    MISSILE_STATES,
    WORST_FROZEN,
    frozen,
    lag,
    missile,
    missile_at,
    of,
    spring,
    two_parameters,
)
from scipy.optimize import brentq

from symheli import LinearModel
from symheli.errors import InputError, SynthesisError
from synthesis import hinf, output_feedback

BACK_OFF = 1.02
PROVEN = 1 + 1e-6
"""A certificate beside what was promised: both are solutions of inequalities."""


def least(plant, rate=0.0, **options):
    """The least gain of the inequalities."""
    return output_feedback(plant, rate, back_off=BACK_OFF, **options).promised / BACK_OFF


@pytest.mark.slow(but="-1-1-1")
@pytest.mark.parametrize(
    ("a", "b", "c"), [(0, 3, 2), (1, 2, 0.5), (-1, 1, 1), (5, 1, 1), (0.3, 10, 2), (-2, 3, 4)]
)
def test_a_first_order_plant_has_its_optimum_in_closed_form(a, b, c):
    """(-a + sqrt(a^2 + b^2 - q))(-a + sqrt(a^2 + c^2 - q)) = q with q = 1/gamma^2.

    The solver stops when the gap is a few millionths of gamma.
    """

    def difference(q):
        return (-a + np.sqrt(a**2 + b**2 - q)) * (-a + np.sqrt(a**2 + c**2 - q)) - q

    q = brentq(difference, 0.0, min(a**2 + b**2, a**2 + c**2), xtol=1e-14)
    assert least(lag(a, b, c)) == pytest.approx(q**-0.5, rel=5e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plant", "optimum"),
    [
        pytest.param(scherer_gahinet_chilali([0]), 9.508085, id="scherer"),
        pytest.param(slicot_sb10fd(), 10.184256, id="sb10fd", marks=pytest.mark.slow),
    ],
)
def test_optima_of_the_literature(plant, optimum):
    """Scherer, Gahinet and Chilali (1997), example 7; the example of SLICOT's SB10FD."""
    made = output_feedback(of(*plant), back_off=BACK_OFF)
    assert made.promised / BACK_OFF == pytest.approx(optimum, rel=1e-4)
    assert optimum <= made.certify(0.0, search=None).gamma <= made.promised * PROVEN


def mixed_sensitivity(bandwidths):
    """Skogestad and Postlethwaite, example 3.8: S and K S of a plant with a zero at 1/2."""
    G = np.kron(np.eye(2), [[0.0, 1.0], [-5.0, -6.0]])
    C = np.array([[1.0, 0, 1, 0], [1, 2, 2, 0]])
    A, B, C1, D = np.zeros((6, 6)), np.zeros((6, 4)), np.zeros((6, 6)), np.zeros((6, 4))
    A[:4, :4], A[4:, :4] = G, -C
    B[[1, 3], [2, 3]] = 5.0
    B[4:, :2] = np.eye(2)
    for i, w in enumerate(bandwidths):  # (s/1.5 + w)/(s + 1e-4 w)
        A[4 + i, 4 + i] = -1e-4 * w
        C1[i, 4 + i], C1[i, :4], D[i, i] = w - 1e-4 * w / 1.5, -C[i] / 1.5, 1 / 1.5
    D[2:4, 2:], D[4:, :2], C1[4:, :4] = np.eye(2), np.eye(2), -C
    return named(A, B, C1, D, 2, 2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bandwidths", "optimum"),
    [((0.25, 25), 2.916176)],
)
def test_skogestad_postlethwaite_mixed_sensitivity(bandwidths, optimum):
    """Printed 2.80, 2.92, 6.73."""
    assert least(of(*mixed_sensitivity(bandwidths))) == pytest.approx(optimum, rel=1e-4)


@pytest.mark.slow
def test_mcfarlane_glover():
    """Normalised coprime factors of 200/((10s + 1)(.05s + 1)^2) times (s + 2)/(s + 1e-6): printed
    2.34.
    """
    import control

    s = control.tf("s")
    shaped = control.ss(200 / ((10 * s + 1) * (0.05 * s + 1) ** 2) * (s + 2) / (s + 1e-6))
    A, B, C = shaped.A, shaped.B, shaped.C
    none = np.zeros((len(A), 1))
    D = [[0, 0, 1], [1, 0, 0], [1, 0, 0]]
    plant = of(*named(A, np.hstack([none, B, B]), np.vstack([none.T, C, C]), D, 1, 1))
    assert least(plant) == pytest.approx(2.338767, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "dt"), [(1, None), (3, None), (0, 0.1)])
def test_inequalities_and_riccati_equations_agree(seed, dt):
    """Plants with all nine matrices; the frozen loop of each controller has kept its level, or
    there were an error. One has an optimum of 6696, for which X and Y would have to be beyond the
    bound that keeps them computable.
    """
    plant = random_plant(seed, dt)
    digits = 2e-3 if (seed, dt) == (3, None) else 1e-4
    assert least(of(*plant)) == pytest.approx(hinf(*plant).optimum, rel=digits)


# --- scheduled -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_faster_the_parameter_the_larger_the_gain_between_frozen_and_jumps():
    rates = (0.0, 0.3, 3.0, math.inf)
    gains = [least(spring(), rate, X=0, Y=0 if math.isinf(rate) else 2) for rate in rates]
    assert gains == sorted(gains)
    worst = max(hinf(*frozen(spring(), p)).optimum for p in np.linspace(0, 1, 21))
    # both may move with a parameter that stands still
    assert worst * (1 - 1e-6) <= least(spring(), 0.0) <= gains[0]


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.5, math.inf])
def test_what_was_promised_is_proven(rate):
    made = output_feedback(spring(), rate)
    proof = made.certify(rate, search=None)
    assert proof.verified
    assert proof.gamma <= made.promised * PROVEN


@pytest.mark.slow
def test_standing_still_the_least_gain_is_the_worst_frozen_optimum():
    plant = spring()
    worst = max(hinf(*frozen(plant, p)).optimum for p in np.linspace(0, 1, 21))
    found = least(plant, 0.0, X=4, Y=4, divisions=2)
    assert worst * (1 - 1e-6) <= found <= worst * (1 + 1e-3)


@pytest.mark.slow
def test_two_parameters_move_slowly():
    """Within two percent of the worst frozen optimum, where the Riccati equations put it."""
    worst = hinf(*frozen(two_parameters(0.0), 1.0, 1.0)).optimum
    assert worst == pytest.approx(WORST_FROZEN, abs=5e-7)
    assert worst <= least(two_parameters(1e-3), 1e-3) <= 1.02 * worst


MISSILE_FROZEN = [(2, 0, 1.00153), (2, 10, 0.80761), (2, 20, 0.7216), (3, 0, 0.46639),
                  (4, 0, 0.32302)]  # fmt: skip
"""Mach, angle of attack in deg, optimum."""


@pytest.mark.parametrize(("mach", "alpha", "optimum"), MISSILE_FROZEN)
def test_a_missile_at_one_condition(mach, alpha, optimum):
    model = LinearModel(*missile_at(mach, alpha), MISSILE_STATES, *MISSILE)
    assert hinf(model, ["dc"], ["error", "q"]).optimum == pytest.approx(optimum, abs=6e-6)


@pytest.mark.slow
def test_a_missile_over_its_envelope():
    """At 0.001 per second within two percent of the worst condition, and never below."""
    envelope = missile(1e-3, degrees=(2, 2), box=((2.0, 2.5), (0.0, 5.0)))
    found = least(envelope, 1e-3, X=0, Y=(1, 1))
    assert 1.00153 * (1 - 1e-5) <= found <= 1.02 * 1.00153


# --- sampled -------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("a", [-1.0, 0.5])
def test_a_sampled_first_order_plant(a):
    model, controls, measured = first_order(a, 2.0, 1.0)
    sampled = model.discretize(0.1)
    plant = of(sampled, controls, measured)
    assert least(plant) == pytest.approx(hinf(sampled, controls, measured).optimum, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.5])
def test_a_sampled_design_is_proven_and_tends_to_the_continuous_one(rate):
    """The performance and the noise of a sampled plant are sampled too: what differs is of first
    order in the period.
    """
    continuous = least(spring(), rate, X=0, Y=2)
    gaps = []
    for dt in (0.1, 0.05):
        made = output_feedback(spring().sampled(dt), rate, X=0, Y=2, back_off=BACK_OFF)
        assert made.dt == dt
        proof = made.certify(rate, search=None)
        assert proof.verified
        assert proof.gamma <= made.promised * (1 + 1e-4)  # of functions fitted to the gains
        gaps.append(made.promised / BACK_OFF / continuous - 1)
    assert abs(gaps[1]) < 0.6 * abs(gaps[0]) < 0.1


# --- both sides moving, asked for by hand ---------------------------------------------------------


@pytest.mark.slow
def test_both_sides_move_where_that_is_asked_and_the_rate_is_neglected():
    """As the default does where one side is not enough; the loop is proven without that neglect."""
    made = output_feedback(spring(), 0.05, X=2, Y=2, back_off=BACK_OFF)
    assert made.method == "output feedback, X of degree 2, Y of degree 2, their rates neglected"
    one_sided = [output_feedback(spring(), 0.05, X=x, Y=2 - x).optimum for x in (0, 2)]
    assert made.optimum <= min(one_sided)
    # what storage function and neglected rate promise, not what X and Y would with dp/dt known
    assert made.optimum < made.promised <= 1.05 * BACK_OFF * made.optimum
    proof = made.certify(0.05, search=None)
    assert proof.verified
    assert proof.gamma <= made.promised * PROVEN


@pytest.mark.slow
def test_where_neglecting_the_rate_keeps_no_gamma_it_is_said_what_to_write(monkeypatch):
    monkeypatch.setattr("synthesis.design.lpv.search.MAX_RATE_LOSS", 0.5)
    with pytest.raises(
        SynthesisError, match=r"without a measurement of its rate .* X=0, or .*plant\.lagged"
    ):
        output_feedback(spring(), 0.5, X=2, Y=2, back_off=BACK_OFF)


# --- a parameter seen through a lag --------------------------------------------------------------


@pytest.mark.slow
def test_both_sides_move_with_a_lagged_parameter():
    """Better than either alone, over the same parameters; the controller knows how X and Y move."""
    slow = spring(1.0).lagged(0.2)
    both = least(slow, None, X=(2, 0), Y=(2, 0))
    assert both <= min(least(slow, None, X=(x, 0), Y=(2 - x, 0)) for x in (0, 2))


@pytest.mark.slow
def test_the_loop_of_a_lagged_parameter_is_proven_by_tied_rates():
    made = output_feedback(spring(1.0).lagged(0.2), X=(2, 0), Y=(2, 0), back_off=BACK_OFF)
    proof = made.certify(search=None)
    assert proof.verified
    assert proof.gamma <= made.promised * (1 + 1e-3)  # of functions fitted to the gains


# --- what cannot be asked ------------------------------------------------------------------------


@pytest.mark.slow
def test_a_controller_that_would_need_the_rate_is_refused():
    lagged = spring(1.0).lagged(0.2)
    rate = lagged.parameters[1].name
    with pytest.raises(InputError, match=rf"X and Y both depend on {rate}.*\.with_rate"):
        output_feedback(lagged, X=(2, 1), Y=(2, 1))
    with pytest.raises(InputError, match="in discrete time X cannot depend on p"):
        output_feedback(spring().sampled(0.05), 0.5, X=2, Y=2)
    with pytest.raises(InputError, match="in discrete time X cannot depend on p"):
        output_feedback(spring().sampled(0.05), 0.5, X=2, Y=0)
    with pytest.raises(InputError, match="Y cannot depend on p, which may jump"):
        output_feedback(spring(), math.inf, X=0, Y=2)


@pytest.mark.slow
@pytest.mark.parametrize("degree", [-1, 1.5, (1, 1), True])
def test_a_degree_is_a_whole_number_for_each_parameter(degree):
    with pytest.raises(InputError, match="expected a degree >= 0, one for each of p"):
        output_feedback(spring(), 0.5, X=0, Y=degree)


@pytest.mark.parametrize("rate", [-1.0, math.nan, {"q": 1.0}])
def test_a_rate_is_a_number_that_is_not_negative(rate):
    with pytest.raises((InputError, ValueError)):
        output_feedback(spring(), rate)
