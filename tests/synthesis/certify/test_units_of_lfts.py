"""A certificate of an LFT is about the model that was given: neither units nor tolerances change
what depends on p.
"""

import numpy as np
import pytest

from symheli import LFT, Scheduling
from symheli.errors import InputError
from synthesis import l2_gain, stability
from synthesis.analysis import Status


def oscillator(softening, position=1.0, velocity=1.0, u=1.0, y=1.0, q=1.0):
    """x'' + 0.6 x' + (1 - softening p) x = u, y = x, p in [0, 1], |dp/dt| <= 0.5; each signal in
    its own unit.
    """
    T = np.array([position, velocity])
    A = {(0,): np.array([[0, 1.0], [-1, -0.6]]), (1,): np.array([[0, 0], [softening, 0]]) / q}
    A = {e: T[:, None] * M / T for e, M in A.items()}
    B, C = {(0,): T[:, None] * np.array([[0.0], [1.0]]) / u}, {(0,): y * np.array([[1.0, 0.0]]) / T}
    return LFT.polynomial(A, B, C, {(0,): [[0.0]]}, [Scheduling("p", "1", 0.0, q, 0.5 * q)])


UNITS = [
    {"position": 1e7},
    {"position": 1e12},
    {"velocity": 1e12},
    {"position": 1e-12},
    {"q": 1e12},
    {"q": 1e-12},
    {"position": 1e6, "velocity": 1e-6},
]


@pytest.mark.slow(
    only=(
        "{'position': 1000000000000.0}-True",
        "{'velocity': 1000000000000.0}-True",
        "{'position': 1e-12}-False",
        "{'position': 1000000.0, 'velocity': 1e-06}-False",
    )
)
@pytest.mark.parametrize("reduced", [False, True])
@pytest.mark.parametrize("units", UNITS, ids=str)
def test_a_plant_that_grows_is_never_proven_in_whatever_units(units, reduced):
    """With its position in 1e-7 m the softening of the spring was dropped, and the rest proven in
    exact arithmetic.
    """
    lft = oscillator(2.0, **units)
    lft = lft.reduce() if reduced else lft
    assert stability(lft, search=None).status is Status.UNSTABLE
    assert l2_gain(lft, search=None).status is Status.UNSTABLE


@pytest.mark.slow
@pytest.mark.parametrize("units", [UNITS[1], UNITS[5], {"u": 1e12}, {"y": 1e-12}], ids=str)
def test_the_proven_gain_is_the_same_in_all_units(units):
    plain, other = (l2_gain(oscillator(0.5, **u), search=None) for u in ({}, units))
    assert other.verified
    assert other.verify()
    # the solver stops within 1e-4 of the same bound
    assert other.gamma * units.get("u", 1.0) / units.get("y", 1.0) == pytest.approx(
        plain.gamma, rel=1e-3
    )


@pytest.mark.parametrize("b", [1e-10, 1.0, 1e10])
def test_no_gain_is_proven_of_a_rational_model_taken_for_a_polynomial(b):
    """B(p) = b (1 + p/(1 - 0.99 p)) reaches 101 b; 7.6 b was once proven of a polynomial through
    it.
    """
    p = Scheduling("p", "1", -1.0, 1.0, 0.1)
    lft = LFT(
        [[0.99]],
        [[0.0, 1.0]],
        [[b], [0.0]],
        [[-1.0, b], [1.0, 0.0]],
        ((p, 1),),
        ("x",),
        ("u",),
        ("y",),
    )
    with pytest.raises(InputError, match="rational"):
        l2_gain(lft)
