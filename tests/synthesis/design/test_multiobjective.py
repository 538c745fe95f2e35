"""Several objectives at once: printed and exact optima, bounds that the loop keeps, poles that lie
where they are asked to.
"""

import numpy as np
import pytest
from design_plants import matrix, named, scherer_gahinet_chilali
from scheduled_plants import lag, of, spring

from symheli.errors import InputError, SynthesisError
from synthesis import h2, hinf, multiobjective, output_feedback
from synthesis.numerics.linear.norm import norm
from synthesis.objectives import H2, L2, EnergyToPeak, PoleRegion

PROVEN = 1 + 1e-5
"""Gains beside the bounds of inequalities solved to 1e-8."""


def both():
    """Scherer, Gahinet and Chilali's example with the channels of both norms."""
    C = np.zeros((6, 3))
    C[0, 0] = C[2, 1] = C[3, 2] = C[5, 1] = 1.0
    D = np.zeros((6, 2))
    D[[1, 4], 1], D[5, 0] = 1.0, 2.0
    plant = named(
        matrix("0 10 2; -1 1 0; 0 2 -5"), matrix("1 0; 0 1; 1 0"), C, D, controls=1, measured=1
    )
    return of(*plant)


FAST, QUIET = ("z1", "z2"), ("z3", "z4", "z5")
"""Performance of the H-infinity and of the H2 norm."""


def two_norm(loop):
    """H2 norm of a stable frozen loop, by its Gramian."""
    from scipy.linalg import solve_continuous_lyapunov

    assert np.abs(loop.D).max() < 1e-9
    P = solve_continuous_lyapunov(loop.A, -loop.B @ loop.B.T)
    return np.sqrt(np.trace(loop.C @ P @ loop.C.T))


def gains(made, performance):
    loop = made.closed().select(outputs=list(performance)).at(0.5)
    return norm(loop.A, loop.B, loop.C, loop.D)[0], two_norm(loop)


def test_printed_optima():
    """Scherer, Gahinet and Chilali (1997), example 7: H2 7.748350599, H-infinity 9.508085."""
    quiet = multiobjective(of(*scherer_gahinet_chilali([1, 2])), H2(), back_off=1.001)
    assert quiet.optimum == pytest.approx(7.748350599, rel=1e-4)
    found = two_norm(quiet.closed().at(0.5))
    assert 7.748350599 * (1 - 1e-9) <= found <= quiet.promised * PROVEN
    fast = multiobjective(of(*scherer_gahinet_chilali([0])), L2())
    # the measurement tells the disturbance: X tends to infinity, and is bounded
    assert 9.508085 <= fast.optimum <= 9.508085 * (1 + 2e-4)


@pytest.mark.slow
def test_h2_is_that_of_two_riccati_equations():
    plant = spring()
    model = plant.model.at(0.3)
    frozen = of(model, ["u"], ["y"])
    best = h2(model, ["u"], ["y"]).hinf_norm
    assert multiobjective(frozen, H2()).optimum == pytest.approx(best, rel=1e-4)


def test_a_hard_bound_is_kept_and_costs_something():
    """The printed example: an H-infinity norm below 23.6, the H2 norm as small as that allows."""
    free = h2(*scherer_gahinet_chilali([1, 2])).hinf_norm
    made = multiobjective(both(), [L2(performance=FAST, bound=23.6), H2(performance=QUIET)])
    fast, _ = gains(made, FAST)
    _, quiet = gains(made, QUIET)
    assert fast <= 1.02 * 23.6 * PROVEN
    assert free * (1 - 1e-6) <= quiet <= made.promised * PROVEN
    loose = multiobjective(both(), [L2(performance=FAST, bound=40.0), H2(performance=QUIET)])
    assert loose.promised < made.promised


def test_a_bound_below_the_optimum_cannot_be_kept():
    with pytest.raises(SynthesisError, match="no controller was found"):
        multiobjective(both(), [L2(performance=FAST, bound=9.0), H2(performance=QUIET)])


def test_energy_to_peak_is_kept():
    """Its value by the loop's Gramian: the largest eigenvalue of C P C'."""
    from scipy.linalg import solve_continuous_lyapunov

    made = multiobjective(of(*scherer_gahinet_chilali([1, 2])), EnergyToPeak(), back_off=1.02)
    loop = made.closed().at(0.5)
    P = solve_continuous_lyapunov(loop.A, -loop.B @ loop.B.T)
    found = np.sqrt(np.linalg.eigvalsh(loop.C @ P @ loop.C.T).max())
    assert found <= made.promised * PROVEN
    assert made.optimum <= 7.748350599  # the root of a largest eigenvalue, not of a trace


@pytest.mark.parametrize(
    "region",
    [
        PoleRegion(decay=0.5),
        PoleRegion(radius=6.0),
        PoleRegion(decay=0.3, radius=8.0, damping=0.7),
    ],
    ids=["decay", "radius", "all"],
)
def test_poles_lie_in_their_region_at_every_condition(region):
    made = multiobjective(spring(0.0), L2(), region=region)
    loop = made.closed()
    for p in np.linspace(0, 1, 5):
        poles = np.linalg.eigvals(loop.at(p).A)
        slack = 1 + 1e-6
        assert np.all(poles.real <= -region.decay / slack)
        assert np.all(np.abs(poles) <= region.radius * slack)
        assert np.all(-poles.real >= region.damping * np.abs(poles) / slack)


def test_poles_of_a_frozen_plant_lie_in_every_region():
    region = PoleRegion(decay=0.3, radius=8.0, damping=0.7)
    made = multiobjective(of(spring().model.at(0.3), ["u"], ["y"]), L2(), region=region)
    poles = made.closed().at(0.0).poles()
    assert np.all(poles.real <= -0.3)
    assert np.all(np.abs(poles) <= 8.0)
    assert np.all(-poles.real >= 0.7 * np.abs(poles))


@pytest.mark.slow
def test_one_gain_alone_is_that_of_the_inequalities_without_the_controller():
    """Two programs with nothing in common: a constant X and Y for every p, p jumps."""
    plant = spring()
    eliminated = output_feedback(plant, np.inf).optimum
    assert multiobjective(plant, L2(), np.inf).optimum == pytest.approx(eliminated, rel=1e-3)


def test_of_a_constant_plant_it_is_the_optimum_by_riccati_equations():
    made = multiobjective(lag(1.0, 2.0, 0.5), L2())
    model = lag(1.0, 2.0, 0.5).model.at(0.0)
    assert made.optimum == pytest.approx(hinf(model, ["u1"], ["y1"]).optimum, rel=1e-4)


@pytest.mark.parametrize(
    ("plant", "back_off"),
    [(lag(1.0, 2.0, 0.5), 1.02), (spring(0.0), 1.02)],
)
def test_what_is_promised_is_what_the_frozen_loops_keep(plant, back_off):
    made = multiobjective(plant, L2(), back_off=back_off)
    loop = made.closed()
    worst = max(norm(*loop.matrices(p))[0] for p in np.linspace(0.0, 1.0, 11))
    assert worst <= made.promised * PROVEN
    assert made.promised == pytest.approx(back_off * made.optimum, rel=1e-12)


def test_what_cannot_be_asked():
    with pytest.raises(InputError, match="expected one or more of L2, H2 and EnergyToPeak"):
        multiobjective(spring(), [])
    with pytest.raises(InputError, match="a pole region is for continuous time"):
        multiobjective(spring().sampled(0.1), L2(), region=PoleRegion(decay=1.0))
    with pytest.raises(InputError, match="X and Y depend on p"):
        multiobjective(spring(), L2(), 0.5, X=1, Y=1)
    with pytest.raises(InputError, match="no pole has a real part below"):
        PoleRegion(decay=2.0, radius=1.0)
    with pytest.raises(InputError, match="bound: expected a finite number > 0"):
        L2(bound=-1.0)
