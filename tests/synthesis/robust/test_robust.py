"""Output feedback for every model of a set."""

import pytest
from scheduled_plants import RATE, spring

from symheli import LPVStateSpace, Scheduling, UncertainStateSpace
from synthesis import Plant, l2_gain, output_feedback
from synthesis.numerics.linear.norm import norm
from synthesis.robust import DynamicBlock

BACK_OFF = 1.02


def uncertain(bound):
    """The spring with damping that is known up to `bound`: v' gains d, |d| <= bound |v|."""
    model = LPVStateSpace.polynomial(
        [[[0, 1], [-1, -0.4]], [[0, 0], [-2, 0.6]]],
        [[[0, 0, 0, 0], [1, 0, 1, 1]]],
        [[[1, 0], [0, 0], [1, 0], [0, 1]]],
        [[[0, 0, 0, 0], [0, 0, 0.3, 0], [0, 0.1, 0, 0], [0, 0, 0, 0]]],
        Scheduling("p", "1", 0.0, 1.0, rate=RATE),
        states=["x", "v"],
        inputs=["w", "n", "u", "d"],
        outputs=["z", "z_u", "y", "v_d"],
    )
    return Plant(
        UncertainStateSpace(model, ["d"], ["v_d"], bound, 1.0, "by choice"),
        disturbances=["w", "n"],
        performance=["z", "z_u"],
        controls=["u"],
        measurements=["y"],
    )


@pytest.mark.slow
def test_a_set_of_one_model_is_that_model():
    alone = output_feedback(spring(), X=0, Y=2, back_off=BACK_OFF).promised
    assert output_feedback(uncertain(0.0), X=0, Y=2, back_off=BACK_OFF).promised == pytest.approx(
        alone, rel=1e-4
    )


@pytest.mark.slow
def test_every_model_of_the_set_keeps_the_gain():
    made = output_feedback(uncertain(0.1), X=0, Y=2, back_off=BACK_OFF)
    loop = made.closed()
    assert isinstance(loop, UncertainStateSpace)
    proof = l2_gain(loop, search=None)
    assert proof.verified
    assert proof.gamma <= made.promised * (1 + 1e-3)  # of functions fitted to the gains
    for delta in loop.perturbations(20, seed=0):
        one = loop.perturbed(delta)
        for p in (0.0, 0.5, 1.0):
            assert norm(*one.matrices(p))[0] <= proof.gamma * (1 + 1e-9)


def two_blocks():
    """The spring with dynamics of gain .05 beside its damping, and of .1 at the control."""
    model = LPVStateSpace.polynomial(
        [[[0, 1], [-1, -0.4]], [[0, 0], [-2, 0.6]]],
        [[[0, 0, 0, 0, 0], [1, 0, 1, 1, 1]]],
        [[[1, 0], [0, 0], [1, 0], [0, 1], [0, 0]]],
        [[[0] * 5, [0, 0, 0.3, 0, 0], [0, 0.1, 0, 0, 0], [0] * 5, [0, 0, 1, 0, 0]]],
        Scheduling("p", "1", 0.0, 1.0, rate=RATE),
        states=["x", "v"],
        inputs=["w", "n", "u", "d", "e"],
        outputs=["z", "z_u", "y", "v_d", "v_e"],
    )
    blocks = [DynamicBlock("d", "v_d", 0.05), DynamicBlock("e", "v_e", 0.1)]
    return Plant(
        UncertainStateSpace.of_blocks(model, blocks), ["w", "n"], ["z", "z_u"], ["u"], ["y"]
    )
