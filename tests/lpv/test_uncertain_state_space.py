"""A set of LPV models as one value: what holds of the value holds of every model."""

import math

import numpy as np
import pytest
from families import SPEED

from symheli import LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import PiecewiseLinear

P = np.linspace(0.0, 13.0, 7)


def uncertain(dt=None, degree=1, bound=0.3):
    """Two states, inputs u w, outputs y z, Delta (2, 3), all but the feedthrough to y and z a
    polynomial of `degree`.
    """
    rng = np.random.default_rng(0)

    def powers(*shape):
        return [rng.standard_normal(shape) / 13.0**k for k in range(degree + 1)]

    D = powers(5, 4)
    for k, M in enumerate(D):
        M[2:, 2:] = M[0, 2:] = 0.0  # no loop through the block alone, nor through y
        M[:2] *= k == 0
    model = LPVStateSpace.polynomial(
        *(powers(2, 2), powers(2, 4), powers(5, 2), D, SPEED, dt),
        inputs=["u", "w", "d1", "d2"],
        outputs=["y", "z", "v1", "v2", "v3"],
    )
    return UncertainStateSpace(model, ["d1", "d2"], ["v1", "v2", "v3"], bound, 0.95, "by choice")


def by_hand(unc, delta, p):
    """The block closed at one p, entry by entry: A + E Delta G and so on."""
    A, B, C, D = unc.model.matrices(p)
    E, F, G, H = B[:, 2:], D[:2, 2:], C[2:], D[2:, :2]
    return (
        A + E @ delta @ G,
        B[:, :2] + E @ delta @ H,
        C[:2] + F @ delta @ G,
        D[:2, :2] + F @ delta @ H,
    )


@pytest.mark.parametrize("dt", [None, 0.02])
def test_one_perturbation_is_the_loop_through_the_block(dt):
    unc = uncertain(dt, degree=2)
    delta = unc.perturbations(1, seed=3)[0]
    lpv = unc.perturbed(delta)
    assert (lpv.inputs, lpv.outputs, lpv.dt) == (("u", "w"), ("y", "z"), dt)
    for p in P:
        for found, expected in zip(lpv.matrices(p), by_hand(unc, delta, p), strict=True):
            np.testing.assert_allclose(found, expected, atol=1e-12)  # rounding of sums of ten terms


def test_no_perturbation_is_the_nominal_model():
    unc = uncertain()
    for found, expected in zip(
        unc.perturbed(np.zeros((2, 3))).matrices(P), unc.nominal.matrices(P), strict=True
    ):
        np.testing.assert_allclose(found, expected, atol=1e-13)


def test_a_loop_around_the_set_is_that_loop_around_each_model():
    unc, gains = uncertain(), {("u", "y"): -0.2}
    delta = unc.perturbations(1, seed=0)[0]
    around = unc.feedback(gains).perturbed(delta)
    each = unc.perturbed(delta).feedback(gains)
    for p in P:
        for one, other in zip(around.matrices(p), each.matrices(p), strict=True):
            np.testing.assert_allclose(one, other, atol=1e-11)


def test_channels_chosen_and_scaled_are_those_of_each_model():
    unc = uncertain()
    delta = unc.perturbations(1, seed=0)[0]
    sizes = {"w": 0.01}, {"z": 0.1}
    one = unc.select(inputs=["w"], outputs=["z", "y"]).scaled(*sizes).perturbed(delta)
    other = unc.perturbed(delta).select(inputs=["w"], outputs=["z", "y"]).scaled(*sizes)
    assert (one.inputs, one.outputs) == (("w",), ("z", "y"))
    for a, b in zip(one.matrices(P), other.matrices(P), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)
    np.testing.assert_allclose(
        other.D, unc.perturbed(delta).select(inputs=["w"], outputs=["z", "y"]).D * [[0.1], [0.01]]
    )


def test_ranges_and_rates_are_those_of_the_model():
    unc = uncertain().with_rate(2.0)
    assert unc.scheduling.rate == unc.perturbed(np.zeros((2, 3))).scheduling.rate == 2.0
    narrow = unc.with_scheduling(Scheduling("airspeed", "m/s", 1.0, 2.0, 0.5))
    assert narrow.nominal.scheduling.high == 2.0


def test_draws_of_the_ball_are_uniform_and_those_of_the_boundary_on_it():
    unc, count = uncertain(bound=0.3), 20000
    norms = np.linalg.norm(unc.perturbations(count, seed=1), 2, axis=(1, 2)) / 0.3
    # the volume within r is r^6 of the whole: six numbers in a matrix
    for r in (0.5, 0.8, 0.9, 0.97):
        assert np.mean(norms <= r) == pytest.approx(r**6, abs=4 * math.sqrt(r**6 / count))
    values = np.linalg.svd(unc.perturbations(50, seed=1, where="boundary"), compute_uv=False)
    np.testing.assert_allclose(values, 0.3, rtol=1e-12)
    for lpv in unc.draws(2, seed=0):
        assert isinstance(lpv, LPVStateSpace)


def test_a_spline_holds_products_with_constants_others_are_patches():
    basis = PiecewiseLinear((0.0, 5.0, 13.0))
    one = np.ones((3, 1, 1))
    varying = np.array([1.0, 2.0, 4.0])[:, None, None]

    def with_v(C):
        zero = np.zeros((3, 2, 2))
        model = LPVStateSpace(
            *(basis, -one, np.concatenate([one, varying], 2), np.concatenate([one, C], 1), zero),
            *(SPEED, ("x",), ("u", "d"), ("y", "v")),
        )
        return UncertainStateSpace(model, "d", "v", 0.1, 1.0, "by choice")

    assert with_v(2 * one).perturbed([[0.1]]).at(13.0).A == pytest.approx(-1 + 4 * 0.1 * 2)
    assert with_v(2 * one).perturbed([[0.1]]).basis == basis
    squared = with_v(varying).perturbed([[0.1]])
    assert squared.at(2.5).A == pytest.approx(-1 + 0.1 * 1.5**2)  # of values half way, not half


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"bound": -0.1}, "bound: expected a finite number >= 0"),
        ({"bound": math.nan}, "bound: expected a finite number >= 0"),
        ({"bound": math.inf}, "bound: expected a finite number >= 0"),
        ({"bound": True}, "bound: expected"),
        ({"probability": 0.0}, "probability"),
        ({"probability": 1.5}, "probability"),
        ({"source": " "}, "source: expected a sentence"),
        ({"perturbation_inputs": ["d3"]}, "unknown input of the model 'd3'"),
        ({"perturbation_outputs": []}, "perturbation_outputs: expected one name or more"),
        ({"perturbation_inputs": ["d1", "d1"]}, "repeated"),
    ],
)
def test_what_is_no_set_is_refused_in_words(change, words):
    unc = uncertain()
    given = {
        name: getattr(unc, name)
        for name in ("perturbation_inputs", "perturbation_outputs", "bound", "probability")
    }
    with pytest.raises(InputError, match=words):
        UncertainStateSpace(**{"model": unc.model, "source": "by choice", **given, **change})


def test_what_is_not_in_the_set_is_refused():
    unc = uncertain()
    with pytest.raises(InputError, match=r"norm of at most 0\.3, got 0\.4"):
        unc.perturbed(0.4 * np.eye(2, 3))
    with pytest.raises(InputError, match="shape"):
        unc.perturbed(np.zeros((3, 2)))
    with pytest.raises(InputError, match="count"):
        unc.perturbations(0, seed=0)
    with pytest.raises(InputError, match="'ball' or 'boundary'"):
        unc.perturbations(1, seed=0, where="gauss")
    for forbidden in (
        lambda: unc.feedback({("d1", "y"): 1.0}),
        lambda: unc.select(inputs=["d1"]),
        lambda: unc.scaled(outputs={"v1": 2.0}),
    ):
        with pytest.raises(UnknownNameError):
            forbidden()
    with pytest.raises(InputError, match="the size of the input u must be a number > 0"):
        unc.scaled({"u": 0.0})
