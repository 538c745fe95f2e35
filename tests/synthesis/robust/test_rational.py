"""Gains of rational models at limited rates: closed forms, routes for jumps and for rest, forged
files.
"""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from symheli import LFT, LinearModel, Scheduling, lpv
from symheli.errors import InputError
from synthesis import l2_gain, lft_gain
from synthesis.checker import report
from synthesis.robust import RationalGain, rational_gain


def lag(rate):
    """(1 + p) x' = u - x, y = x: its frozen gain is 1."""
    p = Scheduling("p", "1", 0.0, 1.0, rate=rate)
    a = 1 / (1 + p.symbol)
    return LFT.from_expressions([[-a]], [[a]], [[1]], [[0]], p)


def twice(rate):
    """One parameter in two places, which leaves a rational loop (manual of IQC-beta)."""
    a, b, k, Td = -0.3, 0.8, 2.5, 0.86
    q = a + b * k * Td
    G = LinearModel(
        [[-q, -b * k], [1, 0]],
        [[-2, -2 * b], [0, 0]],
        [[q, b * k], [k * Td, k]],
        [[1, 2 * b], [0, 1]],
        ["x1", "x2"],
        ["g1", "g2"],
        ["v1", "v2"],
    )
    d = Scheduling("delta", "1", -0.22, 0.22, rate=rate)
    both = [LFT.parameter(d, f"v{i}", f"w{i}") for i in (1, 2)]
    sums = {f"g{i}": {f"f{i}": 1, f"w{i}": 1} for i in (1, 2)}
    return lpv.connect(G, *both, inputs=["f1", "f2"], outputs=["v1", "v2"], sums=sums)


def test_a_model_at_rest_has_the_worst_frozen_gain():
    for model in (lag(0.0), twice(0.0)):
        found = rational_gain(model)
        assert found.verified
        # back-off of 1e-6 of the square, programs to 1e-8
        assert_allclose(found.gamma, found.frozen, rtol=2e-6)


def test_a_parameter_that_jumps_gives_the_gain_of_the_full_block_test():
    model = twice(math.inf)
    other = lft_gain(model, search=None)
    # F of degree two is no less than constant multipliers
    assert other.gamma * 0.97 <= rational_gain(model).gamma <= other.gamma * 1.001


def test_a_polynomial_model_has_the_gain_in_closed_form():
    """b c = (2 - p)(1 + p) at rate .1: 2.29353 by a scalar differential equation."""
    p = Scheduling("p", "1", 0.0, 1.0, rate=0.1)
    model = LFT.polynomial(
        A={(0,): [[-1.0]]},
        B={(0,): [[2.0]], (1,): [[-1.0]]},
        C={(0,): [[1.0]], (1,): [[1.0]]},
        D={(0,): [[0.0]]},
        parameters=[p],
    )
    found = rational_gain(model, degree=5)
    assert found.verified
    # a polynomial of degree five is within a thousandth of the best function of p
    assert 2.29353 <= found.gamma <= 1.001 * 2.29353
    assert_allclose(found.gamma, l2_gain(model, 0.1, search=None).gamma, rtol=1e-3)


def test_no_motion_that_is_flown_exceeds_what_is_proven():
    found = rational_gain(lag(0.5), degree=3)
    gains = []
    for period in (2.0, 4.0, 8.0):
        for shift in np.linspace(0.0, 1.0, 5):

            def p(t, period=period):
                return 0.5 + 0.5 * np.interp((t / period) % 1, [0, 0.5, 1], [-1, 1, -1]) * min(
                    1.0, 0.25 * period
                )

            def rates(t, x, p=p, period=period, shift=shift):
                u = math.exp(-((t - 12) ** 2) / 50) * math.cos(2 * math.pi * (t / period + shift))
                return [(u - x[0]) / (1 + p(t)), x[0] ** 2, u**2]

            flown = solve_ivp(rates, (0, 40), [0.0, 0.0, 0.0], rtol=1e-9, atol=1e-11, max_step=0.05)
            gains.append(math.sqrt(flown.y[1, -1] / flown.y[2, -1]))
    assert 0.5 < max(gains) <= found.gamma


def test_the_bound_grows_with_the_rate_between_rest_and_jumps():
    bounds = [rational_gain(twice(0.0), rate).gamma for rate in (0.0, 0.1, 1.0, 10.0, math.inf)]
    assert bounds == sorted(bounds)


def test_stability_needs_no_channels():
    still = rational_gain(twice(1.0).select([], []))
    assert still.verified
    assert math.isnan(still.gamma)
    assert "well posed" in still.claim


def test_two_parameters_at_two_rates():
    a, b = (Scheduling(name, "1", 0.0, 1.0, rate=rate) for name, rate in (("a", 0.1), ("b", 0.2)))
    s, t = a.symbol, b.symbol
    model = LFT.from_expressions(
        [[0, 1], [-1 / (1 + 0.2 * s), -1 / (1 + t)]], [[0], [1]], [[1, 0]], [[0]], [a, b]
    )
    found = rational_gain(model)
    assert found.verified
    assert found.frozen <= found.gamma < 1.5 * found.frozen


def test_an_unstable_model_proves_nothing():
    p = Scheduling("p", "1", 0.0, 1.0, rate=0.1)
    model = LFT.from_expressions([[1 / (1 + p.symbol)]], [[1]], [[1]], [[0]], p)
    found = rational_gain(model)
    assert math.isinf(found.gamma)
    assert "not stable" in str(found)


@pytest.mark.guard
@pytest.mark.parametrize("rate", [1.0, math.inf])
def test_the_checker_proves_what_is_saved_and_no_forged_number(rate, tmp_path, capsys):
    found = rational_gain(twice(rate))
    path = found.save(tmp_path / "gain.json")
    assert report.main([str(path)]) == 0
    assert found.claim in capsys.readouterr().out
    assert RationalGain.load(path).gamma == found.gamma
    content = json.loads(path.read_text())

    def changed(*where, by):
        other = json.loads(json.dumps(content))
        at = other
        for key in where[:-1]:
            at = at[key]
        at[where[-1]] = by(at[where[-1]])
        return other

    forged = [
        changed("gamma", by=lambda g: 0.99 * found.frozen),
        changed("P", "array", 0, by=lambda v: -v),
        changed("F", "array", 0, by=lambda v: 1e3 + 10 * v),
        changed("lft", "M11", "array", 0, by=lambda v: v + 5.0),
        changed("lft", "M22", "array", 0, by=lambda v: -v + 1.0),
        changed("lft", "blocks", 0, "size", by=lambda v: v + 1),
        changed("lft", "dt", by=lambda _: 0.1),
    ]
    if math.isfinite(rate):  # of P that moves with p
        forged.append(
            changed("lft", "blocks", 0, "scheduling", "rate", by=lambda _: {"float": "inf"})
        )
        forged.append(changed("lft", "blocks", 0, "scheduling", "rate", by=lambda _: 1e3))
    for other in forged:
        file = tmp_path / "forged.json"
        file.write_text(json.dumps(other))
        assert report.main([str(file)]) != 0
        capsys.readouterr()


def test_what_has_no_meaning_is_refused_with_advice():
    with pytest.raises(InputError, match="l2_gain"):
        rational_gain(lag(0.1).to_lpv(3))
    p = Scheduling("p", "1", 0.0, 1.0, rate=0.1)
    sampled = LFT.from_expressions([[0.5 / (1 + p.symbol)]], [[1]], [[1]], [[0]], p, dt=0.1)
    with pytest.raises(InputError, match="lft_gain"):
        rational_gain(sampled)
    with pytest.raises(InputError, match="rational_gain"):
        l2_gain(lag(0.1))


def test_a_gain_below_zero_and_a_p_that_is_not_symmetric_prove_nothing():
    found = rational_gain(twice(1.0))
    assert found.verify()
    assert not replace(found, gamma=-found.gamma).verify()
    P = found.P.copy()
    P[..., 0, 1] -= 1e-3
    assert not replace(found, P=P).verify()
