"""Fewer states by the method that is named, and the coordinates that all methods share."""

import numpy as np
import pytest
from families import random_lpv
from test_balanced_truncation import lpv, lti

from symheli import LinearModel
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import balanced_truncation, minimal_realization, nu_gap, parallel
from symheli.lpv.balancing import REGULAR, balanced_gramians, square_root

OMEGA = np.geomspace(0.01, 100, 300)


def error(full, less):
    """Largest gain of the difference by that of the model, on a grid."""
    G, R = full.frequency_response(OMEGA), less.frequency_response(OMEGA)
    size = np.linalg.norm(G, 2, axis=(1, 2)).max()
    return np.linalg.norm(G - R, 2, axis=(1, 2)).max() / size


def test_an_order_takes_the_truncation_of_the_method():
    full = lti()
    for by, balance in (("coprime", "factors"), ("balanced", "response")):
        found, same = full.reduce(4, by=by), balanced_truncation(full, 4, balance=balance).model
        np.testing.assert_array_equal(found.A, same.A)
    np.testing.assert_array_equal(full.reduce(4).A, full.reduce(4, by="coprime").A)
    assert full.reduce(6) is full
    over_p = lpv(0.05)
    np.testing.assert_array_equal(over_p.reduce(3).A, over_p.truncate(3).model.A)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("by", "measured"), [("coprime", nu_gap), ("balanced", error)])
def test_a_loss_takes_the_fewest_states_that_keep_it(seed, by, measured):
    full = lti(seed=seed)
    for loss in (0.3, 0.03, 1e-12):
        less = full.reduce(by=by, loss=loss)
        order = len(less.states)
        assert measured(full, less) <= 1.001 * loss  # on a grid of its own
        if order > 1:
            assert measured(full, full.reduce(order - 1, by=by)) > 0.999 * loss


def test_without_order_and_loss_nothing_is_lost():
    one = lti()
    twice = parallel(one, one)
    for by in (None, "minimal", "coprime", "balanced"):
        less = twice.reduce(by=by)
        assert len(less.states) == 6
        assert error(twice, less) < 1e-6  # the square root of the rounding of Gramians
        assert one.reduce(by=by) is one
    assert len(minimal_realization(twice).states) == len(twice.reduce().states)
    gain = LinearModel.gain([[2.0]], ["u"], ["y"])
    assert [gain.reduce(by=by) for by in (None, "coprime", "balanced")] == [gain] * 3


def test_copies_of_a_parameter_are_reduced_alike():
    lft = random_lpv(2, rank=2)[0].to_lft()
    exact = lft.reduce()
    assert lft.reduce(by="minimal").order == exact.order < lft.order
    assert lft.reduce(order=1).order == 1
    found = lft.truncate(0.5)
    assert lft.reduce(loss=0.5).order == found.lft.order < exact.order
    assert found.error <= 0.5


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"order": 7}, InputError, "order: expected an integer from 1 to 5"),
        ({"order": 2.0}, InputError, "order: expected an integer from 1 to 5"),
        ({"order": 2, "loss": 0.1}, InputError, "not both"),
        ({"order": 2, "by": "minimal"}, InputError, "loses nothing.*give coprime or balanced"),
        ({"loss": -0.1}, InputError, "loss: expected a number >= 0"),
        ({"loss": "3 %"}, InputError, "loss: expected a number >= 0"),
        ({"by": "coprim"}, UnknownNameError, "did you mean 'coprime'"),
        ({"by": "bounded"}, InputError, r"synthesis\.designs\.bounded_truncation\(model, order"),
    ],
)
def test_what_does_not_select_an_order_is_refused(given, error, message):
    with pytest.raises(error, match=message):
        lti().reduce(**given)


def test_tolerance_order_and_loss_of_an_lft_are_not_mixed_up():
    lft = random_lpv(2)[0].to_lft()
    for given, message in (
        ({"tolerance": 3}, r"reduce\(order=\.\.\.\)"),
        ({"tolerance": "x"}, "tolerance: expected a number >= 0"),
        ({"tolerance": 1e-12, "order": 2}, 'of by="minimal"'),
        ({"by": "balanced"}, "give either the error allowed"),
        ({"order": 1.5}, "order: expected a whole number"),
        ({"by": "coprime"}, "known: minimal, balanced"),
    ):
        with pytest.raises(InputError, match=message):
            lft.reduce(**given)


def test_the_advice_for_a_model_without_gramians_works():
    """An unstable state that no input moves, and one that the response has no Gramians for."""
    A, B, C = np.diag([0.5, 1.5, 0.3]), [[1.0], [0.0], [1.0]], [[1.0, 1.0, 0.5]]
    hidden = LinearModel(A, B, C, [[0.0]], "abc", ["u"], ["y"], dt=0.1)
    with pytest.raises(InputError, match=r"mode z = 1\.5 is not stable.*\.reduce\(\) leaves out"):
        hidden.reduce(1)
    assert len(hidden.reduce().reduce(1).states) == 1
    unstable = lti(shift=1.0)
    with pytest.raises(InputError, match=r'reduce\(by="coprime"\)'):
        unstable.reduce(4, by="balanced")
    assert len(unstable.reduce(4, by="coprime").states) == 4


@pytest.mark.parametrize("rank", [5, 3])
def test_balanced_coordinates_have_an_inverse(rank):
    """Both Gramians become the values; of states that nothing moves too the way back is exact."""
    rng = np.random.default_rng(rank)
    L, R = rng.standard_normal((5, rank)), rng.standard_normal((5, 5))
    X, Y = L @ L.T, R @ R.T
    into, out, values = balanced_gramians(X, Y, REGULAR)
    np.testing.assert_allclose(into @ out, np.eye(5), atol=1e-6)  # eps / REGULAR^1/2
    np.testing.assert_allclose(into @ Y @ into.T, np.diag(values), atol=1e-6 * values[0])
    np.testing.assert_allclose(out.T @ X @ out, np.diag(values), atol=1e-6 * values[0])
    assert np.sum(values > 1e-6 * values[0]) == rank
    root = square_root(X)
    np.testing.assert_allclose(root @ root.T, X, atol=1e-14 * np.abs(X).max())
