"""A loop whose controller reads a wrong parameter: bounds hold for every error, and come close."""

from dataclasses import replace

import numpy as np
import pytest

import symheli
from symheli import LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError
from symheli.lpv import PiecewiseLinear, Polynomial
from symheli.lpv.bases import Patches
from synthesis import Plant, frozen_gain, l2_gain
from synthesis.analysis import proven_around, with_scheduling_error
from synthesis.design.loops.balanced_block import balanced
from synthesis.design.loops.frozen_reading import largest
from synthesis.design.loops.wrong_parameter import _reached, _slopes
from synthesis.forms import Spline

P = Scheduling("p", "1", 0.0, 1.0, rate=0.1)
CLOSE = 1e-4
"""The solver's tolerance on a squared gain, and the room left for rounding."""


def lag():
    """x(k+1) = (0.9 + 0.3 p) x + 0.1 (w + u), y = x."""
    model = LPVStateSpace.polynomial(
        [[[0.9]], [[0.3]]],
        [[[0.1, 0.1]]],
        [[[1.0]]],
        [[[0.0, 0.0]]],
        P,
        0.1,
        inputs=("w", "u"),
        outputs=("y",),
    )
    return _plant(model)


def pendulum():
    """Two states, whose stiffness grows with p."""
    model = LPVStateSpace.polynomial(
        [[[1.0, 0.1], [-0.1, 0.9]], [[0.0, 0.0], [-0.3, 0.0]]],
        [[[0.0, 0.0], [0.1, 0.1]]],
        [[[1.0, 0.0]]],
        [[[0.0, 0.0]]],
        P,
        0.1,
        inputs=("w", "u"),
        outputs=("y",),
    )
    return _plant(model)


def _plant(model):
    return Plant(model, disturbances=["w"], performance=["y"], controls=["u"], measurements=["y"])


def gain(*coefficients):
    """u = (c0 + c1 p + ..) y."""
    return LPVStateSpace.polynomial(
        [np.zeros((0, 0))],
        [np.zeros((0, 1))],
        [np.zeros((1, 0))],
        [[[c]] for c in coefficients],
        P,
        inputs=("y",),
        outputs=("u",),
    )


def scheduled(basis, seed=0, order=2):
    """A random controller over the basis."""
    rng = np.random.default_rng(seed)
    n = basis.size
    return LPVStateSpace(
        basis,
        0.2 * rng.standard_normal((n, order, order)),
        rng.standard_normal((n, order, 1)),
        0.1 * rng.standard_normal((n, 1, order)),
        rng.standard_normal((n, 1, 1)),
        (P,),
        tuple(f"k{i}" for i in range(order)),
        ("y",),
        ("u",),
        0.1,
    )


@pytest.mark.slow(but="0.0")
@pytest.mark.parametrize("error", [0.0, 0.1, 0.3, 0.6])
def test_of_an_affine_gain_on_one_state_the_bound_is_the_gain_of_the_worst_error(error):
    wrong = with_scheduling_error(lag(), gain(-1.0, -3.0), error)
    certificate = l2_gain(wrong, search=None)
    assert certificate.gamma == pytest.approx(0.1 / (0.2 - 0.3 * error), rel=CLOSE)
    assert certificate.verified


@pytest.mark.parametrize(
    "basis",
    [
        PiecewiseLinear((0.0, 0.3, 0.55, 1.0)),
        Polynomial(3, 0.0, 1.0),
        PiecewiseLinear(tuple(np.linspace(0.0, 1.0, 9).tolist())),
    ],
)
@pytest.mark.parametrize("error", [0.05, 0.4])
def test_every_divided_difference_is_within_the_slopes(basis, error):
    K = scheduled(basis)
    S = _slopes(K, P, error, 8)
    rng = np.random.default_rng(1)
    p = rng.uniform(0.0, 1.0, 400)
    q = np.clip(p + error * rng.choice([-1.0, 1.0, *rng.uniform(-1, 1, 6)], 400), 0.0, 1.0)
    there, here = (np.block([[M.A, M.B], [M.C, M.D]]) for M in (K.matrices(q), K.matrices(p)))
    far = np.abs(q - p) > 1e-3
    slope = (there - here)[far] / (q - p)[far, None, None]
    rest = (slope - S[0](p[far])).reshape(len(slope), -1)
    directions = np.stack([each(p[far]).reshape(len(slope), -1) for each in S[1:]], axis=-1)
    for wanted, along in zip(rest, directions, strict=True):
        m = np.linalg.lstsq(along, wanted)[0]
        assert np.abs(m).max() <= 1 + 1e-9
        # what no direction gives is rounding, which a quotient by 1e-3 makes larger
        assert np.abs(wanted - along @ m).max() < 1e-9 * np.abs(slope).max()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("basis", "error"),
    [(Polynomial(2, 0.0, 1.0), 0.02)],
)
def test_frozen_loops_of_wrong_readings_are_within_the_bound(basis, error):
    K = scheduled(basis, seed=5)
    K = replace(K, B=0.3 * K.B, D=0.2 * K.D - basis.constant()[:, None, None])
    plant = pendulum()
    certificate = l2_gain(with_scheduling_error(plant, K, error), search=None)
    assert certificate.verified
    worst = 0.0
    for q in np.linspace(0.0, 1.0, 11):
        frozen = plant.close(K.at(q))
        near = frozen.with_scheduling(
            Scheduling("p", "1", max(0.0, q - error), min(1.0, q + error), 0.1)
        )
        worst = max(worst, frozen_gain(near, points=9).gain)
    assert worst <= certificate.gamma
    right = frozen_gain(plant.close(K)).gain
    assert right <= worst * (1 + 1e-9)


@pytest.mark.slow
def test_the_bound_is_that_of_the_exact_analysis_over_parameter_and_error():
    """K(p + b) of an affine K is a model over p and b, where b may jump."""
    error, c0, c1, plant = 0.1, -1.0, 1.0, pendulum()
    wrong = l2_gain(with_scheduling_error(plant, gain(c0, c1), error), search=None)
    b = Scheduling("b", "1", -error, error)
    exact = LPVStateSpace.polynomial(
        {
            (0, 0): [[1.0, 0.1], [-0.1 + 0.1 * c0, 0.9]],
            (1, 0): [[0.0, 0.0], [-0.3 + 0.1 * c1, 0.0]],
            (0, 1): [[0.0, 0.0], [0.1 * c1, 0.0]],
        },
        {(0, 0): [[0.0], [0.1]]},
        {(0, 0): [[1.0, 0.0]]},
        {(0, 0): [[0.0]]},
        (P, b),
        0.1,
    )
    form = Spline(degree=(2, 0), segments=(1, 1))
    both = l2_gain(exact, form=form, search=None)
    assert wrong.verified
    assert both.verified
    # a block of 1 x 1 is b itself, so that only the multiplier, one for all p, costs anything
    assert both.gamma * (1 - CLOSE) <= wrong.gamma < 1.05 * both.gamma
    assert wrong.frozen <= both.gamma


@pytest.mark.slow
def test_an_error_of_zero_leaves_the_loop():
    K = scheduled(PiecewiseLinear((0.0, 0.4, 1.0)), seed=3)
    K = replace(K, D=np.full_like(K.D, -1.0))
    plain, wrong = pendulum().close(K), with_scheduling_error(pendulum(), K, 0.0)
    p = np.linspace(0.0, 1.0, 7)
    for mine, theirs in zip(wrong.nominal.matrices(p), plain.matrices(p), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-14)
    least, most = (l2_gain(m, form=Spline(degree=0), search=None).gamma for m in (plain, wrong))
    assert most == pytest.approx(least, rel=1e-3)  # more segments, and a millionth for the block
    assert not np.any(wrong.model.B[:, :, 1:])


@pytest.mark.slow
def test_the_block_of_an_uncertain_plant_is_kept():
    plant = lag()
    missed = np.array([[[0.01, 0.0, 0.0]]])
    uncertain = _plant(UncertainStateSpace.covering(plant.model, missed))
    wrong = l2_gain(with_scheduling_error(uncertain, gain(-1.0, -3.0), 0.1), search=None)
    # pole 0.8, of which the plant leaves 0.02 open and the reading 0.03; the entry of the input
    # is open by a millionth
    truth = 0.1 / (0.2 - 0.03 - 0.02)
    assert truth * (1 - CLOSE) <= wrong.gamma < 1.001 * truth


def test_a_controller_that_jumps_is_refused():
    jumps = scheduled(Patches(1, (0.0, 0.5, 1.0)))
    with pytest.raises(InputError, match=r"jumps at p = 0\.5"):
        with_scheduling_error(pendulum(), jumps, 0.1)


def two_lags(size):
    """Two lags of one state, seen in units `size` times finer and coarser."""
    model = LPVStateSpace.polynomial(
        [np.diag([0.9, 0.9]), np.diag([0.3, 0.1])],
        [np.hstack([0.1 * np.eye(2), 0.1 * np.eye(2)])],
        [np.vstack([np.eye(2), np.diag([size, 1.0 / size])])],
        [np.zeros((4, 4))],
        P,
        0.1,
        inputs=("w", "x", "u", "v"),
        outputs=("y", "z", "a", "b"),
    )
    return Plant(
        model,
        disturbances=["w", "x"],
        performance=["y", "z"],
        controls=["u", "v"],
        measurements=["a", "b"],
    )


def two_gains(*coefficients, basis=None):
    """u = (c0 + c1 p + ..) y for 2 x 2 matrices c, or coefficients of a `basis`."""
    D = np.array(coefficients)
    if basis is None:
        return LPVStateSpace.polynomial(
            [np.zeros((0, 0))],
            [np.zeros((0, 2))],
            [np.zeros((2, 0))],
            D,
            P,
            inputs=("a", "b"),
            outputs=("u", "v"),
        )
    n = basis.size
    nothing = np.zeros((n, 0, 0)), np.zeros((n, 0, 2)), np.zeros((n, 2, 0))
    return LPVStateSpace(basis, *nothing, D, (P,), (), ("a", "b"), ("u", "v"), None)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.0, 1e3, 1e7, 1e12])
def test_the_bound_covers_the_worst_reading_in_any_units_of_the_measurements(size):
    """Where p is 1 and read as 0.75 the first pole is 1.2 - 0.325: a gain of 0.8."""
    K = two_gains(-np.diag([1 / size, size / 2]), -np.diag([3 / size, size / 2]))
    found = l2_gain(
        with_scheduling_error(two_lags(size), K, 0.25), 0.1, form=Spline(degree=0), search=None
    )
    assert found.verified
    assert found.gamma >= 0.8
    same = l2_gain(
        with_scheduling_error(
            two_lags(1.0), two_gains(-np.diag([1.0, 0.5]), -np.diag([3.0, 0.5])), 0.25
        ),
        0.1,
        form=Spline(degree=0),
        search=None,
    )
    assert found.gamma == pytest.approx(same.gamma, rel=1e-4)


@pytest.mark.parametrize("beside", [0.0, 1.0, 1e11, -1e200])
def test_a_jump_of_one_entry_is_seen_beside_any_other(beside):
    basis = Patches(0, (0.0, 0.5, 1.0))
    jumps = two_gains([[-1.0, 0.0], [0.0, beside]], [[-3.0, 0.0], [0.0, beside]], basis=basis)
    with pytest.raises(InputError, match=r"jumps at p = 0\.5"):
        with_scheduling_error(two_lags(1.0), jumps, 0.05)


@pytest.mark.parametrize("seed", range(8))
def test_slopes_hold_every_entry_to_its_own_size(seed):
    """Entries from 1e-12 to 1e12: each divided difference is within the slopes, entry by entry."""
    rng = np.random.default_rng(seed)
    basis = PiecewiseLinear((0.0, 0.2, 0.45, 1.0))
    size = 10.0 ** rng.uniform(-12, 12, (3, 3))
    K = scheduled(basis, seed)
    whole = rng.standard_normal((4, 3, 3)) * size
    K = replace(K, A=whole[:, :2, :2], B=whole[:, :2, 2:], C=whole[:, 2:, :2], D=whole[:, 2:, 2:])
    S = _slopes(K, P, 0.05, 8)
    U, rows = _reached([each.coefficients for each in S])
    for p, q in ((0.17, 0.19), (0.19, 0.23), (0.44, 0.46), (0.5, 0.55), (0.0, 0.05)):
        there, here = (np.block([[M.A, M.B], [M.C, M.D]]) for M in (K.matrices(q), K.matrices(p)))
        at = np.array([p])
        kept = [U @ each(at)[0][rows] for each in S]
        for whole, rebuilt in zip(S, kept, strict=True):
            np.testing.assert_allclose(rebuilt, whole(at)[0], rtol=1e-12)
        room = sum(np.abs(each) for each in kept[1:])
        assert np.all(np.abs((there - here) / (q - p) - kept[0]) <= room + 1e-9 * size)


def test_a_wrong_error_or_controller_is_refused():
    with pytest.raises(InputError, match="error: expected a number >= 0"):
        with_scheduling_error(lag(), gain(-1.0), -0.1)
    other = replace(gain(-1.0, -1.0), parameters=(Scheduling("q", "1", 0.0, 1.0),))
    with pytest.raises(InputError, match="the same one parameter"):
        with_scheduling_error(lag(), other, 0.1)
    through = replace(lag().model, D=lag().model.D + np.array([[[0.0, 1.0]]] * 2))
    with pytest.raises(InputError, match=r"enters\s+twice"):
        with_scheduling_error(_plant(through), gain(-1.0), 0.1)


def test_balancing_never_costs_and_finds_the_spectral_radius_of_one_matrix():
    rng = np.random.default_rng(0)
    H = rng.standard_normal((40, 4, 4)) * np.array([1.0, 1e3, 1.0, 1e-3])
    T, same, least = balanced(H, 2, 2)
    np.testing.assert_array_equal(T, same)
    assert least <= np.linalg.norm(H, 2, axis=(1, 2)).max()
    assert least == pytest.approx(np.linalg.norm(np.linalg.solve(T, H @ T), 2, axis=(1, 2)).max())
    assert not np.any(T[:2, 2:])
    assert not np.any(T[2:, :2])
    one = np.diag([1.0, 2.0, 3.0]) + np.triu(rng.standard_normal((3, 3)), 1)
    # no similarity goes below the spectral radius; balancing comes near it
    assert 3.0 <= balanced(one[None], 3)[2] < 3.3


@pytest.mark.slow
def test_a_frozen_reading_is_proven_up_to_where_the_loop_turns_unstable():
    # u = -1.2 y: the pole 0.9 + 0.3 p - 0.12 reaches 1 at p = 0.7333
    low, high = proven_around(lag(), {("u", "y"): -1.2}, 0.5, tolerance=0.02)
    assert low == 0.0
    assert 0.7333 - 0.02 * 0.5 <= high < 0.73334


@pytest.mark.slow
def test_a_frozen_reading_holds_the_numbers_of_the_place_where_it_froze():
    # K(0.2) = -1.6: stable up to p = 0.8667; K(p) itself everywhere
    low, high = proven_around(lag(), gain(-1.0, -3.0), 0.2, tolerance=0.02)
    assert low == 0.0
    assert 0.8666 - 0.02 * 0.8 <= high < 0.86667
    with pytest.raises(InputError, match="expected p within"):
        proven_around(lag(), gain(-1.0), 1.5)


@pytest.mark.parametrize("truth", [0.037, 0.5, 2.9])
def test_bisection_ends_on_both_sides_of_the_truth(truth):
    asked = []

    def proves(value):
        asked.append(value)
        return value <= truth

    found = largest(proves, 3.0, 0.01)
    assert found.bound <= truth < found.failed
    assert found.failed - found.bound <= 0.03
    assert found.bound in asked


def test_bisection_refuses_what_is_not_positive():
    with pytest.raises(InputError, match="most > 0"):
        largest(lambda b: True, 0.0)


@pytest.mark.slow
def test_the_lateral_loop_is_stable_however_its_airspeed_is_misread(ideal):
    """2.5 m/s: a bias of 1 m/s and a lag of .5 s at 3 m/s^2 together, from 8 to 11 m/s."""
    from evidence.designed_lateral import DT, designed, flying_plant
    from synthesis import stability

    controller = designed(ideal, 8.0, 11.0)
    flies = symheli.TableController.of(controller.discretize(DT).model, 2)
    plant = flying_plant(ideal, 8.0, 11.0)
    wrong = with_scheduling_error(plant, flies, 2.5)
    assert stability(wrong, form=Spline(degree=0), search=None).verified
    for q in np.linspace(8.0, 11.0, 4):
        poles = np.linalg.eigvals(plant.close(flies.model.at(q)).matrices(np.linspace(8, 11, 9)).A)
        assert np.abs(poles).max() < 1
