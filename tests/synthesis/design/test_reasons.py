"""A scheduled design that fails, or whose gamma says nothing, says why."""

import pytest
from scheduled_plants import of, spring, turning

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError, SynthesisError
from synthesis import estimator, output_feedback, state_feedback

HEAVY = 3.819833
"""DC gain of the weight of `arm`."""


def heave(reached=1.0, seen=1.0):
    """w' = (.5 + .2p) w + gust + `reached` d_col, measured as far as `seen`; beside it a lag."""
    return of(
        LPVStateSpace.polynomial(
            [[[0.5, 0], [0, -1]], [[0.2, 0], [0, 0]]],
            [[[1, 0, reached], [1, 0, 1]]],
            [[[1, 0], [0, 0], [seen, 1]]],
            [[[0, 0, 0], [0, 0, 1], [0, 1, 0]]],
            Scheduling("p", "1", 0.0, 1.0, rate=0.5),
            states=["w", "lag"],
            inputs=["gust", "noise", "d_col"],
            outputs=["z_w", "z_col", "y"],
        ),
        ["d_col"],
        ["y"],
    )


@pytest.mark.slow
def test_a_mode_that_the_controls_do_not_reach_is_named():
    with pytest.raises(SynthesisError) as error:
        output_feedback(heave(reached=0.0))
    for p in ("p = 0", "p = 1"):
        assert any(p in r for r in error.value.reasons)
    assert all("d_col cannot stabilise it" in r and "mostly w" in r for r in error.value.reasons)
    assert "no controller was found" in str(error.value)
    assert "d_col cannot stabilise it" in str(error.value)


@pytest.mark.slow
def test_a_mode_that_the_measurements_do_not_show_is_named():
    for design in (output_feedback, estimator):
        with pytest.raises(SynthesisError) as error:
            design(heave(seen=0.0))
        assert any("y cannot detect it" in r and "mostly w" in r for r in error.value.reasons)


@pytest.mark.slow
def test_a_control_without_a_cost_gets_a_little_and_the_controller_says_so():
    """z = x + noise of the measurement's kind; the least gain is that of the estimation error."""
    plant = of(
        LPVStateSpace.polynomial(
            [[[-1.0]]],
            [[[1, 0, 1]]],
            [[[1], [1]]],
            [[[0, 0, 0], [0, 1, 0]]],
            Scheduling("p", "1", 0.0, 1.0),
            inputs=["gust", "noise", "d_col"],
            outputs=["z", "y"],
        ),
        ["d_col"],
        ["y"],
    )
    made = output_feedback(plant)
    assert made.notes[0].startswith("d_col had no cost: the design has ")
    assert made.plant.performance == ("z",)
    assert made.certify(search=None).gamma <= made.promised * 1.01
    with pytest.raises(InputError, match="d_col is not in the performance"):
        state_feedback(plant)


@pytest.mark.slow
def test_without_noise_output_feedback_of_the_state_is_nearly_state_feedback():
    """All states are measured: a percent of noise, at most, costs half a percent beside less."""
    plant = spring(states=True)
    made, least = output_feedback(plant, 0.0), state_feedback(plant, 0.0)
    assert [note.split(":")[0] for note in made.notes[:2]] == ["x had no noise", "v had no noise"]
    assert least.optimum <= made.optimum * 1.001 <= 1.02 * least.optimum
    assert made.certify(0.0, search=None).gamma <= made.promised * 1.01


def test_a_measurement_without_noise_is_named_by_an_estimator():
    with pytest.raises(InputError, match="y has no noise"):
        estimator(spring(noise=0.0))


def arm(price):
    """A reference whose error counts by a lag of DC gain `HEAVY`, a control that costs `price` and
    reaches less and less as p grows.
    """
    model = LPVStateSpace.polynomial(
        [[[-1.0, 0], [-1.0, -1.0]]],
        [[[0, 0, 1.0], [1.0, 0, 0]], [[0, 0, -0.5], [0, 0, 0]]],
        [[[0, HEAVY], [0, 0], [-1.0, 0]]],
        [[[0, 0, 0], [0, 0, price], [1.0, 0.01, 0]]],
        Scheduling("p", "1", 0.0, 1.0, rate=0.1),
        states=["x", "weight"],
        inputs=["reference", "noise", "u"],
        outputs=["z_error", "z_u", "y"],
    )
    return of(model, ["u"], ["y"])


@pytest.mark.slow
def test_a_gamma_that_is_the_gain_of_a_weight_says_so():
    """With a price that forbids the control every design promises the weight's DC gain, which
    proves nothing.
    """
    made = output_feedback(arm(1e3))
    assert made.optimum == pytest.approx(HEAVY, rel=1e-3)
    nothing = [r for r in made.reasons if "proves nothing" in r]
    assert nothing
    assert "the DC gain of the weight" in nothing[0]
    assert "z_error" in nothing[0]
    assert any("need not do anything" in r for r in made.reasons)
    assert nothing[0] in str(made)


@pytest.mark.slow
def test_nothing_is_said_of_a_gamma_that_a_controller_earns():
    for made in (output_feedback(arm(0.1)), output_feedback(spring())):
        assert made.reasons == ()
        assert len(str(made).splitlines()) == 2


def test_state_feedback_is_judged_by_the_same_floor():
    """At every frozen t the optimum, 1/3, is what no controller can lower at one frequency."""
    made = state_feedback(turning(0.0), Y=6, divisions=2)
    (reason,) = made.reasons
    assert "whatever the controller does, the gain from w" in reason
    assert made.optimum == pytest.approx(1 / 3, rel=5e-3)  # two parts, degree 6
    assert made.promised == pytest.approx(1.02 * made.optimum, rel=1e-9)
