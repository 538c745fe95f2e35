"""Over the whole envelope: finite values and derivatives, and trims that either hold or say why
not.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import symheli
from symheli.steady.equilibrium import TOLERANCE

HELICOPTERS = {
    governor: symheli.Helicopter.load("xcell60", governor=governor) for governor in ("ideal", "pi")
}


def around(size):
    """Numbers up to +-size, with zero often."""
    return st.one_of(st.just(0.0), st.floats(-size, size))


STATES = st.tuples(
    *[around(25.0)] * 2,
    around(20.0),
    *[around(4.0)] * 3,
    around(1.45),
    around(1.45),
    *[around(0.5)] * 2,
    st.floats(60.0, 220.0),
    around(60.0),
)  # u v, w, p q r, phi, theta, a1 b1, Om, om_i


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(
    STATES,
    st.tuples(*[around(1.0)] * 4),
    st.tuples(*[around(12.0)] * 3),
    st.sampled_from(["ideal", "pi"]),
)
@example(
    (0.0,) * 10 + (167.0, 0.0), (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), "pi"
)  # no flow anywhere
@example(
    (0.0, 0.0, 20.0) + (0.0,) * 7 + (167.0, 9.0), (0.0, 0.0, -0.4, 0.2), (0.0, 0.0, 0.0), "pi"
)  # falling, thrust saturated downwards
@example(
    (0.0, 0.0, -20.0) + (0.0,) * 7 + (60.0, 9.0), (0.0, 0.0, 1.0, -1.0), (0.0, 0.0, 0.0), "pi"
)  # thrust saturated upwards, slow rotor
@example(
    (-15.0,) + (0.0,) * 9 + (167.0, 9.0), (0.0, 0.0, 0.1, 0.25), (0.0, 0.0, 0.0), "ideal"
)  # rearwards
def test_right_hand_side_and_jacobian_are_finite_everywhere_short_of_gimbal_lock(
    x, u, wind, governor
):
    heli = HELICOPTERS[governor]
    at = np.array(x[: len(heli.states)]), np.array(u), np.array(wind)
    assert np.all(np.isfinite(heli.numeric("rhs")(*at)[0]))
    for block in heli.numeric("jacobian")(*at):
        assert np.all(np.isfinite(block))


@pytest.mark.filterwarnings("ignore::symheli.errors.ValidityWarning")
@settings(max_examples=60, deadline=None)
@given(
    st.floats(0.0, 20.0),
    st.floats(-1.0, 1.0),
    st.one_of(st.just(0.0), st.floats(-math.pi, math.pi)),
    st.one_of(st.just(0.0), st.floats(-0.6, 0.6)),
    st.floats(0.0, 3000.0),
    st.sampled_from(["ideal", "pi"]),
)
@example(0.0, 0.0, 0.0, 0.0, 0.0, "pi")  # hover
@example(8.0, 0.0, math.pi, 0.0, 0.0, "ideal")  # rearwards
@example(8.0, 0.0, -math.pi / 2, 0.0, 0.0, "ideal")  # sidewards
@example(6.0, -1.0, 0.0, 0.0, 0.0, "ideal")  # straight down, into the own wake
@example(20.0, 1.0, 0.0, 0.0, 0.0, "pi")  # straight up: more than the rotor has
def test_a_trim_holds_or_says_what_is_missing(
    airspeed, steepness, sideslip, turn_rate, altitude, governor
):
    heli = HELICOPTERS[governor]
    climb_rate = steepness * airspeed
    asked = dict(climb_rate=climb_rate, sideslip=sideslip, turn_rate=turn_rate, altitude=altitude)
    point = symheli.trim(heli, airspeed, **asked, throw=False)
    assert np.all(np.isfinite(point.x.array))
    assert np.all(np.isfinite(point.residual.array))
    if not point.success:
        with pytest.raises(
            symheli.errors.TrimError,
            match=r"no trim at .* the best point leaves d\w+/dt = .* (m|rad)/s",
        ) as caught:
            symheli.trim(heli, airspeed, **asked)
        assert str(caught.value).count("/dt = ") == len(heli.states)
        return
    xdot = heli.at_altitude(altitude).numeric("rhs")(
        point.x.array, point.u.array, point.wind.array
    )[0]
    assert np.abs(xdot).max() < TOLERANCE
    u, v, w = point.x.array[:3]
    assert math.hypot(u, v, w) == pytest.approx(airspeed, abs=1e-9)
    phi, theta = point.x["phi"], point.x["theta"]
    # upward velocity and turn about the vertical, through the rotation to earth axes; rounding of
    # speeds up to 20 m/s
    assert u * math.sin(theta) - (v * math.sin(phi) + w * math.cos(phi)) * math.cos(
        theta
    ) == pytest.approx(climb_rate, abs=1e-9)
    assert (point.x["q"] * math.sin(phi) + point.x["r"] * math.cos(phi)) / math.cos(
        theta
    ) == pytest.approx(turn_rate, abs=1e-9)
    if point.attainable:
        assert np.all(np.abs(point.u.array) < heli.travel)
    model = symheli.linearize(heli, point)
    assert np.all(np.isfinite(model.A))


@pytest.mark.filterwarnings("ignore::symheli.errors.ValidityWarning")
def test_a_control_beyond_its_travel_is_said_not_hidden(ideal):
    """28 m/s holds in the equations with more collective than the servo has: a success that cannot
    be attained.
    """
    point = symheli.trim(ideal, 28.0)
    assert point.success
    assert not point.attainable
    assert point.on_stops == ("d_col",)
    assert "at or beyond the stop: d_col = 0.218 rad" in point.outcome


def test_where_nothing_holds_the_best_point_stays_within_the_travel(ideal):
    with pytest.raises(
        symheli.errors.TrimError,
        match=r"no trim at 60 m/s: .* du/dt = -\d.*m/s\^2.* at or beyond the stop: d_col",
    ) as caught:
        symheli.trim(ideal, 60.0)
    assert np.all(np.abs(caught.value.result.u.array) <= ideal.travel)


def test_altitude_is_density_and_models_are_taken_in_the_air_of_their_point(ideal):
    high = symheli.trim(ideal, 6.0, altitude=2000.0)
    thin = ideal.in_air(symheli.environment.standard_atmosphere(2000.0).density)
    same = symheli.trim(thin, 6.0)
    np.testing.assert_array_equal(high.x.array, same.x.array)
    np.testing.assert_array_equal(symheli.linearize(ideal, high).A, symheli.linearize(thin, same).A)
    assert high.u["d_col"] > symheli.trim(ideal, 6.0).u["d_col"]


def test_wind_shifts_velocity_over_ground_and_nothing_else(ideal):
    """Any steady wind, from any side: attitude and controls of the trim through the air are those
    of still air.
    """
    still = symheli.trim(ideal, 7.0, sideslip=0.2)
    for heading in (0.0, 90.0, 270.0):
        blown = symheli.trim(
            ideal,
            7.0,
            sideslip=0.2,
            wind=(5 * math.cos(math.radians(heading)), 5 * math.sin(math.radians(heading)), 0.5),
        )
        np.testing.assert_allclose(blown.u.array, still.u.array, atol=1e-9)
        np.testing.assert_allclose(
            blown.x.array[:3] - blown.wind.array, still.x.array[:3], atol=1e-9
        )


@pytest.mark.parametrize(
    "bad",
    [
        {"airspeed": -1.0},
        {"airspeed": math.nan},
        {"airspeed": 2.0, "climb_rate": 3.0},
        {"airspeed": 2.0, "altitude": 50_000.0},
        {"airspeed": 2.0, "altitude": math.inf},
        {"airspeed": 2.0, "turn_rate": 0.1, "wind": (1, 0, 0)},
    ],
)
def test_conditions_that_cannot_be_are_refused(ideal, bad):
    with pytest.raises(symheli.errors.InputError):
        symheli.trim(ideal, **bad)


def test_autorotation_and_lack_of_power_are_named(pi):
    """A closed throttle cannot hold the rotor back in a steep descent; an engine of 300 W cannot
    hover.
    """
    with pytest.raises(symheli.errors.TrimError, match="throttle closed: the air drives the rotor"):
        symheli.trim(pi, 18.0, climb_rate=-16.2)
    with pytest.raises(symheli.errors.TrimError, match="full throttle: the engine lacks power"):
        symheli.trim(pi.with_parameters({"drivetrain.max_power": 300.0}), 0.0)
    assert symheli.trim(
        symheli.Helicopter(pi.vehicle, "ideal"), 18.0, climb_rate=-16.2
    ).success  # that governor may brake


def test_where_the_equations_jump_a_failure_says_so(ideal):
    """At 20 m/s between 6.9 and 7.05 m/s down the wake factor falls from 1.5 to 0: equilibria on
    both sides, none between.
    """
    above, below = (symheli.trim(ideal, 20.0, climb_rate=rate) for rate in (-6.9, -7.05))
    assert above.success
    assert below.success
    with pytest.raises(
        symheli.errors.TrimError, match="equations jump here, as the flow turns at the disc"
    ):
        symheli.trim(ideal, 20.0, climb_rate=-7.0)
