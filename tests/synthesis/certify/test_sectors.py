"""Loops with a function in a sector: the circle criterion, simulated saturations, bad input."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from symheli import LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError
from synthesis import l2_gain, stability

p = Scheduling("p", "1", low=0.0, high=1.0, rate=0.2)


def third_order(gain):
    """gain/(s + 1)^3 under negative feedback through a function of the output."""
    A = [[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, -1.0]]
    return LPVStateSpace.polynomial(
        [A],
        [[[0.0], [0.0], [-gain]]],
        [[[1.0, 0.0, 0.0]]],
        [[[0.0]]],
        p,
        inputs=["d"],
        outputs=["v"],
    )


def servo(stiffness=1.0):
    """x'' = -x - 1.5 x' + w + u, u = sat(-k(p) x - 2 x') behind a lag of .1 s, k from 1 to 3, z =
    x.
    """
    return LPVStateSpace.polynomial(
        [[[0.0, 1.0, 0.0], [-1.0, -1.5, 1.0], [0.0, 0.0, -10.0]]],
        [[[0.0, 0.0], [1.0, 0.0], [0.0, 10.0]]],
        [[[1.0, 0.0, 0.0], [-stiffness, -2.0, 0.0]], [[0.0, 0.0, 0.0], [-2.0, 0.0, 0.0]]],
        [np.zeros((2, 2))],
        p,
        inputs=["w", "held"],
        outputs=["z", "asked"],
    )


@pytest.mark.slow
def test_the_limit_is_that_of_the_circle_criterion():
    """Sector [0, 1]: Re gain/(1 + i w)^3 > -1; the least real part is -1/4 at w = 1, gain 4."""
    least = min(np.real(1 / (1 + 1j * w) ** 3) for w in np.linspace(0.5, 2.0, 1501))
    limit = -1 / least
    for share, proven in ((0.995, True), (1.005, False)):
        loops = UncertainStateSpace.in_sector(third_order(share * limit), ["d"], ["v"])
        assert stability(loops, search=None).verified is proven


@pytest.mark.slow
def test_the_gain_bounds_simulated_loops_that_saturate():
    model = servo()
    cert = l2_gain(UncertainStateSpace.in_sector(model, ["held"], ["asked"]), search=None)
    assert cert.verified
    linear = l2_gain(closed(model), search=None)
    assert linear.gamma <= cert.gamma
    worst = 0.0
    for size in (0.3, 3.0, 30.0):
        z, w = simulated(model, 0.6, size)
        worst = max(worst, z / w)
    assert 0.5 * linear.gamma < worst <= cert.gamma


def closed(model, gain=1.0):
    """The loop without the limit."""
    return model.feedback({("held", "asked"): gain}).select(inputs=["w"], outputs=["z"])


def simulated(model, omega, size):
    """Norms of x and of w = size sin(omega t) for 40 s, p up and down at its rate."""

    def slope(t, state):
        q = (0.2 * t) % 2.0
        A, B, C, _ = model.matrices(min(q, 2.0 - q))
        x = state[:3]
        w = size * math.sin(omega * t) * (t < 40)
        held = np.clip((C @ x)[1], -1.0, 1.0)
        return [*(A @ x + B @ [w, held]), x[0] ** 2, w**2]

    end = solve_ivp(slope, (0.0, 80.0), np.zeros(5), rtol=1e-6, atol=1e-9).y[:, -1]
    return math.sqrt(end[3]), math.sqrt(end[4])


@pytest.mark.slow
def test_a_narrower_sector_has_a_smaller_gain():
    gains = [
        l2_gain(UncertainStateSpace.in_sector(servo(), ["held"], ["asked"], low), search=None).gamma
        for low in (0.0, 0.3, 0.999)
    ]
    assert gains == sorted(gains, reverse=True)
    whole = l2_gain(closed(servo()), search=None).gamma
    assert gains[-1] == pytest.approx(whole, rel=1e-2)


def test_a_member_is_the_loop_with_that_gain():
    loops = UncertainStateSpace.in_sector(servo(), ["held"], ["asked"])
    expected = closed(servo(), 0.8)
    assert np.allclose(loops.perturbed([[0.3]]).at(0.4).A, expected.at(0.4).A, atol=1e-12)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((["held"], ["asked"], 1.0, 1.0), "low < high"),
        ((["held"], ["asked"], 0.0, math.inf), "low < high"),
        ((["held"], ["asked", "z"]), "an output for each input"),
    ],
)
def test_bad_input_is_refused_in_words(given, words):
    with pytest.raises(InputError, match=words):
        UncertainStateSpace.in_sector(servo(), *given)
