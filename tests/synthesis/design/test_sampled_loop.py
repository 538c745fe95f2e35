"""What flies is what is certified: the sampled plant under the table's own numbers."""

import math

import numpy as np
import pytest

import symheli
from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv.tools import Matrices
from symheli.lpv.uncertain_state_space import SAFETY
from synthesis import Plant, certify_sampled
from synthesis.forms import Spline

P = Scheduling("airspeed", "m/s", 0.0, 10.0, rate=1.0)
PLAIN = Spline(degree=0)
DT = 0.02


def roll(dt=DT, residual=0.0):
    """phi(k+1) = (0.9 + p/100) phi + 0.1 (w + d_lat), p from 0 to 10."""
    model = LPVStateSpace.polynomial(
        [[[0.9]], [[0.01]]],
        [[[0.1, 0.1]]],
        [[[1.0]]],
        [[[0.0, 0.0]]],
        P,
        dt,
        ("phi",),
        ("w", "d_lat"),
        ("phi",),
    )
    if residual:
        at = np.array([2.0, 7.0])
        A, B, C, D = model.matrices(at)
        model = model.with_residuals(at, Matrices(A + residual, B, C, D))
    return Plant(
        model, disturbances=["w"], performance=["phi"], controls=["d_lat"], measurements=["phi"]
    )


def table(gain=lambda p: -1.0 - p / 10, knots=(0.0, 10.0)):
    D = np.array([[[0.0, 0.0], [gain(p), 0.0]] for p in knots])[:, 1:]
    return symheli.TableController(knots, D, (), ("phi",), ("d_lat",), DT)


@pytest.mark.slow
def test_the_loop_is_that_of_the_numbers_of_32_bits():
    gain = -1.0 / 3.0
    flown = certify_sampled(table(lambda p: gain), roll(), form=PLAIN, search=None)
    rounded = float(np.float32(gain))
    assert flown.loop.at(10.0).A[0, 0] == pytest.approx(1.0 + 0.1 * rounded, abs=1e-15)
    assert abs(flown.loop.at(10.0).A[0, 0] - (1.0 + 0.1 * gain)) > 1e-10


def test_the_gain_is_the_known_one_and_the_loss_is_told():
    flown = certify_sampled(table(), roll(), promised=0.4, search=None)
    # the pole stays at 0.8: the gain is 0.1 / 0.2, to the solver's tolerance on its square
    assert flown.gamma == pytest.approx(0.5, rel=1e-4)
    assert flown.loss == pytest.approx(0.25, rel=1e-3)
    assert "25 % more" in str(flown)
    assert flown.certificate.verified


def test_an_unstable_loop_is_said_to_have_no_proof():
    flown = certify_sampled(table(lambda p: 1.0), roll(), promised=0.4, search=None)
    assert flown.gamma == math.inf
    assert flown.loss == math.inf
    assert "nothing is proven" in str(flown)


@pytest.mark.slow
def test_what_the_plant_misses_is_carried_through_the_proof():
    missed = 0.01
    plain = certify_sampled(table(), roll(residual=missed), cover=False, form=PLAIN, search=None)
    covered = certify_sampled(table(), roll(residual=missed), form=PLAIN, search=None)
    assert plain.misfit == 0.0
    assert covered.misfit == pytest.approx(missed)
    truth = 0.1 / (0.2 - SAFETY * missed)
    # a thousandth more: the cover holds the entry of the input too, by a millionth
    assert truth * (1 - 1e-9) <= covered.gamma < 1.001 * truth
    assert plain.gamma < covered.gamma


def test_a_performance_that_is_missed_too_is_refused():
    plant = roll()
    at = np.array([5.0])
    A, B, C, D = plant.model.matrices(at)
    off = plant.model.with_residuals(at, Matrices(A, B, C + 0.1, D))
    plant = Plant(off, plant.disturbances, plant.performance, plant.controls, plant.measurements)
    with pytest.raises(InputError, match="put what varies behind a state"):
        certify_sampled(table(), plant, search=None)


@pytest.mark.parametrize("unit", [1e-200, 1e-12, 1e-3, 1.0, 1e6, 1e12])
@pytest.mark.parametrize("of", ["C", "D"])
def test_a_missed_performance_is_refused_in_any_unit_and_beside_any_other(unit, of):
    """Of y, of which half is left out, beside z of size one, which is exact."""
    model = LPVStateSpace.polynomial(
        [[[0.9]], [[0.01]]],
        [[[0.1, 0.1]]],
        [[[unit], [1.0], [1.0]]],
        [[[unit, 0.0], [1.0, 0.0], [0.0, 0.0]]],
        P,
        DT,
        ("phi",),
        ("w", "d_lat"),
        ("y", "z", "phi"),
    )
    at = np.array([5.0])
    exact = model.matrices(at)
    more = getattr(exact, of) * np.array([[1.5], [1.0], [1.0]])
    off = model.with_residuals(at, exact._replace(**{of: more}))
    plant = Plant(
        off,
        disturbances=["w"],
        performance=["y", "z"],
        controls=["d_lat"],
        measurements=["phi"],
    )
    with pytest.raises(InputError, match="is also a fit"):
        certify_sampled(table(), plant, search=None)


def test_a_plant_in_continuous_time_is_refused():
    with pytest.raises(InputError, match="sampled\\(dt\\)"):
        certify_sampled({("d_lat", "phi"): -1.0}, roll(dt=None))
