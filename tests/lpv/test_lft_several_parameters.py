"""LFTs in several parameters: what they were made from, reduced, truncated, over other ranges,
sampled and back.
"""

import numpy as np
import pytest
from families import random_lpv, stacked

from symheli import LFT, LinearModel, Scheduling
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import Polynomial, connect

SPEED, MASS = (
    Scheduling("airspeed", "m/s", 0.0, 13.0, 3.0),
    Scheduling("mass", "kg", 6.0, 10.0, 0.0),
)
CORNERS = [(0.0, 6.0), (0.0, 10.0), (13.0, 6.0), (13.0, 10.0), (4.4, 9.1)]


def polynomial(seed=0, rank=1):
    """{exponents: M} with coefficients of low rank, and the LFT."""
    rng = np.random.default_rng(seed)

    def power(rows, columns, size):
        return size * rng.standard_normal((rows, rank)) @ rng.standard_normal((rank, columns))

    A = {
        (0, 0): rng.standard_normal((3, 3)),
        (1, 0): power(3, 3, 0.1),
        (2, 0): power(3, 3, 0.01),
        (1, 1): power(3, 3, 0.02),
    }
    B = {(0, 0): rng.standard_normal((3, 2)), (0, 1): power(3, 2, 0.1)}
    C = {(0, 0): rng.standard_normal((2, 3)), (0, 2): power(2, 3, 0.01)}
    D = {(0, 0): rng.standard_normal((2, 2))}
    return {"A": A, "B": B, "C": C, "D": D}, LFT.polynomial(A, B, C, D, [SPEED, MASS])


def value(coefficients, p):
    return sum(M * p[0] ** e[0] * p[1] ** e[1] for e, M in coefficients.items())


def scalar(gain, inputs=("e",), outputs=("y",)):
    empty = np.zeros((0, 0))
    return LinearModel(empty, np.zeros((0, 1)), np.zeros((1, 0)), [[gain]], (), inputs, outputs)


@pytest.mark.parametrize("p", CORNERS)
def test_a_polynomial_in_two_parameters_is_itself_before_and_after_reduction(p):
    given, lft = polynomial()
    small = lft.reduce()
    assert small.order < lft.order
    for model in (lft.at(*p), small.at(mass=p[1], airspeed=p[0])):
        for name, matrices in given.items():
            # rounding of a few products of numbers up to 100
            np.testing.assert_allclose(getattr(model, name), value(matrices, p), atol=1e-11)


def test_the_order_of_a_sum_of_products_is_what_its_factors_need():
    # v' (p + q) u needs one copy of each; p q of rank one needs one more of one of them
    rank_one = np.outer([1.0, 2.0, 0.5], [1.0, -1.0, 3.0])
    made = LFT.polynomial(
        {(0, 0): -np.eye(3), (1, 0): rank_one, (0, 1): rank_one},
        {(0, 0): np.eye(3)[:, :1]},
        {(0, 0): np.eye(3)[:1]},
        {(0, 0): [[0.0]]},
        [SPEED, MASS],
    )
    assert made.reduce().sizes == (1, 1)
    product = LFT.polynomial(
        {(0, 0): -np.eye(3), (1, 1): rank_one},
        {(0, 0): np.eye(3)[:, :1]},
        {(0, 0): np.eye(3)[:1]},
        {(0, 0): [[0.0]]},
        [SPEED, MASS],
    )
    # in normalised parameters p q = (a + b d)(c + e f): d, f and d f, all with one factor
    assert product.reduce().order == 2


def test_one_parameter_as_a_special_case_of_several_has_the_same_minimal_order():
    lpv, whole = random_lpv(2, scheduling=Scheduling("airspeed", "m/s", -1.0, 1.0), rank=2)
    nx = 4
    parts = {
        name: {(i, 0): M[rows, columns] for i, M in enumerate(whole)}
        for name, rows, columns in (
            ("A", slice(nx), slice(nx)),
            ("B", slice(nx), slice(nx, None)),
            ("C", slice(nx, None), slice(nx)),
            ("D", slice(nx, None), slice(nx, None)),
        )
    }
    several = LFT.polynomial(**parts, parameters=[lpv.scheduling, MASS]).reduce()
    assert several.sizes == (lpv.to_lft().reduce().order, 0)


@pytest.mark.slow(but="2")
@pytest.mark.parametrize("seed", range(3))
def test_truncation_keeps_its_promises(seed):
    _, lft = polynomial(seed, rank=2)
    whole = lft.reduce()
    errors = []
    for order in range(whole.order, whole.order // 2, -1):
        cut = lft.truncate(order=order)
        assert cut.lft.order == order
        assert cut.error <= cut.bound * (1 + 1e-9) + 1e-12
        errors.append(cut.error)
    assert errors[0] < 1e-10
    assert errors[-1] > 1e-3
    for allowed in (1e-9, 0.05, 0.5):
        assert lft.truncate(allowed).error <= allowed


def test_truncation_of_one_parameter_is_measured_against_the_model_itself():
    lpv, _ = random_lpv(3)
    cut = lpv.to_lft().truncate(order=6)
    worst = max(
        np.abs(stacked(cut.lft.at(p)) - stacked(lpv.at(p))).max() for p in np.linspace(0, 13, 7)
    )
    # entries here are scaled to about one before the norm is taken: the plain difference is of the
    # same size
    assert 0.01 * cut.error < worst < 100 * cut.error
    assert cut.error <= cut.bound


def test_another_range_of_one_parameter_keeps_the_model():
    _, lft = polynomial()
    other = lft.with_scheduling(Scheduling("mass", "kg", 7.0, 7.5, 1.0))
    assert other.parameters[1].rate == 1.0
    np.testing.assert_allclose(stacked(other.at(3.3, 7.2)), stacked(lft.at(3.3, 7.2)), atol=1e-10)
    with pytest.raises(InputError, match=r"holds on \[7, 7.5\]"):
        other.at(3.3, 9.0)
    with pytest.raises(UnknownNameError, match="did you mean 'mass'"):
        lft.with_scheduling(Scheduling("mas", "kg", 7.0, 7.5))
    with pytest.raises(InputError, match="in kg"):
        lft.with_scheduling(Scheduling("mass", "m/s", 7.0, 7.5))
    grams = lft.with_scheduling(Scheduling("mass", "gram", 7000.0, 7500.0, 1000.0))
    at = stacked(grams.at(3.3, 7200.0))
    np.testing.assert_allclose(at, stacked(lft.at(3.3, 7.2)), atol=1e-10)


def reciprocal(scheduling):
    """y = u/p: y = e, e = u + y - p y."""
    return connect(
        LFT.parameter(scheduling, "y", "v"),
        scalar(1.0),
        inputs=["u"],
        outputs=["y"],
        sums={"e": {"u": 1.0, "y": 1.0, "v": -1.0}},
    )


def test_rational_dependence_comes_out_of_a_loop_and_is_well_posed_where_it_is_finite():
    inverse = reciprocal(MASS)
    assert inverse.order == 1
    assert inverse.at(8.3).D[0, 0] == pytest.approx(1 / 8.3, rel=1e-14)
    assert inverse.well_posed() == (True, {})
    pole = reciprocal(Scheduling("mass", "kg", -1.0, 2.0)).well_posed()
    assert pole.holds is False
    assert pole.where["mass"] == pytest.approx(0.0, abs=1e-9)


def test_a_loop_that_is_singular_only_inside_a_box_of_two_parameters_is_found():
    # 1/(p - q) with p in [1, 3], q in [0, 2]: the corners differ in sign; with q in [-3, -1] it is
    # proven
    def difference(low, high):
        q = Scheduling("q", "1", low, high)
        return connect(
            LFT.parameter(Scheduling("p", "1", 1.0, 3.0), "y", "v"),
            LFT.parameter(q, "y", "w"),
            scalar(1.0),
            inputs=["u"],
            outputs=["y"],
            sums={"e": {"u": 1.0, "y": 1.0, "v": -1.0, "w": 1.0}},
        )

    found = difference(0.0, 2.0).well_posed()
    assert found.holds is False
    assert found.where["p"] == pytest.approx(found.where["q"], abs=1e-9)
    assert difference(-3.0, -1.0).well_posed().holds is True
    # the determinant touches zero in one corner only: no change of sign can show it, nor can the
    # cells exclude it
    assert difference(-1.0, 1.0).well_posed(boxes=50).holds is not True


def test_polynomials_come_back_from_their_lft():
    lpv, _ = random_lpv(3)
    back = lpv.to_lft().reduce().to_lpv()
    assert back.basis == Polynomial(3, 0.0, 13.0)
    for p in (0.0, 5.1, 13.0):
        np.testing.assert_allclose(stacked(back.at(p)), stacked(lpv.at(p)), atol=1e-11)
    assert lpv.to_lft().to_lpv(degree=5).basis.size == 6


def test_kinematic_rows_of_the_helicopter_do_not_count_as_dependence(ideal):
    """Their rounding in the cubic fit, 1e-16 where the entry is one, was once scaled up to a
    dependence of size one.
    """
    import symheli

    family = symheli.sweep(ideal, np.linspace(0, 13, 14)).select(
        ["v", "p", "r", "phi", "b1"], ["d_lat", "d_ped"]
    )
    lft = family.interpolate("polynomial", 3).to_lft()
    assert lft.truncate(order=lft.reduce().order).error < 1e-10
    assert lft.reduce().to_lpv().basis == Polynomial(3, 0.0, 13.0)
    cut = lft.truncate(0.05)
    assert cut.lft.order < lft.reduce().order
    assert cut.error <= min(0.05, cut.bound)


def test_rational_dependence_becomes_a_polynomial_only_on_request_and_with_its_misfit():
    inverse = reciprocal(MASS)
    with pytest.raises(InputError, match="rationally"):
        inverse.to_lpv()
    errors = []
    for degree in (2, 4, 6):
        fitted = inverse.to_lpv(degree)
        assert fitted.residuals is not None
        errors.append(np.abs(fitted.residuals.D).max())
        assert abs(fitted.at(7.3).D[0, 0] - 1 / 7.3) <= 1.5 * errors[-1]
    # 1/p on [6, 10] converges by (sqrt(16) + sqrt(15))^2 = 62 every two degrees
    assert errors[1] < errors[0] / 40
    assert errors[2] < errors[1] / 40


def test_tustin_is_the_bilinear_transform_of_every_frozen_model():
    _, lft = polynomial()
    sampled = lft.discretize(0.05)
    assert sampled.order == lft.order
    z = np.exp(1j * np.array([0.1, 1.0, 20.0]) * 0.05)
    s = 2 / 0.05 * (z - 1) / (z + 1)
    for p in CORNERS:
        m = lft.at(*p)
        expected = (
            m.C
            @ np.linalg.solve(s[:, None, None] * np.eye(3) - m.A, np.broadcast_to(m.B, (3, 3, 2)))
            + m.D
        )
        np.testing.assert_allclose(
            sampled.at(*p).frequency_response(np.array([0.1, 1.0, 20.0])), expected, atol=1e-10
        )
    with pytest.raises(InputError, match="already discrete"):
        sampled.discretize(0.05)


def test_the_hold_error_shrinks_with_the_step():
    lpv, _ = random_lpv(1)
    lft = lpv.to_lft().reduce()
    # a band fixed in rad/s: the delay of half a sample of the hold is what remains, of first order
    errors = [lft.hold_error(dt, band=0.2 * dt / 0.02).relative for dt in (0.02, 0.01, 0.005)]
    assert errors[0] > errors[1] > errors[2]
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.15)


def test_wrong_use_is_explained():
    given, lft = polynomial()
    with pytest.raises(UnknownNameError, match="did you mean 'airspeed'"):
        lft.at(airsped=3.0, mass=7.0)
    with pytest.raises(InputError, match="expected 2 parameter value"):
        lft.at(3.0)
    with pytest.raises(InputError, match=r"mass spans \[12, 12\] kg"):
        lft.at(3.0, 12.0)
    with pytest.raises(InputError, match="2 exponent"):
        LFT.polynomial(**{**given, "A": {(1,): np.eye(3)}}, parameters=[SPEED, MASS])
    with pytest.raises(InputError, match=r"B: expected matrices of shape \(3, 1\)"):
        LFT.polynomial(**{**given, "B": {(0, 0): np.ones((4, 1))}}, parameters=[SPEED, MASS])
    with pytest.raises(InputError, match="one block a parameter"):
        LFT(
            np.zeros((2, 2)),
            np.zeros((2, 1)),
            np.zeros((1, 2)),
            np.zeros((1, 1)),
            ((SPEED, 1), (SPEED, 1)),
            ("x",),
            (),
            (),
        )
    with pytest.raises(InputError, match="either the error"):
        lft.truncate()
