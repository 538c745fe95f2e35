"""The study's controllers: their plants, their designs, and what is measured of their flights."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import symheli
from identification.judge import Criterion
from identification.judge.fit_for_control import FitForControl
from studies.controllers.certified import CertifiedControllers, bounded
from studies.controllers.covered import NO_TUBE
from studies.controllers.design_choices import (
    BACK_OFF,
    CONTROLS,
    DELAY,
    GUSTS,
    MEASUREMENTS,
    NOISE,
    NOISE_SHARE,
    PERIOD,
    TOP,
)
from studies.controllers.designs import (
    AIRSPEEDS,
    NEAR,
    Design,
    Designs,
    design,
    lqr_schedule,
    simplest,
    verdict_in_words,
)
from studies.controllers.flown import (
    WINDS,
    FlownControllers,
    TurbulentFlights,
    fly_controllers,
    plans,
)
from studies.controllers.identified_plant import continuous, with_gusts
from studies.controllers.in_airspeed import of_degree
from studies.controllers.measures import (
    Measures,
    energy_ratio,
    heading,
    noise_of,
    of_flight,
    to_body,
)
from studies.controllers.plant import actuator, baseline, closed, design_plant, flown_plant
from studies.setup.bounds import PLAIN, Bound
from studies.setup.stored_stages import Stored, StoredStages
from studies.transition import controller_tables as tables
from studies.transition.outcome import Outcome
from symheli import AirspeedSchedule, LPVStateSpace, Scheduling, Sensor
from symheli.errors import SynthesisError, ValidityWarning
from symheli.flight import XCELL_SERVOS, fly_batch
from synthesis.design.lpv.point_schedule import hinf_schedule
from synthesis.design.plant.sampling import tustin
from synthesis.numerics.linear.norm import norm


@pytest.fixture(scope="module")
def heli():
    return symheli.Helicopter.load("xcell60", governor="ideal")


@pytest.fixture(scope="module")
def base(heli):
    return baseline(heli)


@pytest.fixture(scope="module")
def lqr(heli, base):
    (found,) = design("LQR schedule", partial(lqr_schedule, heli), flown_plant(base))
    return found


def constant(model):
    return LPVStateSpace.constant(model, Scheduling("airspeed", "m/s", 0.0, TOP))


# --- plants -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CONTROLS)
def test_an_actuator_of_two_states_follows_the_servo_and_the_delay(name):
    """The next power of s is the third: eight times less at half the frequency."""
    servo, late = XCELL_SERVOS[name], DELAY + PERIOD / 2
    short, whole = actuator(servo, name, late), servo.linear(name)
    omega = np.array([0.0, 1.0, 2.0, 8.0])

    def response(model, s):
        return (model.C @ np.linalg.solve(s * np.eye(len(model.A)) - model.A, model.B))[0, 0]

    exact = np.array([response(whole, 1j * w) * np.exp(-1j * w * late) for w in omega])
    found = np.array([response(short, 1j * w) for w in omega])
    off = np.abs(found - exact)
    assert len(short.A) == 2
    assert off[0] < 1e-12
    assert 7.0 < off[2] / off[1] < 9.0
    assert off[3] < 0.1


def test_the_plant_of_the_design_has_two_states_a_servo_and_its_gusts_reach_it(base):
    plant = design_plant(base)
    assert len(plant.states) == len(base.states) + 2 * len(CONTROLS)
    assert plant.disturbances[:3] == GUSTS
    assert np.abs(plant.at(5.0).B1[:, :3]).max() > 0


def test_gusts_of_a_sampled_model_are_those_of_its_linearization(base):
    """A gust held between the samples enters through the integral of exp(A t); its column follows
    from that of the velocity without knowing it.
    """
    exact = base.at(6.0).discretize(PERIOD)
    known = constant(exact.select(inputs=list(CONTROLS)))
    found = with_gusts(known).at(6.0)
    assert found.inputs == exact.inputs
    assert np.allclose(found.B, exact.B, rtol=0.0, atol=1e-12 + 1e-9 * np.abs(exact.B).max())


def test_the_continuous_model_is_the_one_that_tustins_rule_samples(base):
    sampled = constant(base.at(6.0).discretize(PERIOD))
    again = tustin(continuous(sampled), PERIOD)
    for one, other in zip(again.matrices(6.0), sampled.matrices(6.0), strict=True):
        assert np.allclose(one, other, rtol=0.0, atol=1e-9 * max(1.0, np.abs(other).max()))


# --- designs ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_synthesis_that_finds_none_is_a_design_with_its_reason(base):
    def none():
        raise SynthesisError("nothing moves it")

    (found,) = design("LFT", none, flown_plant(base))
    assert found.controller is None
    assert found.reason == "nothing moves it"
    table = tables.designed(Designs(designs=(found,), plant=flown_plant(base)), None)
    assert table.rows[0][2] == "none exists"
    assert "nothing moves it" in table.remarks[0]


def judged(*criteria):
    """A `FitForControl` of rows (name, verdict, decides)."""
    rows = tuple(
        Criterion(name=n, value=1.0, threshold=1.0, verdict=v, source="", decides=d)
        for n, v, d in criteria
    )
    one = np.ones(1)
    return FitForControl(
        criteria=rows, points=(0.0,), margin=one, gap=one, second_gap=one, true_gap=None
    )


@pytest.mark.parametrize(
    ("verdict", "said"),
    [
        ("fit", "The identified model is fit for this loop, by the flight that it was identified"),
        ("not fit", "is not fit for this loop, by the flight that it was identified from: gap."),
        ("not known", "leaves open whether it is fit for this loop: gap."),
    ],
)
def test_the_verdict_on_a_model_is_a_sentence(verdict, said):
    rows = ("gap", verdict, True), ("slow modes", "not fit", False), ("record", "fit", True)
    text = verdict_in_words(judged(*rows))
    assert said in text
    assert text.endswith(".")
    assert "slow modes" not in text


@pytest.mark.slow
def test_the_schedule_of_point_designs_keeps_their_gain_at_each_point(base):
    plant = design_plant(base)
    made = hinf_schedule(plant, np.linspace(0.0, TOP, 3), BACK_OFF)
    for speed in (0.0, TOP / 2, TOP):
        loop = closed(plant, made.model)
        assert norm(*loop.matrices(speed), None)[0] <= made.promised * (1 + 1e-6)


@pytest.mark.slow
def test_what_flies_has_fewer_states_and_hardly_more_gain(base):
    plant, made = (
        flown_plant(base),
        hinf_schedule(design_plant(base), np.linspace(0.0, TOP, 4), BACK_OFF),
    )
    controller, frozen = simplest(made, plant)
    whole = closed(plant, made.discretize(PERIOD).model)
    full = max(norm(*whole.matrices(float(v)), PERIOD)[0] for v in np.linspace(0.0, TOP, AIRSPEEDS))
    assert len(controller.states) <= 10 < made.order
    assert frozen <= NEAR**2 * full


@pytest.mark.slow
def test_the_lqr_is_stable_behind_servos_and_delay(lqr, base):
    assert lqr.order == 0
    loop = closed(flown_plant(base), lqr.controller)
    radii = [np.abs(np.linalg.eigvals(loop.at(v).A)).max() for v in (0.0, 3.3, 9.7, TOP)]
    assert max(radii) < 1
    assert norm(*loop.matrices(TOP), PERIOD)[0] <= lqr.frozen * (1 + 1e-9)


def test_a_polynomial_of_its_own_degree_changes_nothing(base):
    again = of_degree(base, 3)
    assert np.allclose(again.at(7.7).A, base.at(7.7).A, rtol=0.0, atol=1e-9)


# --- measures -----------------------------------------------------------------------------------


def test_wind_turns_with_the_heading_and_keeps_its_strength():
    east = to_body(np.zeros(1), np.zeros(1), np.array([math.pi / 2]))[0]
    assert np.allclose(east @ [1.0, 0.0, 0.0], [0.0, -1.0, 0.0])
    nose_up = to_body(np.zeros(1), np.array([0.1]), np.zeros(1))[0]
    assert np.allclose(nose_up @ [0.0, 0.0, 1.0], [-math.sin(0.1), 0.0, math.cos(0.1)])
    R = to_body(*np.random.default_rng(0).uniform(-1, 1, (3, 50)))
    assert np.allclose(R @ np.swapaxes(R, 1, 2), np.eye(3))


def test_the_heading_of_a_level_turn_is_rate_times_time():
    n = 101
    level = {"q": np.zeros(n), "r": np.full(n, 0.2), "phi": np.zeros(n), "theta": np.zeros(n)}
    assert np.allclose(heading(level, 0.02), 0.2 * 0.02 * np.arange(n))


def test_the_energy_ratio_of_a_gain_is_that_gain():
    w = np.random.default_rng(1).standard_normal((200, 3))
    assert math.isclose(energy_ratio(2.5 * w, w), 2.5)


def test_what_the_sensors_added_is_known_to_rounding(heli):
    """Nothing is fed back, so that a flight without noise goes through the same states."""
    empty = np.zeros((1, 0, 0)), np.zeros((1, 0, 1)), np.zeros((1, 1, 0)), np.zeros((1, 1, 1))
    idle = LPVStateSpace(
        symheli.lpv.Polynomial(0, 0.0, TOP),
        *empty,
        Scheduling("airspeed", "m/s", 0.0, TOP),
        (),
        ("phi",),
        ("d_lat",),
        dt=PERIOD,
    )
    hover = AirspeedSchedule((0.5,), (1.0,), (0.0,), start=0.5, lead=0.6)
    noisy = {y: Sensor(noise=NOISE_SHARE * NOISE[y]) for y in MEASUREMENTS}
    (loud,) = fly_batch(heli, hover, seeds=[4], controller=idle, sensors=noisy).data
    (quiet,) = fly_batch(heli, hover, seeds=[4], controller=idle).data
    added = np.column_stack([loud.column(y) - quiet.column(y) for y in MEASUREMENTS])
    assert np.abs(added).max() > 0.1
    assert np.allclose(noise_of(loud), added, rtol=0.0, atol=1e-12)


@pytest.mark.slow
def test_measures_of_a_flight_are_those_of_its_record(lqr, base):
    """Still air but for the noise: forward airspeed, energy and commands from the record alone."""
    designs = Designs(designs=(lqr,), plant=flown_plant(base))
    plan = next(plan for _, wind, plan in plans(designs) if wind == 0.0)
    heli = symheli.Helicopter.load("xcell60", governor="pi")
    calm = replace(plan, wind=replace(plan.wind, steady=(0.0, 0.0, 0.0)))
    batch = fly_batch(heli, calm, seeds=[1])
    found, record = of_flight(batch.data[0]), batch[0]
    assert not found.lost
    assert found.stops == 0.0
    assert (
        abs(found.speed - np.sqrt(np.mean((record["airspeed"] - record["airspeed_command"]) ** 2)))
        < 0.05
    )
    parts = [found.deviations[name] ** 2 for name in found.deviations]
    assert math.isclose(found.deviation, math.sqrt(sum(parts)))
    commands = record["d_ped_command"] - record["d_ped_reference"]
    assert math.isclose(found.deviations["d_ped"], np.sqrt(np.mean(commands**2)) / 0.03)
    # no gust but what the heading makes of the still air, none: the disturbance is the noise
    noise = noise_of(batch.data[0]) / [NOISE[y] for y in MEASUREMENTS]
    energy = found.deviation**2 * len(noise)
    assert math.isclose(found.ratio, math.sqrt(energy / (noise**2).sum()), rel_tol=1e-9)


# --- what is said of flights --------------------------------------------------------------------


def flight(ratio, lost=False, outside=0.0, beyond=0.0, uncovered=""):
    return Measures(
        lost=lost,
        speed=1.0,
        deviation=1.0,
        deviations={},
        attitude=0.3,
        stops=0.0,
        ratio=ratio,
        outside=outside,
        faster=0.0,
        beyond=beyond,
        wind=3.0,
        uncovered=uncovered,
    )


def flights(name, wind, *each):
    return TurbulentFlights(name=name, wind=wind, gust=wind / 5, flights=each)


def test_the_table_says_which_share_of_the_flights_a_tube_covers():
    some = flights("a", WINDS[0], flight(1.0), flight(1.0, uncovered="gusts, m/s"))
    none = flights("b", WINDS[0], *[flight(1.0, uncovered=NO_TUBE)] * 2)
    table = tables.covered(FlownControllers(flown=(some, none), seeds=2, duration=9.0))
    assert [row[2] for row in table.rows] == ["50", "0"]
    assert [row[3] for row in table.rows] == ["gusts, m/s (1)", f"{NO_TUBE} (2)"]


def test_the_table_says_how_many_flights_the_equations_do_not_promise():
    some = flights("a", WINDS[0], flight(1.0), flight(1.0, beyond=0.25))
    none = flights("b", WINDS[0], flight(1.0), flight(1.0))
    (said,) = tables.beyond(FlownControllers(flown=(some, none), seeds=2, duration=9.0))
    assert said.startswith("In 1 of the 4 flights")
    assert said.endswith("in one for 25 % of the time.")
    assert tables.beyond(FlownControllers(flown=(none,), seeds=2, duration=9.0)) == []


@pytest.mark.slow
def test_the_share_beyond_the_equations_is_that_of_the_true_airspeed(lqr, base, ideal):
    designs = Designs(designs=(lqr,), plant=flown_plant(base))
    plan = next(plan for _, wind, plan in plans(designs) if wind == 0.0)
    fast = AirspeedSchedule.transition(18.0, 22.0, acceleration=2.0, hold=1.0)
    with pytest.warns(ValidityWarning, match="advance ratio"):
        batch = fly_batch(ideal, replace(plan, schedule=fast, controller=None))
    share = float(np.mean(batch[0]["airspeed"] > 0.155 * 167.0 * 0.775))
    assert 0.2 < share < 0.8
    assert of_flight(batch.data[0]).beyond == share


@pytest.fixture
def campaign():
    """The best ratio belongs to one that lost a flight; the others get worse with the wind."""
    flown = [
        one
        for k, wind in enumerate(WINDS)
        for one in (
            flights("reckless", wind, flight(0.1), flight(0.1, lost=True)),
            flights("steady", wind, flight(0.5 + k), flight(0.6 + k)),
            flights("slow", wind, flight(0.8 + k), flight(3.0 + k, outside=0.2)),
        )
    ]
    return FlownControllers(flown=tuple(flown), seeds=2, duration=20.0)


def test_a_controller_that_lost_a_flight_never_wins(campaign):
    for wind in WINDS:
        assert [one.name for one in campaign.ranked(wind)] == ["steady", "slow"]
    table = tables.flown(campaign, None)
    assert {table.rows[row][0] for row, _ in table.bold} == {"steady"}
    said = tables.conclusions(Outcome(vehicle="x", quick=True, seed=0, flown_controllers=campaign))
    assert "steady won" in said[0]
    assert "better than the next with 2 of 2 seeds" in said[0]
    assert "reckless (1 of 2)" in said[0]


def test_where_everyone_lost_flights_nobody_wins(campaign):
    fallen = tuple(replace(one, flights=(flight(0.2, lost=True),)) for one in campaign.flown)
    found = replace(campaign, flown=fallen)
    assert not tables.flown(found, None).bold
    said = tables.conclusions(Outcome(vehicle="x", quick=True, seed=0, flown_controllers=found))
    assert "none won" in said[0]


def test_the_size_at_which_a_gain_is_first_exceeded_is_the_least(campaign):
    assert campaign.exceeded("steady", 1.55).wind == WINDS[1]
    assert campaign.exceeded("slow", 2.9).wind == WINDS[0]
    assert campaign.exceeded("steady", 100.0) is None


def test_nothing_is_claimed_of_a_gain_that_was_not_proven():
    none = CertifiedControllers(bounds=())
    assert none.of("LFT") is None
    assert none.gain("LFT") == math.inf


# --- together -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_flights_are_the_same_for_every_controller_and_come_back_from_their_stage(
    lqr, base, tmp_path
):
    designs = Designs(designs=(lqr, replace(lqr, name="twin")), plant=flown_plant(base))
    found = fly_controllers("xcell60", designs, [0, 1])
    for wind in WINDS:
        one, other = found.at(wind)
        assert [f.ratio for f in one.flights] == [f.ratio for f in other.flights]
    stages = StoredStages(tmp_path, {"flown_controllers": "key"})
    stages.save("flown_controllers", Stored(result=found, seconds=1.0))
    again = stages.load("flown_controllers")
    assert [f.ratio for f in again.result.flown] == [f.ratio for f in found.flown]


@pytest.mark.slow
def test_the_proven_gain_of_the_lqr_is_above_its_frozen_one_and_above_every_flight(lqr, base):
    plant = flown_plant(base)
    (bound,) = bounded("LQR schedule", closed(plant, lqr.controller))
    assert isinstance(bound, Bound)
    assert bound.form == PLAIN
    assert bound.certificate.verified
    assert bound.certificate.gamma >= lqr.frozen
    designs = Designs(designs=(lqr,), plant=plant)
    found = fly_controllers("xcell60", designs, [0, 1])
    light = found.at(WINDS[0])[0]
    assert light.of(lambda f: f.ratio)[1] < bound.certificate.gamma


def test_a_design_without_a_controller_is_not_flown(lqr, base):
    none = Design(name="LFT", controller=None, reason="none")
    designs = Designs(designs=(none, lqr), plant=flown_plant(base))
    assert {name for name, _, _ in plans(designs)} == {lqr.name}
