"""What depends on p is decided entry by entry: no unit of a state, an input, an output or a
parameter changes the model.
"""

from dataclasses import replace

import numpy as np
import pytest
from families import random_lpv
from hypothesis import given, settings
from hypothesis import strategies as st

from symheli import LFT, LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv.equilibration import equilibrate, is_singular
from symheli.lpv.lft import expanded

UNITS = st.floats(-12, 12).map(lambda e: 10.0**e) | st.integers(-40, 40).map(lambda e: 2.0**e)


def units(*counts):
    return st.tuples(*(st.lists(UNITS, min_size=n, max_size=n).map(np.array) for n in counts))


def in_units(terms, row, column, parameters):
    """{exponents: matrix} with rows, columns and parameters in other units."""
    return {
        e: row[:, None] * M / column / np.prod([s**k for s, k in zip(parameters, e, strict=True)])
        for e, M in terms.items()
    }


@pytest.mark.slow
@pytest.mark.parametrize("reduced", [False, True])
@settings(max_examples=40, deadline=None)
@given(units(3, 2, 2, 2), st.integers(0, 10**6))
def test_an_lft_in_two_parameters_keeps_every_term_in_any_units(reduced, scales, seed):
    x, u, y, q = scales
    rng = np.random.default_rng(seed)
    one = rng.standard_normal
    A = {
        (0, 0): one((3, 3)),
        (1, 0): np.outer(one(3), one(3)),
        (1, 1): np.outer(one(3), one(3)),
        (0, 2): np.outer(one(3), one(3)),
    }
    B, C, D = (
        {(0, 0): one((3, 2)), (0, 1): one((3, 2))},
        {(0, 0): one((2, 3)), (1, 0): one((2, 3))},
        {(0, 0): one((2, 2))},
    )
    box = [(0.0, 2.0), (-1.0, 3.0)]

    def made(x, u, y, q):
        parameters = [
            Scheduling(name, "1", low * s, high * s)
            for name, (low, high), s in zip("pq", box, q, strict=True)
        ]
        return LFT.polynomial(
            in_units(A, x, x, q),
            in_units(B, x, u, q),
            in_units(C, y, x, q),
            in_units(D, y, u, q),
            parameters,
        )

    plain, lft = made(np.ones(3), np.ones(2), np.ones(2), np.ones(2)), made(x, u, y, q)
    if reduced:
        order = plain.reduce().order
        lft = lft.reduce()
        # in other units than powers of two the terms are rounded, and may have more copies
        exact = all(np.frexp(s)[0].max() == np.frexp(s)[0].min() == 0.5 for s in scales)
        assert lft.order == order if exact else lft.order >= order
    for p in ((0.0, -1.0), (2.0, 3.0), (0.3, 1.9)):
        here, there = lft.at(*(np.array(p) * q)), plain.at(*p)
        for name, row, column in (("A", x, x), ("B", x, u), ("C", y, x), ("D", y, u)):
            # the size of the terms added is below 50, and an LFT of this size loses a few digits of
            # the last place
            np.testing.assert_allclose(
                getattr(here, name) * column / row[:, None], getattr(there, name), atol=1e-11
            )
    terms = expanded(lft)
    assert terms is not None
    assert max(e[0] for e in terms) == 1
    assert max(e[1] for e in terms) == 2


def rational(b, a):
    """B(p) = b (1 + p/(1 - a p)), p in [-1, 1], A = -1, C = 1."""
    p = Scheduling("p", "1", -1.0, 1.0, 0.1)
    return LFT(
        [[a]],
        [[0.0, 1.0]],
        [[b], [0.0]],
        [[-1.0, b], [1.0, 0.0]],
        ((p, 1),),
        ("x",),
        ("u",),
        ("y",),
    )


@pytest.mark.parametrize("b", [1e-300, 1e-10, 1.0, 1e10])
@pytest.mark.parametrize("a", [1e-12, 1e-6, 0.99, 1 - 1e-14])
def test_rational_dependence_is_never_taken_for_polynomial_however_small_its_channel(a, b):
    lft = rational(b, a)
    assert expanded(lft) is None
    assert expanded(lft.reduce()) is None
    with pytest.raises(InputError, match="rationally"):
        lft.to_lpv()


def test_a_tiny_residue_beside_a_pole_at_the_edge_of_the_box_is_rational():
    """Every coefficient of the series is below rounding, their sum is not: 1e-13 / 1e-14."""
    p = Scheduling("p", "1", -1.0, 1.0)
    lft = LFT([[1 - 1e-14]], [[1e-13]], [[1.0]], [[1.0]], ((p, 1),), (), ("u",), ("y",))
    assert lft.at(1.0).D[0, 0] > 2
    assert expanded(lft) is None


@pytest.mark.parametrize("copies", [4, 24, 40])
def test_a_polynomial_whose_loop_was_rotated_is_recognised_and_keeps_all_its_terms(copies):
    """The bound on rounding once grew with the powers of |M11| and swallowed every term of 24
    copies.
    """
    rng = np.random.default_rng(copies)
    lpv = LPVStateSpace.polynomial(
        [rng.standard_normal((copies // 4, copies // 4)) for _ in range(4)],
        [np.ones((copies // 4, 1))],
        [np.ones((1, copies // 4))],
        [[[0.0]]],
        Scheduling("p", "1", 0.0, 1.0),
    )
    lft = lpv.to_lft().reduce()
    T = np.linalg.qr(rng.standard_normal((lft.order, lft.order)))[0]
    turned = LFT(
        T @ lft.M11 @ T.T,
        T @ lft.M12,
        lft.M21 @ T.T,
        lft.M22,
        lft.blocks,
        lft.states,
        lft.inputs,
        lft.outputs,
    )
    back = turned.to_lpv()
    assert back.basis.size == 4
    for p in (0.0, 0.4, 1.0):
        np.testing.assert_allclose(back.at(p).A, lpv.at(p).A, atol=1e-12)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(units(3, 2, 2, 1), st.booleans(), st.booleans(), st.integers(0, 10**6))
def test_feedback_closes_the_loop_of_every_frozen_model_in_any_units(
    scales, constant, through, seed
):
    x, u, y, (s,) = scales
    rng = np.random.default_rng(seed)
    one = rng.standard_normal

    def stack(rows, columns, count, row, column):
        return [row[:, None] * one((rows, columns)) / column / s**i for i in range(count)]

    A, B = stack(3, 3, 3, x, x), stack(3, 2, 2, x, u)
    C, D = (
        stack(2, 3, 1 if constant else 2, y, x),
        [y[:, None] * (0.1 * one((2, 2)) if through else np.zeros((2, 2))) / u],
    )
    lpv = LPVStateSpace.polynomial(A, B, C, D, Scheduling("p", "1", 0.0, s))
    K = one((2, 2)) * u[:, None] / y
    gains = {(f"u{i + 1}", f"y{j + 1}"): K[i, j] for i in range(2) for j in range(2)}
    closed = lpv.feedback(gains)
    for p in (0.0, 0.37 * s, s):
        here, expected = closed.at(p), lpv.at(p).feedback(gains)
        m = lpv.at(p)
        loop = np.linalg.inv(np.eye(2) - K @ m.D)
        for name, row, column in (("A", x, x), ("B", x, u), ("C", y, x), ("D", y, u)):
            # in plain units the terms that are added are of size 1 to 1000 (a loop near singular)
            np.testing.assert_allclose(
                getattr(here, name) * column / row[:, None],
                getattr(expected, name) * column / row[:, None],
                atol=1e-11 * (1 + np.abs(loop * u / u[:, None]).max()) ** 2,
            )


def test_an_output_that_depends_on_p_is_not_taken_for_constant_beside_a_large_one():
    """A(1) = 8 was once closed as A(1) = -1: the change of y1 was judged by the size of y2."""
    for small in (1.0, 1e-9, 1e-13):
        lpv = LPVStateSpace.polynomial(
            [[[-1.0]]],
            [[[1 / small]]],
            [[[0.0], [1e13]], [[9 * small], [0.0]]],
            [np.zeros((2, 1))],
            Scheduling("p", "1", 0.0, 1.0),
        )
        assert lpv.feedback({("u1", "y1"): 1.0}).at(1.0).A[0, 0] == pytest.approx(8.0, rel=1e-12)


def test_equilibrated_matrices_are_the_same_in_any_units():
    rng = np.random.default_rng(3)
    M = np.abs(rng.standard_normal((5, 4))) * (rng.uniform(size=(5, 4)) < 0.7) + 1e-3
    for _ in range(10):
        row, column = 10.0 ** rng.uniform(-12, 12, 5), 10.0 ** rng.uniform(-12, 12, 4)
        other = row[:, None] * M * column
        one, two = ((r[:, None] * N * c) for N in (M, other) for r, c in [equilibrate(N)])
        np.testing.assert_allclose(
            one, two, rtol=1e-9
        )  # logarithms of 24 decades lose a few digits
    assert is_singular(np.array([[1.0, 2e12], [1e-12, 2.0]]))
    assert not is_singular(np.diag([1.0, 1e-20]))


def test_truncation_cuts_the_same_copies_in_all_units():
    lpv, _ = random_lpv(3, rank=2)
    plain = lpv.to_lft().truncate(order=6)
    rng = np.random.default_rng(0)
    for _ in range(3):
        x, u, y = (10.0 ** rng.uniform(-12, 12, n) for n in (4, 2, 3))
        scaled = replace(
            lpv,
            A=x[:, None] * lpv.A / x,
            B=x[:, None] * lpv.B / u,
            C=y[:, None] * lpv.C / x,
            D=y[:, None] * lpv.D / u,
        )
        cut = scaled.to_lft().truncate(order=6)
        assert (cut.error, cut.bound) == pytest.approx((plain.error, plain.bound), rel=1e-9)
