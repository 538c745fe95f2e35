"""Dwell times against closed forms and a published number; switched designs proven and flown."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import symheli
import synthesis
from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.flight import XCELL_SERVOS
from symheli.flight.autopilot import gain_scheduled_lqr

PUBLISHED = [[[0.0, 1.0], [-10.0, -1.0]], [[0.0, 1.0], [-0.1, -0.5]]]
"""Geromel and Colaneri, SIAM J. Control and Optimization 45 (2006), section 3."""
TRIPLED = {(0, 1): [[3.0]], (1, 0): [[3.0]]}


@pytest.mark.slow
def test_a_state_that_triples_at_every_switch_must_fall_by_as_much():
    """x' = -x: ln 3 seconds, as a minimum and as an average; with -x and -2x in turn ln(3)/3."""
    exact = math.log(3)
    least = synthesis.switching.dwell_time([[[-1.0]], [[-1.0]]], TRIPLED, parts=8)
    mean = synthesis.switching.dwell_time([[[-1.0]], [[-1.0]]], TRIPLED, average=True)
    assert least.verified
    assert mean.verified
    assert exact < least.seconds < 1.005 * exact  # `SPARE_DECAYS`, `ACCURACY`
    assert exact < mean.seconds < 1.02 * exact  # the last of `DECAYS`
    two = synthesis.switching.dwell_time(
        [[[-1.0]], [[-2.0]]], {(0, 1): [[3.0]], (1, 0): [[1.0]]}, parts=8
    )
    assert exact / 3 < two.seconds < 1.01 * exact / 3
    sampled = synthesis.switching.dwell_time([[[0.9]], [[0.9]]], TRIPLED, dt=0.1)
    assert sampled.seconds == pytest.approx(0.1 * math.ceil(exact / -math.log(0.9)))


def test_the_published_bound_is_met_and_not_undercut():
    """2.7508 s is the least of their inequalities; by our own bisection of these in cvxpy 2.75084.
    Below 2.70 s a periodic signal is unstable, and no proof may be found.
    """
    found = synthesis.switching.dwell_time(PUBLISHED, within=2.77)
    assert found.verified
    assert found.verify()
    assert 0 < found.seconds <= 2.77
    A1, A2 = map(np.array, PUBLISHED)
    radius = [
        np.abs(np.linalg.eigvals(expm(A1 * s) @ expm(A2 * t))).max()
        for s in np.linspace(2.7, 2.9, 5)
        for t in np.linspace(2.7, 6, 67)
    ]
    assert max(radius) > 1
    for short in (2.7, 2.74):
        assert not synthesis.switching.dwell_time(PUBLISHED, within=short).verified
    mean = synthesis.switching.dwell_time(PUBLISHED, average=True)
    assert mean.verified
    assert mean.seconds > 2.7508  # what an average allows a minimum does


@pytest.mark.slow
def test_the_least_published_dwell_time_is_found_by_bisection():
    found = synthesis.switching.dwell_time(PUBLISHED, parts=64)
    assert 2.7508 < found.seconds < 2.76
    sampled = synthesis.switching.dwell_time([expm(0.05 * np.array(A)) for A in PUBLISHED], dt=0.05)
    assert 2.75 < sampled.seconds <= 2.8001


def test_a_forged_proof_is_not_verified():
    """Of a shorter time, of another model, with a P that is altered, or of a steeper decay."""
    found = synthesis.switching.dwell_time(PUBLISHED, within=2.8)
    own = found.modes
    other = replace(found, modes=own._replace(A=own.A[::-1]))
    larger = {key: 1.2 * J for key, J in own.jumps.items()}
    for forged in (
        replace(found, lengths=0.9 * found.lengths),
        other,
        replace(found, P=(found.P[0], 1.3 * found.P[1])),
        replace(found, decay=0.5),
        replace(found, modes=own._replace(jumps=larger)),
        replace(found, P=tuple(M + np.array([[0.0, -1.0], [0.0, 0.0]]) for M in found.P)),
        replace(found, lengths=-found.lengths),
    ):
        assert not forged.verify()


def test_a_mode_that_moves_with_p_is_proven_over_its_whole_range():
    """A(p) = [-1, 4 p; -4 p, -1] rotates faster or slower: V = x'x falls at every p."""
    turning = LPVStateSpace.polynomial(
        A=[[[-1.0, 0.0], [0.0, -1.0]], [[0.0, 4.0], [-4.0, 0.0]]],
        B=np.zeros((1, 2, 0)),
        C=np.zeros((1, 0, 2)),
        D=np.zeros((1, 0, 0)),
        scheduling=Scheduling("p", "1", 0.0, 1.0),
        states=["x", "y"],
        inputs=[],
        outputs=[],
    )
    jumps = {(i, j): 3.0 * np.eye(2) for i in range(2) for j in range(2) if i != j}
    found = synthesis.switching.dwell_time([turning, turning], jumps, within=1.3)
    assert found.verified
    assert not synthesis.switching.dwell_time(
        [turning, turning], jumps, within=1.05
    ).verified  # ln 3 = 1.0986
    unstable = synthesis.switching.dwell_time([turning, np.eye(2)])
    assert not unstable.verified
    assert "mode 1 is not stable" in str(unstable)


def lateral(heli):
    """The lateral axis of the X-Cell, sampled, behind a delay."""
    family = symheli.sweep(heli, np.linspace(0, 13, 14), inputs=("d_lat", "v_w"))
    model = family.select(("v", "p", "phi", "b1")).interpolate("polynomial", 3, rate=3.0)
    measured = ("v", "p", "phi")
    return (
        synthesis.Plant(model, ["v_w"], [*measured, "d_lat"], ["d_lat"], measured)
        .sampled(0.02)
        .with_delay(0.02)
        .weighted({"v_w": 2.0, "v": 0.5, "p": 0.5, "phi": 5.0, "d_lat": 100.0})
    )


@pytest.fixture(scope="module")
def heli():
    return symheli.Helicopter.load("xcell60", governor="ideal")


@pytest.fixture(scope="module")
def made(heli):
    plant = lateral(heli)
    whole = synthesis.lqr(plant)
    return synthesis.switching.switched(plant, [whole.at(v) for v in (3.0, 10.0)], [6.5], 2.0)


class Watched:
    """A controller, its commands and what flew it; from `switch` on entered after another one."""

    def __init__(self, other, pilot=None, switch=0):
        self.other, self.pilot, self.switch, self.dt = other, pilot or other, switch, 0.02

    def reset(self):
        self.commands, self.designs, self.state = [], [], self.pilot.init()

    def step(self, measured, reference, p):
        k = len(self.commands)
        if k == self.switch > 0:
            self.state = self.other.init(self.commands[-1][: len(self.other.model.outputs)])
        flown = self.other if k >= self.switch else self.pilot
        u, self.state = flown.step(self.state, measured, reference, p)
        self.commands.append(u)
        self.designs.append(getattr(self.state, "design", 0))
        return u


def load_factor(record):
    """Normal acceleration along the body axis, g."""
    t = record.time
    w = np.gradient(record["w"], t) + record["p"] * record["v"] - record["q"] * record["u"]
    return w / 9.81 - np.cos(record["phi"]) * np.cos(record["theta"])


@pytest.mark.slow
def test_designs_switch_without_a_step_of_the_command_and_with_hysteresis(heli, made):
    there = symheli.AirspeedSchedule.transition(4.0, 9.0, acceleration=1.0, hold=0.5)
    watched = Watched(made)
    record = symheli.fly(heli, there, controller=watched)
    u, design = np.array(watched.commands), np.array(watched.designs)
    (up, down) = np.flatnonzero(np.diff(design))
    steps = np.abs(np.diff(u, axis=0)).max(axis=1)
    assert steps[up] < 2 * steps[up - 20 : up].max()
    assert steps[down] < 2 * steps[down - 20 : down].max()
    hard = Watched(replace(made, fade=1e-6))
    symheli.fly(heli, there, controller=hard)
    bumped = np.abs(np.diff(hard.commands, axis=0)).max(axis=1)
    assert (bumped[[up + 1, down + 1]] > 3 * steps[[up + 1, down + 1]]).any()
    usual = symheli.fly(heli, there, controller=synthesis.lqr(made.plant))
    for k in (up, down):
        after = slice(k, k + 100)
        assert np.degrees(np.abs(record["phi"] - usual["phi"])[after]).max() < 3
        assert np.abs(load_factor(record) - load_factor(usual))[after].max() < 0.05


@pytest.mark.slow
def test_the_switched_loop_is_proven(made):
    proof = made.certify(3.0)
    assert proof.verified
    assert proof.seconds <= (made.travel - 3.0 * 0.02) / 3.0
    assert made.travel == 2.0
    with pytest.raises(InputError, match="widen the hysteresis"):
        made.certify(80.0)


@pytest.mark.parametrize("at", [200, pytest.param(500, marks=pytest.mark.slow)])
def test_an_lqg_enters_a_transition_without_a_bump(heli, at):
    """From the scheduled LQR with servos: attitude within 3 deg and .05 g of what it would have
    done, the first command the one in force.
    """
    from studies.controllers.plant import baseline, design_plant

    pilot = gain_scheduled_lqr(heli, 0.0, 13.0, 0.02, 14, XCELL_SERVOS).scheduled_controller
    lqg = synthesis.lqg(design_plant(baseline(heli)), np.linspace(0, 13, 5)).discretize(0.02)
    slow = symheli.AirspeedSchedule.transition(0.0, 13.0, acceleration=1.0, hold=1.0)
    usual = symheli.fly(heli, slow, controller=pilot, servos=XCELL_SERVOS)
    watched = Watched(lqg, pilot, at)
    record = symheli.fly(heli, slow, controller=watched, servos=XCELL_SERVOS)
    np.testing.assert_allclose(watched.commands[at], watched.commands[at - 1], atol=1e-12)
    after = slice(at - 1, at + 100)
    for angle in ("phi", "theta"):
        assert np.degrees(np.abs(record[angle] - usual[angle])[after]).max() < 3
    assert np.abs(load_factor(record) - load_factor(usual))[after].max() < 0.05


def test_what_cannot_switch_is_refused_in_words(made):
    plant, (one, two) = made.plant, made.designs
    for designs, edges, width, words in (
        ([one], [6.5], 1.0, "one design more"),
        ([one, two], [6.5], 20.0, "leave 0 to 13"),
        ([one, two, one], [6.0, 6.5], 1.0, "overlap beyond"),
        ([one, synthesis.lqg(plant.with_noise(dict.fromkeys(("v", "p", "phi"), 0.1))).at(1.0)],
         [6.5], 1.0, "number of states"),
        ([synthesis.lqr(plant), two], [6.5], 1.0, "freeze it"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=words):
            synthesis.switching.switched(plant, designs, edges, width)
    with pytest.raises(InputError, match="same states"):
        synthesis.switching.dwell_time([[[-1.0]], -np.eye(2)])
    with pytest.raises(InputError, match="no pair of different modes"):
        synthesis.switching.dwell_time([[[-1.0]], [[-1.0]]], {(0, 2): [[1.0]]})
