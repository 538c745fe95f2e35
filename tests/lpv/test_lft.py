"""A linear fractional transformation is the family it was made from, before and after exact
reduction.
"""

import numpy as np
import pytest
from families import SPEED, random_lpv, stacked

from symheli import LFT, LPVStateSpace, Scheduling
from symheli.errors import InputError

POINTS = (0.0, 1.7, 6.5, 11.0, 13.0)


def assert_equal_models(a, b, tolerance=1e-12):
    scale = np.abs(stacked(b)).max()
    np.testing.assert_allclose(stacked(a), stacked(b), atol=tolerance * scale)


@pytest.mark.parametrize("degree", [0, 1, 2, 3, 5])
def test_lft_is_the_polynomial_family_before_and_after_reduction(degree):
    lpv, _ = random_lpv(degree)
    lft = lpv.to_lft()
    assert lft.order == degree * 6  # Horner: degree times nx + nu
    small = lft.reduce()
    assert small.order <= lft.order
    for p in POINTS:
        assert_equal_models(lft.at(p), lpv.at(p))
        assert_equal_models(small.at(p), lpv.at(p))


@pytest.mark.parametrize(("degree", "rank"), [(1, 1), (1, 3), (2, 1), (3, 2)])
def test_minimal_order_is_the_rank_of_the_block_hankel_matrix(degree, rank):
    symmetric = Scheduling(
        "p", "1", -1.0, 1.0
    )  # so that delta is p and the coefficients are the Markov parameters
    lpv, whole = random_lpv(degree, scheduling=symmetric, rank=rank)
    zero = np.zeros_like(whole[0])
    markov = [*whole[1:], *[zero] * degree]
    hankel = np.block([[markov[i + j] for j in range(degree)] for i in range(degree)])
    small = lpv.to_lft().reduce()
    assert small.order == np.linalg.matrix_rank(hankel)
    assert_equal_models(small.at(0.37), lpv.at(0.37))


def test_constant_model_reduces_to_order_zero():
    lpv, _ = random_lpv(0)
    padded = LPVStateSpace.polynomial(
        A=[lpv.at(0.0).A, np.zeros((4, 4))],
        B=[np.zeros((4, 1))],
        C=[np.eye(4)],
        D=[np.zeros((4, 1))],
        scheduling=SPEED,
    )
    small = padded.to_lft().reduce()
    assert small.order == 0
    np.testing.assert_allclose(small.at(5.0).A, lpv.at(0.0).A, atol=1e-13)


def test_star_product_multiplies_transfer_functions():
    first, _ = random_lpv(2, nx=3, nu=2, ny=2, seed=1)
    second, _ = random_lpv(1, nx=2, nu=1, ny=2, seed=2)
    other, _ = random_lpv(
        1, nx=2, nu=1, ny=2, seed=2, scheduling=Scheduling("mass", "kg", 0.0, 13.0)
    )
    chain, shared = first.to_lft().star(other.to_lft()), first.to_lft().star(second.to_lft())
    omega = np.array([0.1, 1.0, 7.0])
    assert chain.order == shared.order == first.to_lft().order + second.to_lft().order
    for p1, p2 in ((1.0, 12.0), (6.5, 3.0)):
        product = first.at(p1).frequency_response(omega) @ second.at(p2).frequency_response(omega)
        np.testing.assert_allclose(
            chain.at(p1, p2).frequency_response(omega), product, rtol=1e-9, atol=1e-9
        )
        np.testing.assert_allclose(
            chain.at(mass=p2, airspeed=p1).frequency_response(omega), product, rtol=1e-9, atol=1e-9
        )
        # one parameter of both is one block, and has one value
        same = first.at(p1).frequency_response(omega) @ second.at(p1).frequency_response(omega)
        np.testing.assert_allclose(
            shared.at(p1).frequency_response(omega), same, rtol=1e-9, atol=1e-9
        )


def test_series_of_unequal_widths_or_periods_is_refused():
    first, _ = random_lpv(1, nu=2)
    second, _ = random_lpv(1, ny=3)
    with pytest.raises(InputError, match="as many inputs"):
        first.to_lft().star(second.to_lft())


def test_a_narrower_scheduling_range_keeps_the_model():
    lpv, _ = random_lpv(2)
    narrow = lpv.with_scheduling(Scheduling("airspeed", "m/s", 2.0, 7.0))
    lft = narrow.to_lft().reduce()
    assert_equal_models(lft.at(4.4), lpv.at(4.4))
    with pytest.raises(InputError, match=r"holds on \[2, 7\]"):
        lft.at(9.0)


def test_only_polynomials_become_lfts(ideal):
    import symheli

    spline = symheli.sweep(ideal, [2.0, 4.0, 6.0, 8.0]).interpolate("spline")
    with pytest.raises(InputError, match="polynomial"):
        spline.to_lft()


def test_shapes_are_checked_and_arrays_cannot_be_changed():
    lft = random_lpv(1)[0].to_lft()
    with pytest.raises(ValueError, match="read-only"):
        lft.M11[0, 0] = 1.0
    with pytest.raises(InputError, match=r"M12: expected shape \(6, 6\), got \(6, 5\)"):
        LFT(
            lft.M11,
            lft.M12[:, :5],
            lft.M21,
            lft.M22,
            lft.blocks,
            lft.states,
            lft.inputs,
            lft.outputs,
        )
    with pytest.raises(InputError, match="expected 1 parameter"):
        lft.at(1.0, 2.0)
