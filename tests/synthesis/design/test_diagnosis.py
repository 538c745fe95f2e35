"""Why a synthesis must fail, in sentences that name modes, signals and frequencies."""

import control
import numpy as np
import pytest
from design_plants import first_order, named, random_plant

from symheli import LinearModel
from symheli.errors import InputError
from synthesis import h2, hinf
from synthesis.design.plant.diagnosis import reasons
from synthesis.design.plant.generalized import Channels, Generalized
from synthesis.design.plant.unreachable import unreachable_gain
from synthesis.designs import DesignStatus, mixed_sensitivity, ncfsyn


def said(model, controls, measurements, **how):
    groups = controls, measurements
    return reasons(Generalized.of(model, *groups), Channels.of(model, *groups), dt=model.dt, **how)


def about(oscillation=0.1, through=0.0, heading=0.0, turned=None, unit=1.0):
    """v and p swing, driven by d_ped as far as `through`; psi is measured as far as `heading`."""
    A = np.diag([oscillation, oscillation, -1.0, 0.0])
    A[0, 1], A[1, 0] = 2.0, -2.0
    B = np.array([[1.0, 0, 0, through], [0, 1.0, 0, 0], [0, 0, 0, 1.0], [0, 1.0, 0, 1.0]])
    C = np.array([[1.0, 0, 0, 0], [0, 0, 0, 1.0], [0, 0, 0, 0], [1.0, 0, 0, heading]])
    D = np.zeros((4, 4))
    D[2, 3] = D[3, 2] = 1.0
    T = np.diag([1.0, unit, 1.0, 1 / unit]) if turned is None else turned
    return (
        LinearModel(
            np.linalg.solve(T, A @ T),
            np.linalg.solve(T, B),
            C @ T,
            D,
            ["v", "p", "b1", "psi"],
            ["w1", "w2", "n", "d_ped"],
            ["z_v", "z_psi", "z_u", "y"],
        ),
        ["d_ped"],
        ["y"],
    )


@pytest.mark.parametrize("unit", [1.0, 1e5])
def test_modes_that_are_not_reached_or_seen_are_named(unit):
    plant = about(unit=unit)
    swing, heading = said(*plant)
    assert swing.startswith(
        "the mode at 0.1 +- 2j rad/s (mostly v, p) is not stable, and d_ped cannot stabilise it"
    ) or swing.startswith(
        "the mode at 0.1 +- 2j rad/s (mostly p, v) is not stable, and d_ped cannot stabilise it"
    )
    assert heading.startswith(
        "the mode at 0 rad/s (mostly psi) is not stable, and y cannot detect it"
    )
    for design in (hinf(*plant), h2(*plant)):
        assert design.status is DesignStatus.IMPOSSIBLE
        assert design.controller is None
        assert design.reasons == (swing, heading)
        assert swing in str(design)


def test_a_little_authority_is_enough():
    assert said(*about(through=1e-3, heading=1e-3)) == ()
    assert said(*about(oscillation=-0.1, heading=1.0)) == ()  # stable by itself


def test_sampled_modes_are_named_as_such():
    model, u, y = about()
    swing, heading = said(model.discretize(0.05), u, y)[:2]
    assert swing.startswith("the mode z = 1 +- 0.1003j (mostly")
    assert heading.startswith("the mode z = 1 (mostly psi)")


def test_a_double_integrator_that_is_not_driven_is_found_in_any_coordinates():
    """Its eigenvalue is known to a root of the rounding only."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        A = np.zeros((5, 5))
        A[0, 1] = 1.0
        A[2:, 2:] = [[-1, 2, 0], [0, -3, 1], [0, 0, -2]]
        B = np.vstack([np.hstack([rng.standard_normal((2, 2)), np.zeros((2, 1))]), np.ones((3, 3))])
        C = rng.standard_normal((3, 5))
        D = np.array([[0, 0, 0], [0, 0, 1.0], [0, 1.0, 0]])
        T = rng.standard_normal((5, 5))
        plant = named(np.linalg.solve(T, A @ T), np.linalg.solve(T, B), C @ T, D, 1, 1)
        assert any("the mode at 0 rad/s" in r and "stabilise" in r for r in said(*plant)), seed


@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("seed", range(30))
def test_nothing_is_said_of_a_plant_that_has_a_controller(seed, dt):
    assert said(*random_plant(seed, dt)) == ()


def test_a_control_without_a_price_and_a_measurement_without_noise_are_named():
    def plant(price, noise):
        D = np.zeros((5, 6))
        D[1:3, 4:], D[3:, 2:4] = price, noise
        B = [[1.0, 1.0, 0, 0, 1.0, 2.0]]
        return (
            LinearModel(
                [[-1.0]],
                B,
                [[1.0], [0], [0], [1.0], [1.0]],
                D,
                ["x"],
                ["w1", "w2", "n1", "n2", "d_lat", "d_ped"],
                ["z1", "z2", "z3", "phi", "r"],
            ),
            ["d_lat", "d_ped"],
            ["phi", "r"],
        )

    full = np.eye(2)
    assert said(*plant(full, full)) == ()
    (pedals,) = said(*plant(np.diag([1.0, 0.0]), full))
    assert pedals.startswith("d_ped is not in the performance (D12 loses column rank)")
    (both,) = said(*plant(np.array([[1.0, 2.0], [2.0, 4.0]]), full))
    assert both.startswith("the combination 1 d_lat - 0.5 d_ped is not in the performance")
    (sensor,) = said(*plant(full, np.diag([0.0, 1.0])))
    assert sensor.startswith("phi has no noise (D21 loses row rank)")
    assert said(*plant(1e-6 * full, full)) == ()  # a small price is one


def integrator(performance, disturbance, dt=None):
    """psi' = r, r' = -r + d_ped; `performance` on psi, `disturbance` on r."""
    model = LinearModel(
        [[0.0, 1.0], [0.0, -1.0]],
        [[0, 0, 0], [disturbance, 0, 1.0]],
        [[performance, 1.0], [0, 0], [1.0, 0]],
        [[0, 0, 0], [0, 0, 1.0], [0, 1.0, 0]],
        ["psi", "r"],
        ["w", "n", "d_ped"],
        ["z", "z_u", "y"],
    )
    return (model if dt is None else model.discretize(dt)), ["d_ped"], ["y"]


@pytest.mark.parametrize("dt", [None, 0.02])
def test_zeros_on_the_border_of_stability_are_named(dt):
    (unseen,) = said(*integrator(0.0, 1.0, dt))
    assert unseen.startswith("psi can move at 0 rad/s unseen by the performance")
    (still,) = said(*integrator(1.0, 0.0, dt))
    assert still.startswith("no disturbance moves psi")
    assert "at 0 rad/s" in still
    assert said(*integrator(1.0, 1.0, dt)) == ()


def test_a_zero_at_a_frequency_is_found_there():
    """The control can hold z = x1'' + 9 x1 at zero while x1 swings at 3 rad/s."""
    A = [[0, 1.0], [-4.0, -1.0]]
    plant = named(
        A, [[0, 0, 0], [1.0, 0, 1.0]], [[5.0, -1.0], [1.0, 0]], [[0, 0, 1.0], [0, 1.0, 0]], 1, 1
    )
    (sentence,) = said(*plant)
    assert "can move at 3 rad/s unseen by the performance" in sentence


def test_a_family_says_where():
    model, u, y = about(heading=1.0)
    P, names = Generalized.of(model, u, y), Channels.of(model, u, y)
    B2 = np.stack([P.B2, P.B2 + np.array([[1.0], [0], [0], [0]]), P.B2])
    found = reasons(P._replace(B2=B2), names, at=["V = 0 m/s", "V = 5 m/s", "V = 10 m/s"])
    (sentence,) = found
    assert sentence.startswith("at V = 0 m/s and 1 more: the mode at 0.1 +- 2j rad/s")


@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("seed", range(1, 20, 2))
def test_what_no_controller_can_lower_is_below_every_optimum(seed, dt):
    plant = random_plant(seed, dt)
    floor = unreachable_gain(Generalized.of(*plant), dt)
    assert 0 <= floor.gamma <= hinf(*plant).optimum * (1 + 1e-7)


def test_the_part_no_controller_can_lower_is_known_in_closed_form():
    """z = (W (w + G u), c u): orthogonal to (W G, c) is |W c|/sqrt(c^2 + |W G|^2) of w, the largest
    where the peak of the weight meets the roll-off of the plant.
    """
    G, W, c = (
        control.ss(control.tf([2.0], [1.0, 1.0])),
        control.ss(control.tf([3.0], [10.0, 1.0])),
        0.5,
    )
    floor = unreachable_gain(
        Generalized.of(
            *named(
                [[-1, 0], [1.0, -0.1]],
                [[0, 2.0], [1.0, 0]],
                [[0, 0.3], [0, 0], [1.0, 0]],
                [[0, 0], [0, c], [1.0, 0]],
                1,
                1,
            )
        )
    )
    s = 1j * np.concatenate([[0.0], np.geomspace(1e-3, 1e3, 20001)])
    w, g = np.abs(W(s)), np.abs(G(s))
    grid = w * c / np.hypot(c, w * g)
    assert floor.gamma == pytest.approx(grid.max(), rel=1e-6)  # the grid's spacing squared
    assert floor.omega == pytest.approx(s.imag[grid.argmax()], rel=2e-3)
    assert floor.gamma <= mixed_sensitivity(G, W, c).optimum * (1 + 1e-8)


def arm(price, gamma=None):
    """A stiff arm moved by a weak torque, and a weight with DC gain 3.819833 on its error."""
    s = control.tf("s")
    G = LinearModel.from_control(
        control.ss(1e-3 / (s**2 + 0.1 * s + 1)), inputs=["torque"], outputs=["tip"]
    )
    return mixed_sensitivity(G, control.ss(3.819833 / (10 * s + 1)), price, gamma=gamma)


def test_a_gamma_that_is_the_dc_gain_of_the_weight_is_said_to_prove_nothing():
    unscaled = arm(1.0)
    assert unscaled.optimum == pytest.approx(3.819833, rel=1e-5)
    decided, idle = unscaled.reasons
    assert decided.startswith("gamma = 3.81981 proves nothing: whatever the controller does")
    assert "the gain from tip_disturbance to S_tip is at least 3.8198" in decided
    assert "at 0 rad/s (the DC gain of the weight)" in decided
    assert "with the controls at rest" in idle
    below = arm(1.0, gamma=2.0)
    assert below.status is DesignStatus.TOO_LOW
    assert "gamma = 2 cannot be reached" in below.reasons[1]
    assert "the DC gain of the weight" in below.reasons[1]


def test_a_gamma_that_one_frequency_decides_is_said_to_be_that():
    """With a cheap control the price at one frequency is all: not the weight alone."""
    design = arm(1e-3)
    (sentence,) = design.reasons
    assert design.optimum < 0.3 * 3.819833
    assert "is limited at a single frequency" in sentence
    assert "KS_torque" in sentence


def test_nothing_is_said_of_a_gamma_that_the_loop_decides():
    assert hinf(*first_order(1.0, 2.0, 0.5)).reasons == ()
    design = ncfsyn(control.ss(control.tf([1.0], [1.0, -1.0])))
    assert design.reasons == ()
    assert "gamma = " in str(design)


def test_levels_and_systems_that_cannot_be_are_refused():
    model, u, y = first_order(0.0, 3.0, 2.0)
    for gamma in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="gamma: expected a number from"):
            hinf(model, u, y, gamma=gamma)
    for back_off in (0.99, np.nan):
        with pytest.raises(InputError, match="back_off: expected numbers from 1 to"):
            hinf(model, u, y, back_off=back_off)
    with pytest.raises(InputError, match="expected a LinearModel or a system of python-control"):
        h2(np.eye(3), u, y)
    theirs = control.ss([[0.0]], [[1.0]], [[1.0]], [[np.nan]])
    with pytest.raises(InputError, match="must be a finite number"):
        ncfsyn(theirs)
    nyquist = LinearModel(
        [[-1.0]],
        [[1.0, 0, 1.0]],
        [[1.0], [0], [1.0]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
        ["x"],
        ["w", "n", "u"],
        ["z", "z_u", "y"],
        0.1,
    )
    assert "half the sample frequency" in hinf(nyquist, ["u"], ["y"]).reasons[0]


def test_a_level_out_of_reach_says_which_side_fails():
    design = hinf(*first_order(0.0, 3.0, 2.0), gamma=0.5)
    assert design.status is DesignStatus.TOO_LOW
    assert np.isinf(design.hinf_norm)
    assert "gamma = 0.5 is out of reach" in design.reasons[0]
