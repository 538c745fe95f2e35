"""Parts in front of and behind LPV models: frozen responses multiply, bases stay."""

from dataclasses import replace

import numpy as np
import pytest
from families import SPEED, random_lpv

from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import CubicSpline
from symheli.lpv.mixing import mixed
from symheli.lpv.tools import pade_delay, sample_delay
from symheli.values.signal import Signal, signals

OMEGA = np.array([0.3, 2.0, 9.0, 40.0])
P = np.linspace(0.0, 13.0, 5)


def lag(omega, dt=None):
    model = LinearModel([[-omega]], [[omega]], [[0.8]], [[0.2]], ("x1",), ("in",), ("out",))
    return model if dt is None else model.discretize(dt)


def spline_model(dt=None):
    rng = np.random.default_rng(0)
    shapes = (3, 3), (3, 2), (2, 3), (2, 2)
    return LPVStateSpace(
        CubicSpline((0.0, 2.0, 5.0, 9.0, 13.0)),
        *(rng.standard_normal((5, *shape)) for shape in shapes),
        SPEED,
        ("x1", "x2", "x3"),
        (Signal("u1", "rad"), "u2"),
        (Signal("y1", "m/s"), "y2"),
        dt=dt,
    )


def response(lpv, p):
    return lpv.at(p).frequency_response(OMEGA)


@pytest.mark.parametrize("dt", [None, 0.02])
def test_an_actuator_multiplies_the_response_of_its_input(dt):
    model = spline_model(dt)
    part = lag(5.0, dt)
    driven = model.driven_by({"u2": part})
    assert driven.basis == model.basis
    assert driven.states == ("x1", "x2", "x3", "u2_x1")
    assert [(u, u.unit) for u in driven.inputs] == [("u1", "rad"), ("u2", "1")]
    for p in P:
        expected = response(model, p)
        expected[:, :, 1] *= part.frequency_response(OMEGA)[:, 0]
        np.testing.assert_allclose(response(driven, p), expected, rtol=1e-9)


def test_actuators_of_an_lpv_model_are_those_of_its_frozen_models():
    model = spline_model()
    parts = {"u1": pade_delay("u1", 0.05), "u2": replace(lag(5.0), states=("s",))}
    driven = model.driven_by(parts)
    for p in P:
        own, frozen = driven.at(p), model.at(p).driven_by(parts)
        for name in "ABCD":
            np.testing.assert_allclose(getattr(own, name), getattr(frozen, name), atol=1e-12)


def test_a_filter_multiplies_the_response_of_its_output():
    model, part = spline_model(), lag(7.0)
    filtered = model.filtered_by({"y1": part})
    assert [(y, y.unit) for y in filtered.outputs] == [("y1", "m/s"), ("y2", "1")]
    for p in P:
        expected = response(model, p)
        expected[:, 0, :] *= part.frequency_response(OMEGA)[:, 0]
        np.testing.assert_allclose(response(filtered, p), expected, rtol=1e-9)


def test_a_scheduled_part_multiplies_frozen_responses():
    model, _ = random_lpv(2)
    part, _ = random_lpv(1, nx=2, nu=1, ny=1, seed=4)
    driven, filtered = model.driven_by({"u2": part}), model.filtered_by({"y3": part})
    assert (driven.basis.degree, filtered.basis.degree) == (3, 3)
    for p in P:
        expected, both = response(model, p), response(part, p)[:, 0]
        np.testing.assert_allclose(response(driven, p)[:, :, 1], expected[:, :, 1] * both, 1e-7)
        np.testing.assert_allclose(response(filtered, p)[:, 2], expected[:, 2] * both, 1e-7)


def test_parts_carry_what_the_model_was_fitted_to():
    model = random_lpv(3)[0].discretize(0.02, degree=3)
    driven = model.driven_by({"u1": lag(5.0, 0.02)})
    off = driven.residuals
    np.testing.assert_allclose(off.A[:, :4, :4], model.residuals.A, atol=1e-14)
    np.testing.assert_allclose(off.A[:, 4:], 0.0, atol=1e-14)


def test_a_mixture_is_the_product_with_constant_matrices():
    model = spline_model()
    a, b, c = signals(("a", "b", "c"))
    new = mixed(
        model,
        {a: {"u1": 2.0}, b: {"u1": 1.0, "u2": -1.0}, c: {}},
        {a: {"y2": 3.0}, c: {"y1": 1.0, "y2": 0.5}},
        {c: {"c": 4.0}},
    )
    into, out = np.array([[2.0, 1.0, 0.0], [0.0, -1.0, 0.0]]), np.array([[0.0, 3.0], [1.0, 0.5]])
    across = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 4.0]])
    assert (new.inputs, new.outputs) == (("a", "b", "c"), ("a", "c"))
    for p in P:
        np.testing.assert_allclose(
            response(new, p), out @ response(model, p) @ into + across, atol=1e-12
        )
    with pytest.raises(UnknownNameError, match="unknown output 'y3'"):
        mixed(model, {a: {"u1": 1.0}}, {a: {"y3": 1.0}})


def test_parts_that_do_not_fit_say_what_to_do():
    model = spline_model()
    with pytest.raises(InputError, match=r"input u1 needs one input.*dt = None; got 1, 1 and 0.02"):
        model.driven_by({"u1": lag(5.0, 0.02)})
    with pytest.raises(InputError, match="output y1 needs one input, one output"):
        model.filtered_by({"y1": model.at(0.0)})
    with pytest.raises(InputError, match="the input u1: expected a LinearModel"):
        model.driven_by({"u1": 3.0})
    with pytest.raises(UnknownNameError, match="unknown input 'u3'"):
        model.driven_by({"u3": lag(5.0)})
    with pytest.raises(UnknownNameError, match="unknown output 'u1'"):
        model.filtered_by({"u1": lag(5.0)})


def test_a_delay_of_samples_is_a_power_of_the_shift():
    late = sample_delay("d_lat", 3, 0.02)
    z = np.exp(0.02j * OMEGA)
    np.testing.assert_allclose(late.frequency_response(OMEGA)[:, 0, 0], z**-3, rtol=1e-13)
    assert (late.outputs[0].unit, late.dt, len(late.states)) == ("rad", 0.02, 3)
    for wrong in (0, 1.5, True):
        with pytest.raises(InputError, match="whole number >= 1"):
            sample_delay("d_lat", wrong, 0.02)


def test_tustins_rule_maps_the_frequency_axis_onto_the_circle():
    """G_d(e^(j w dt)) = G(j (2/dt) tan(w dt/2)), exactly; the hold is another model."""
    model, dt = spline_model().at(4.0), 0.05
    sampled = model.discretize(dt, "tustin")
    warped = 2 / dt * np.tan(OMEGA * dt / 2)
    np.testing.assert_allclose(
        sampled.frequency_response(OMEGA), model.frequency_response(warped), rtol=1e-9
    )
    assert not np.allclose(sampled.A, model.discretize(dt).A)
    with pytest.raises(UnknownNameError, match="unknown method 'zoh'"):
        model.discretize(dt, "zoh")
