"""Every way of forgetting stays awake through a long silence, follows a jump, and says what is wrong with its options."""

import functools

import numpy as np
import pytest
from known_systems import Truth, moving, structure

import identification as idn
from identification import kernel
from symheli.errors import InputError

WAYS = {
    "constant": idn.Constant(0.99),
    "variable": idn.Variable(longest=1000, shortest=30),
    "directional": idn.Directional(0.9),
}
SILENCE = 100_000 if kernel.compiled_kernel("double") else 3_000


def rows(record):
    return np.column_stack([record["y"], record["u"], record["p"]])


@pytest.mark.parametrize(("way", "noise"), [*((way, noise) for way in WAYS for noise in (0.0, 1e-7)), ("directional", 1e-3)])
def test_nothing_winds_up_when_excitation_stops(way, noise):
    """Noise of 1e-3 of the excitation: a floor of 1e-3 samples lets it through within 1000 samples, no direction forgets for it."""
    truth = Truth(structure())
    online = idn.RecursiveLeastSquares(truth.arx, WAYS[way]).online()
    online.run(rows(truth.record(moving(600), noise=0.01)), history=False)
    before = online.state
    rng = np.random.default_rng(0)
    silent = np.column_stack([noise * rng.normal(size=(SILENCE, 2)), np.full(SILENCE, 6.0)])
    silent[0] = np.nan  # the plant does not jump, the record does
    online.run(silent, history=False)
    after, n = online.state, truth.arx.n_regressors
    size = np.abs(truth.theta).max()
    # what the noise can move: r^2 of the largest regressors, 1e5 samples, over 1e-3 samples at the floor is 1e-6 for r = 1e-7;
    # where nothing is forgotten, over some 10 samples for r = 1e-3, 1e-2
    np.testing.assert_allclose(after.theta, before.theta, rtol=0, atol=0.02 * size)
    information = [np.linalg.svd(s.factor[:n, :n] / s.peak, compute_uv=False) for s in (before, after)]
    assert information[1].min() > 0.99 * min(np.sqrt(1e-3), information[0].min())  # the floor, or what was there
    assert information[1].max() < 1.01 * information[0].max()
    assert after.determined
    other = Truth(truth.arx, seed=7)
    online.run(rows(other.record(moving(1500), noise=0.01, seed=5)), history=False)
    # it learns another plant within 1500 samples, the noise of 0.01 remains; by directions it takes longer where excitation is weak
    np.testing.assert_allclose(online.coefficients, other.theta, rtol=0, atol=(0.2 if way == "directional" else 0.02) * size)


def test_silence_of_exactly_zero_costs_no_time_and_no_digit_underflows():
    """Information that decays towards 1e-308 would make every operation a hundred times slower; the floor and a cut prevent it."""
    truth = Truth(structure())
    online = idn.RecursiveLeastSquares(truth.arx, 0.9).online()
    online.run(rows(truth.record(moving(300))), history=False)
    online.run(np.tile([0.0, 0.0, 6.0], (SILENCE, 1)), history=False)
    memory = np.abs(online.state.memory)
    assert memory[memory > 0].min() > 1e-295
    assert np.isfinite(memory).all()


@functools.cache
def flights():
    """One plant for 2000 samples, then another for 1000; their coefficients."""
    first, second = Truth(structure(), seed=0), Truth(structure(), seed=1)
    return rows(first.record(moving(2000), noise=0.02)), first.theta, rows(second.record(moving(1000), noise=0.02, seed=3)), second.theta


def error_after_jump(way, after):
    before, old, rest, new = flights()
    online = idn.RecursiveLeastSquares(structure(), way).online()
    online.run(before, history=False)
    settled = np.abs(online.coefficients - old).max()
    online.run(rest[:after], history=False)
    return settled, np.abs(online.coefficients - new).max()


@pytest.mark.parametrize("way", WAYS)
def test_a_jump_of_the_plant_is_followed(way):
    settled, followed = error_after_jump(WAYS[way], 1000)
    assert settled < 0.05
    assert followed < 0.05


def test_variable_forgetting_is_steady_and_quick_at_once():
    """Before the jump better than a short memory, soon after it better than a long one."""
    variable = error_after_jump(idn.Variable(longest=1000, shortest=30), 250)
    short, long = error_after_jump(idn.Constant(1 - 1 / 60), 250), error_after_jump(idn.Constant(1 - 1 / 1000), 250)
    assert variable[0] < 0.7 * short[0]
    assert variable[1] < 0.2 * long[1]


def test_what_never_moves_again_is_remembered_by_directional_forgetting_alone():
    """After a transition in p, hover: the slope over p is kept to the digit where the window has long passed."""
    truth = Truth(structure(basis=idn.Polynomial(1, 0.0, 13.0)))
    kept = {}
    for name, way in (("constant", idn.Constant(0.98, floor=0.0)), ("directional", idn.Directional(0.98))):
        online = idn.RecursiveLeastSquares(truth.arx, way).online()
        online.run(rows(truth.record(moving(400), noise=0.01)), history=False)
        online.run(rows(truth.record(np.full(1000, 2.0), noise=0.01, seed=4)), history=False)
        n = truth.arx.n_regressors
        kept[name] = np.linalg.svd(online.state.factor[:n, :n], compute_uv=False).min()
    assert kept["directional"] > 1.0
    assert kept["constant"] < 1e-3


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: idn.Constant(0.0), r"factor in \(0, 1\]"),
        (lambda: idn.Constant(0.9, floor=-1), "floor: expected a number of samples"),
        (lambda: idn.Constant(0.9, floor=np.inf), "floor"),
        (lambda: idn.Variable(longest=10, shortest=20), "shortest <= longest"),
        (lambda: idn.Variable(longest=np.nan), "longest: expected a number of samples > 1"),
        (lambda: idn.Directional(1.5), "factor"),
        (lambda: idn.Directional(0.9, quiet=1.0), "quiet"),
        (lambda: idn.RecursiveLeastSquares(structure(), idn.Directional(), floor=0.1), "belongs to a forgetting factor"),
        (lambda: idn.RecursiveLeastSquares(structure(), "slow"), "expected a factor, Constant, Variable or Directional"),
        (lambda: idn.RecursiveLeastSquares(structure(), precision="half"), "precision"),
    ],
)
def test_options_out_of_range_are_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()
