"""Polynomials in a parameter that lives far from zero lose no digits, or say how many."""

import warnings
from fractions import Fraction

import numpy as np
import pytest

from symheli import LFT, LPVStateSpace, Scheduling
from symheli.errors import PrecisionWarning
from symheli.lpv import Polynomial

FAR = [(1e5, 1e5 + 1), (-3e8, -3e8 + 7.0), (0.0, 13.0), (101325.0, 103000.0)]


def centred(low, high, degree, seed=0):
    """Powers of p of a polynomial of size one, multiplied out from those about the middle exactly,
    as doubles; and what these are worth.
    """
    rng = np.random.default_rng(seed)
    middle, radius = (Fraction(low) + Fraction(high)) / 2, (Fraction(high) - Fraction(low)) / 2
    powers = [Fraction(0)] * (degree + 1)
    x = [Fraction(1)]
    for k in range(degree + 1):
        c = Fraction(float(rng.standard_normal()))
        powers = [have + c * (x[i] if i < len(x) else 0) for i, have in enumerate(powers)]
        x = [
            (x[i - 1] if i else 0) / radius - (middle / radius * x[i] if i < len(x) else 0)
            for i in range(k + 2)
        ]
    doubles = [float(c) for c in powers]

    def value(p):
        return float(sum(Fraction(c) * Fraction(p) ** i for i, c in enumerate(doubles)))

    return doubles, value


@pytest.mark.parametrize("bounds", FAR)
@pytest.mark.parametrize("degree", [1, 2, 4])
def test_powers_of_p_keep_every_digit_wherever_p_lives(bounds, degree):
    """1e-2 of A was once lost on [1e5, 1e5 + 1]: the powers cancelled in doubles."""
    low, high = bounds
    powers, value = centred(low, high, degree)
    s = Scheduling("p", "1", low, high)
    one = [[[0.0]]]
    lpv = LPVStateSpace.polynomial([[[c]] for c in powers], one, one, one, s)
    terms = {(i,): [[c]] for i, c in enumerate(powers)}
    models = [
        lpv,
        lpv.to_lft(),
        lpv.to_lft().reduce(),
        LFT.polynomial(terms, {(0,): [[0.0]]}, {(0,): [[0.0]]}, {(0,): [[0.0]]}, [s]),
    ]
    size = max(abs(value(p)) for p in np.linspace(low, high, 50))
    for p in (low, high, *np.random.default_rng(1).uniform(low, high, 20)):
        for model in models:
            assert model.at(p).A[0, 0] == pytest.approx(value(p), abs=1e-13 * size)


def test_a_polynomial_state_space_keeps_every_digit_too():

    powers, value = centred(1e5, 1e5 + 1, 3)
    s, zero = Scheduling("p", "1", 1e5, 1e5 + 1), {(0,): [[0.0]]}
    model = LPVStateSpace.polynomial(
        {(i,): [[c]] for i, c in enumerate(powers)}, zero, zero, zero, [s]
    )
    size = max(abs(value(p)) for p in np.linspace(1e5, 1e5 + 1, 50))
    for p in (1e5, 1e5 + 0.37, 1e5 + 1):
        assert model.at(p).A[0, 0] == pytest.approx(value(p), abs=1e-13 * size)


def test_powers_of_p_that_lose_their_digits_are_warned_of_with_their_number():
    far = Polynomial(3, 1e5, 1e5 + 1)
    for ask in (lambda: far.to_monomial(np.ones(4)), lambda: far.form("monomial")):
        with pytest.warns(PrecisionWarning, match=r"about 17 of 16 digits on \[100000, 100001\]"):
            ask()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Polynomial(3, 0.0, 13.0).to_monomial(np.ones(4))
    # measured: the digits that are lost where the sum is evaluated in doubles
    for basis in (
        Polynomial(1, 1e5, 1e5 + 1),
        Polynomial(2, 100.0, 110.0),
        Polynomial(5, 0.0, 13.0),
    ):
        coefficients = basis.to_monomial(np.ones(basis.size))
        p = np.linspace(basis.low, basis.high, 400)
        wrong = (
            np.abs(
                np.polynomial.polynomial.polyval(p, coefficients) - basis(p) @ np.ones(basis.size)
            ).max()
            / basis.size
        )
        assert -1.5 < np.log10(wrong / np.finfo(float).eps) - basis.digits_lost < 1
