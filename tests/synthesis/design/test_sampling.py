"""Controllers sampled, and flown."""

from dataclasses import replace

import numpy as np
import pytest
from scheduled_plants import spring_controller
from scipy.linalg import expm

import symheli
from symheli.errors import InputError
from symheli.flight.controller import SCHEDULING
from symheli.values.named_vector import NamedVector
from synthesis import Plant, output_feedback, state_feedback
from synthesis.design.loops.controller import SAMPLED
from synthesis.design.plant.sampling import tustin
from synthesis.numerics.linear.norm import norm


@pytest.fixture(scope="module")
def made():
    return spring_controller()


@pytest.mark.slow
def test_sampling_by_tustin_keeps_the_norm_at_every_condition(made):
    """The rule maps the imaginary axis onto the unit circle: the H-infinity norm of what is sampled
    is that of what was continuous, but for the functions of p fitted to it.
    """
    sampled = made.discretize(0.05)
    assert sampled.dt == 0.05
    for p in (0.0, 0.3, 0.8, 1.0):
        before, after = (c.model.matrices(p) for c in (made, sampled))
        assert norm(*after, 0.05)[0] == pytest.approx(norm(*before)[0], rel=1e-3)


def test_responses_agree_at_warped_frequencies(made):
    dt, p = 0.05, 0.4
    omega = np.array([0.5, 3.0, 12.0])
    sampled = made.discretize(dt).at(p).frequency_response(omega)
    warped = made.at(p).frequency_response(2 / dt * np.tan(omega * dt / 2))
    # of functions of p fitted to what is sampled: see model.residuals
    np.testing.assert_allclose(sampled, warped, rtol=1e-3)


def test_what_cannot_be_sampled(made):
    with pytest.raises(InputError, match=r"already sampled \(dt = 0.02 s\)"):
        made.discretize(0.02).discretize(0.02)
    with pytest.raises(InputError, match="dt: expected a number > 0"):
        made.discretize(0.0)


@pytest.mark.parametrize("table", [False, True])
def test_what_is_sampled_may_hold_on_less_than_its_functions_of_p_do(made, table):
    """Between 0.1 and 0.75 alone, of functions over 0 to 1: as the whole is there."""
    model = made.model
    if table:
        basis, p = symheli.lpv.PiecewiseLinear((0.0, 0.3, 0.6, 1.0)), np.linspace(0.0, 1.0, 31)
        A, B, C, D = (basis.fit(p, M) for M in model.matrices(p))
        model = replace(model, basis=basis, A=A, B=B, C=C, D=D, trim=None, residuals=None)
    (whole,) = model.parameters
    part = tustin(model.with_scheduling(replace(whole, low=0.1, high=0.75)), 0.02)
    for p in (0.1, 0.3, 0.5, 0.75):
        exact = model.at(p).discretize(0.02, "tustin")
        np.testing.assert_allclose(part.at(p).A, exact.A, atol=1e-3)


# --- the loop of a sampled controller -------------------------------------------------------------


def held_by_hand(plant, p, dt):
    """exp([A B; 0 0] dt) of all inputs at one p: no code of the package but the matrices."""
    A, B1, B2, *_ = (np.atleast_2d(M) for M in plant.at(p))
    n, B = len(A), np.hstack([B1, B2])
    whole = expm(dt * np.block([[A, B], [np.zeros((B.shape[1], n + B.shape[1]))]]))
    return whole[:n, :n], whole[:n, n:]


@pytest.mark.parametrize("table", [False, True])
def test_the_plant_of_a_sampled_controller_holds_its_inputs_between_the_samples(made, table):
    """Both as polynomials and as a table; within what the functions of p cannot hold, which the
    residuals say.
    """
    if table:
        own = made.plant.model
        basis = symheli.lpv.PiecewiseLinear(tuple(np.linspace(0.0, 1.0, 11)))
        p = np.linspace(0.0, 1.0, 11)
        fit = [basis.fit(p, M) for M in own.matrices(p)]
        as_table = symheli.LPVStateSpace(
            basis, *fit, own.parameters, own.states, own.inputs, own.outputs
        )
        made = replace(made, plant=replace(made.plant, model=as_table))
    plant = made.discretize(0.05).loop_plant
    off = plant.model.residuals
    assert plant.dt == 0.05
    for p in (0.0, 0.27, 1.0):
        A, B = held_by_hand(made.plant, p, 0.05)
        found = plant.at(p)
        tolerance = 1e-9 + 1.1 * max(np.abs(off.A).max(), np.abs(off.B).max())
        assert tolerance < 1e-3
        np.testing.assert_allclose(found.A, A, atol=tolerance)
        np.testing.assert_allclose(np.hstack([found.B1, found.B2]), B, atol=tolerance)


@pytest.mark.slow
def test_a_sampled_controller_is_certified_and_says_that_the_loop_is_sampled(made):
    proof = made.discretize(0.02).certify(search=None)
    assert proof.verified
    assert SAMPLED.format(dt=0.02) in proof.hypotheses
    assert not any("sampled" in sentence for sentence in made.certify(search=None).hypotheses)
    # what no proof can beat: the loop of the plant held by hand at each p
    for p in (0.0, 0.5, 1.0):
        A, B = held_by_hand(made.plant, p, 0.02)
        of = made.plant.at(p)
        K = made.discretize(0.02).at(p)
        n = of.B1.shape[1]
        loop = (
            np.block([[A + B[:, n:] @ K.D @ of.C2, B[:, n:] @ K.C], [K.B @ of.C2, K.A]]),
            np.vstack([B[:, :n] + B[:, n:] @ K.D @ of.D21, K.B @ of.D21]),
            np.hstack([of.C1 + of.D12 @ K.D @ of.C2, of.D12 @ K.C]),
            of.D11 + of.D12 @ K.D @ of.D21,
        )
        assert norm(*loop, 0.02)[0] <= proof.gamma * (1 + 1e-5)


@pytest.mark.slow
def test_a_sampled_controller_may_be_reduced(made):
    assert made.discretize(0.02).reduce(1).certify(search=None).verified


def test_an_uncertain_plant_is_not_sampled_and_says_what_to_do(made):
    plant = made.plant
    lossy = symheli.UncertainStateSpace(plant.model, ["u"], ["y"], 0.1, 1.0, "by choice")
    uncertain = Plant(lossy, ["w"], ["z"], [], [])
    with pytest.raises(InputError, match="start from an uncertain model that is sampled"):
        replace(made, plant=uncertain).discretize(0.02).certify()


# --- on the helicopter -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def roll():
    """Gains from roll rate and attitude, for a roll axis that gets livelier with airspeed."""
    model = symheli.LPVStateSpace.polynomial(
        [[[-8.0, 0], [1, 0]], [[-0.4, 0], [0, 0]]],
        [[[1, 120.0], [0, 0]]],
        [[[0, 1], [0, 0], [1, 0], [0, 1]]],
        [[[0, 0], [0, 20.0], [0, 0], [0, 0]]],
        symheli.Scheduling("airspeed", "m/s", 0.0, 6.0, rate=3.0),
        states=["p", "phi"],
        inputs=["gust", "d_lat"],
        outputs=["z_phi", "z_lat", "p", "phi"],
    )
    return state_feedback(
        Plant(
            model,
            disturbances=["gust"],
            performance=["z_phi", "z_lat"],
            controls=["d_lat"],
            measurements=["p", "phi"],
        )
    )


def test_a_sampled_controller_flies(ideal, roll):
    """What was commanded in the record is the trim and the gains at each airspeed, within the
    travel.
    """
    made = roll.discretize(0.02)
    assert isinstance(made, symheli.flight.PureController)
    schedule = symheli.AirspeedSchedule.transition(2.0, 3.0, acceleration=1.0, hold=0.3)
    record = symheli.fly(ideal, schedule, controller=made)
    error = np.stack([record[x] - record[f"{x}_reference"] for x in ("p", "phi")], axis=1)
    D = made.model.matrices(record["airspeed_command"]).D
    travel = dict(zip(ideal.inputs, ideal.travel, strict=True))["d_lat"]
    expected = record["d_lat_reference"] + np.einsum("kij,kj->k", D, error)
    expected = np.clip(expected, -travel, travel)
    assert np.abs(error).max() > 1e-4
    # the machine adds the same products in another order
    np.testing.assert_allclose(record["d_lat"], expected, atol=1e-12)


@pytest.mark.slow
def test_a_design_against_a_reference_flies_as_it_is(ideal, roll):
    """`phi_error` of the plant is reference minus phi; a flight subtracts the other way round."""
    own = roll.plant.with_reference(["phi"]).with_noise({"p": 0.02, "phi_error": 0.02})
    made = output_feedback(own).discretize(0.02)
    assert "phi_error" in made.model.inputs
    schedule = symheli.AirspeedSchedule.transition(2.0, 3.0, acceleration=1.0, hold=0.3)
    table = symheli.TableController.of(made, 9)
    assert "phi" in table.inputs
    windy = symheli.Wind(
        (0.0, 2.0, 0.0), turbulence=symheli.environment.Dryden(wind=6.0, altitude=20.0)
    )
    flown = []
    for controller in (made, table):
        record = symheli.fly(ideal, schedule, controller=controller, wind=windy, seed=1)
        flown.append(record["d_lat"] - record["d_lat_reference"])
    rebuilt = made.model.matrices(2.0).D[0]
    np.testing.assert_allclose(
        made.scheduled_controller.model.matrices(2.0).D[0],
        rebuilt * [-1.0 if u == "phi_error" else 1.0 for u in made.model.inputs],
    )
    # nine airspeeds: within the misfit of the table, with a margin for how the flights part
    assert table.misfit < 1e-2
    np.testing.assert_allclose(flown[1], flown[0], atol=10 * table.misfit * np.ptp(flown[0]))
    assert np.ptp(flown[0]) > 1e-5


@pytest.mark.slow
def test_its_states_begin_at_zero(roll):
    """Step by step, twice: a controller with states, from noisy readings."""
    noisy = roll.plant.with_noise({"p": 0.02, "phi": 0.02})
    made = output_feedback(noisy).discretize(0.02)
    assert made.order > 0
    rng = np.random.default_rng(0)
    zero = dict.fromkeys(("d_lon", "d_lat", "d_col", "d_ped", "p", "phi"), 0.0)
    readings = [{"p": p, "phi": phi, "airspeed": 3.0} for p, phi in rng.normal(size=(5, 2))]
    at = NamedVector(SCHEDULING, np.array([3.0, 0.0]))

    def answers():
        state, out = made.init(), []
        for y in readings:
            u, state = made.step(state, y, zero, at)
            out.append(u)
        return np.array(out)

    first = answers()
    np.testing.assert_array_equal(first, answers())
    A, B, C, D = made.model.matrices(3.0)
    x = np.zeros(made.order)
    for y, u in zip(readings, first, strict=True):
        e = np.array([y[name] for name in made.model.inputs])
        np.testing.assert_allclose(u, [0.0, *(C @ x + D @ e), 0.0, 0.0], atol=1e-12)
        x = A @ x + B @ e


def test_a_continuous_controller_says_how_to_fly(ideal, roll):
    hover = symheli.AirspeedSchedule((2.0,), (1.0,), (0.0,), lead=0.2)
    with pytest.raises(InputError, match=r"sample it with .discretize\(dt\)"):
        symheli.fly(ideal, hover, controller=roll)
