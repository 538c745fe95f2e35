"""Functions of bounded slope: closed forms, what each class of multipliers adds, and simulation."""

import math

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from symheli import InputError, LinearModel
from symheli.errors import UnknownNameError
from synthesis import slope_margin

SEARCH = 2e-3
"""The search ends a part in a thousand below what is not proven, or below the limit."""


def plant(numerator, denominator):
    """A transfer function under negative feedback: v = -G d."""
    found = control.ss(control.tf(numerator, denominator))
    return LinearModel.from_control(-1 * found, inputs=["d"], outputs=["v"])


def resonant():
    """Three modes, drawn once among twelve plants: one where each class of multipliers counts."""
    numerator = [1.8, 1.32, 0.36, -1.21]
    modes = ((0.7, 0.25), (1.21, 0.54), (0.72, 0.15))
    denominator = np.ones(1)
    for w, z in modes:
        denominator = np.polymul(denominator, [1, 2 * z * w, w * w])
    return plant(numerator, denominator)


def test_the_circle_criterion_and_that_of_popov_in_closed_form():
    """1/(s + 1)^3: the least real part is -1/4, at w = 1; Popov's reaches the limit 8 of a gain."""
    lags = plant([1], [1, 3, 3, 1])
    circle, popov = (slope_margin(lags, "d", "v", each) for each in ("circle", "Popov"))
    assert circle.slope == pytest.approx(4.0, rel=SEARCH)
    assert popov.slope == pytest.approx(8.0, rel=SEARCH)
    assert circle.slope < 4.0
    assert popov.slope < 8.0
    assert circle.limit == pytest.approx(8.0, rel=1e-6)
    assert circle.popov == 0.0
    assert not np.any(popov.causal)


def test_each_class_of_multipliers_is_larger_than_the_one_before():
    model = resonant()
    found = [
        slope_margin(model, "d", "v", *asked)
        for asked in (("circle",), ("Popov",), ("Zames-Falb",))
    ]
    odd = slope_margin(model, "d", "v", odd=True)
    slopes = [each.slope for each in (*found, odd)]
    assert slopes == sorted(slopes)
    assert slopes[1] > 1.5 * slopes[0]
    assert slopes[2] > 1.3 * slopes[1]
    assert 1.01 * slopes[2] < slopes[3] < odd.limit


@pytest.mark.parametrize("odd", [False, True])
def test_the_multiplier_is_what_it_must_be(odd):
    """The real part over a fine grid, from the transfer function; the integral of |h| below 1."""
    model = resonant()
    found = slope_margin(model, "d", "v", odd=odd)
    omega = np.r_[0.0, np.geomspace(1e-3, 1e3, 20001)]
    F = 1 / found.slope - model.frequency_response(omega)[:, 0, 0]
    assert np.all(np.real(found.multiplier(omega) * F) > 0)
    weights = np.r_[found.causal.ravel(), found.ahead.ravel()]
    assert np.abs(weights).sum() < 1
    assert odd or np.all(weights >= 0)


@pytest.mark.slow
def test_a_loop_of_the_proven_slope_decays():
    """A dead zone, a saturation and a soft stop, each of that slope at its steepest."""
    model = resonant()
    k = 0.9 * slope_margin(model, "d", "v").slope  # at the margin it takes long
    for phi in (
        lambda v: k * np.clip(v, -1.0, 0.3),
        lambda v: k * (v - np.clip(v, -0.2, 0.5)),
        lambda v: k * np.maximum(v, 0.2 * v),
    ):

        def slope(t, x, phi=phi):
            return model.A @ x + model.B[:, 0] * phi(float((model.C @ x).item()))

        x0 = np.full(len(model.A), 3.0)
        end = solve_ivp(slope, (0.0, 400.0), x0, rtol=1e-6, atol=1e-8).y[:, -1]
        assert np.linalg.norm(end) < 0.01 * np.linalg.norm(x0)


def test_a_loop_that_no_slope_reaches_and_one_without_limit():
    none = LinearModel([[-1.0]], [[1.0]], [[0.0]], [[0.0]], ["x"], ["d"], ["v"])
    assert slope_margin(none, "d", "v")[:2] == (math.inf, math.inf)
    lag = slope_margin(plant([1], [1, 1]), "d", "v")
    assert lag.slope > 1e5
    assert lag.limit == math.inf


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"criterion": "Nyquist"}, UnknownNameError, "Zames-Falb"),
        ({"output": "w"}, UnknownNameError, "output"),
        ({"model": plant([1], [1, -1])}, InputError, "stable continuous"),
        ({"model": plant([1], [1, 1]).discretize(0.1)}, InputError, "stable continuous"),
        ({"model": plant([1, 0], [1, 1])}, InputError, "no feedthrough"),
        ({"model": 1.0}, InputError, "expected a LinearModel"),
    ],
)
def test_bad_input_is_refused_in_words(given, error, words):
    asked = {"model": resonant(), "input": "d", "output": "v", **given}
    with pytest.raises(error, match=words):
        slope_margin(**asked)
