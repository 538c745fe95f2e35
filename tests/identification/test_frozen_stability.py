"""Stability with the scheduling held, as far as the coefficients are known."""

import re
from dataclasses import replace

import numpy as np
import pytest
from known_systems import flown
from scipy.stats import norm

import identification as idn
from identification.judge.response_regions import StructureBias
from symheli.errors import InputError

ARX = idn.LPVARX("y", "u", "p", na=1, nb=1, delay=1, basis=idn.Polynomial(1, -1.0, 1.0))


@pytest.fixture(scope="module")
def model():
    """y(k) = (1 + .05 p(k-1)) y(k-1) + u(k-1) + e: unstable for p > 0."""
    rng = np.random.default_rng(0)
    p, u = np.sin(0.4 * np.arange(400)), rng.normal(size=(400, 1))
    record = flown(
        ARX,
        [lambda p: np.array([[-1.0 - 0.05 * p]])],
        [lambda p: np.array([[1.0]])],
        p[:, None],
        u,
        noise=1.0,
    )
    return idn.fit(ARX, record)


def test_the_band_is_that_of_the_coefficient(model):
    """One pole, growth log(-a)/dt with a = theta' f(p): to first order its deviation is
    sqrt(f' C f)/(|a| dt).
    """
    points = [-0.9, 0.0, 0.9]
    found = idn.judge.frozen_stability(model, points, draws=300)
    C = model.covariance[0, :2, 0, :2]
    for p, growth, low, high in zip(points, found.growth, found.low, found.high, strict=True):
        f = ARX.basis(p)
        a = -float(f @ model.theta[:2, 0])
        spread = np.sqrt(f @ C @ f) / a / model.dt
        assert growth == pytest.approx(np.log(a) / model.dt)
        # 300 draws: a standard error of 4 %
        together = norm.isf(0.025 / len(points))
        assert (high - low) / 2 == pytest.approx(together * spread, rel=0.15)


def test_where_the_band_crosses_the_axis_nothing_is_known(model):
    found = idn.judge.frozen_stability(model, [-0.9, 0.0, 0.9])
    assert found.calls == ("stable", "not known", "unstable")
    assert [row.verdict for row in found.criteria] == ["fit", "not known", "not fit"]
    assert "not known at 1 of 3 points" in str(found)
    assert re.search(r"p = 0, 1/s .* at most 0  not known  95 % band -", str(found))


def test_a_model_without_covariance_is_refused(model):
    with pytest.raises(InputError, match="gives none"):
        idn.judge.frozen_stability(model.with_theta(model.theta), [0.0])


def off_by(model, factor):
    """The bias of a structure that finds the growth of y(k) = a y(k-1) `factor` times too large."""
    points = [-0.9, 0.0, 0.9]
    exact = {}
    for p in points:
        there = model.at(p)
        exact[p] = replace(there, A=there.A ** (1 / factor))
    return StructureBias(model, exact)


def test_the_bias_of_the_structure_widens_the_band_by_the_largest_of_neighbours(model):
    points = [-0.9, 0.0, 0.9]
    plain = idn.judge.frozen_stability(model, points)
    wide = idn.judge.frozen_stability(model, points, bias=off_by(model, 2.0))
    off = np.abs(plain.growth) / 2
    expected = [max(off[0], off[1]), off.max(), max(off[1], off[2])]
    np.testing.assert_allclose(wide.bias, 1.96 * np.array(expected), rtol=1e-9)
    np.testing.assert_allclose(wide.high - plain.high, wide.bias, rtol=1e-9)


def test_no_longer_record_decides_where_the_structure_is_off_by_more_than_the_growth(model):
    points = [-0.9, 0.0, 0.9]
    found = idn.judge.frozen_stability(model, points, bias=off_by(model, 4.0))
    assert set(found.calls) == {"not known"}
    assert np.isinf(found.longer).all()
    assert "hold each value of the scheduling" in found.advice
    assert found.advice in str(found)
    plain = idn.judge.frozen_stability(model, points)
    assert (plain.longer[[0, 2]] == 1.0).all()
    assert plain.longer[1] > 1.0
    assert "times as long" in plain.advice


@pytest.mark.parametrize("points", [["a"], [float("nan")], []])
def test_points_are_numbers(model, points):
    with pytest.raises(InputError, match="points"):
        idn.judge.frozen_stability(model, points)


def test_a_bias_at_other_points_is_refused(model):
    with pytest.raises(InputError, match="expected one at the points"):
        idn.judge.frozen_stability(model, [0.0], bias=off_by(model, 2.0))
