"""Box-Jenkins and ARMAX: the noise model, and predictions that go on with it."""

import numpy as np
import pytest
from scipy.signal import lfilter

import identification as idn
from evidence.box_jenkins import METHODS, STRUCTURE, TRUE, of_seed, record
from identification.model.noise_model import NoiseModel
from symheli import FlightRecord
from symheli.errors import InputError

PLANT = idn.LPVARX("y", "u", na=1, nb=1, delay=1)


def flown(enters, n=2000, seed=0):
    """y(k) = .8 y(k-1) + u(k-1) with (1 + .5 q^-1)/(1 - .9 q^-1) e, at the output or in the
    equation.
    """
    rng = np.random.default_rng(seed)
    u, e = rng.normal(size=n), 0.1 * rng.normal(size=n)
    v, one = lfilter([1.0, 0.5], [1.0, -0.9], e), lfilter([0.0, 1.0], [1.0, -0.8], u)
    y = one + v if enters == "output" else one + lfilter([1.0], [1.0, -0.8], v)
    return FlightRecord.from_arrays(np.arange(n) * 1.0, {"y": "1", "u": "1"}, y=y, u=u), e


METHOD = {"output": idn.methods.BoxJenkins(ar=1, ma=1), "equation": idn.methods.ARMAX(ar=1, ma=1)}


@pytest.mark.parametrize("enters", METHOD)
def test_plant_and_colour_are_found_and_white_noise_is_left(enters):
    flight, e = flown(enters)
    found = idn.fit(PLANT, flight, METHOD[enters])
    # standard errors of 2000 samples: .02 for the noise, less for the plant
    assert found.theta[0, 0] == pytest.approx(-0.8, abs=0.02)
    assert found.noise.ar[0, 0] == pytest.approx(-0.9, abs=0.05)
    assert found.noise.ma[0, 0] == pytest.approx(0.5, abs=0.08)
    left = flight["y"] - found.predict(flight, 1)[:, 0]
    assert np.nanstd(left[50:]) == pytest.approx(e.std(), rel=0.05)
    assert idn.residual_analysis(found, flight.rows(slice(50, None))).portmanteau[0] > 0.01


@pytest.mark.parametrize("enters", METHOD)
def test_predictions_ahead_are_conditional_means(enters):
    """With the true noise the error h steps ahead has the variance of the first h impulses of what
    e does to y: by the response of the whole, not by the recursion.
    """
    flight, e = flown(enters, n=4000)
    found = idn.fit(PLANT, flight, METHOD[enters])
    impulse = lfilter([1.0, 0.5], [1.0, -0.9], np.eye(1, 8)[0])
    if enters == "equation":
        impulse = lfilter([1.0], [1.0, -0.8], impulse)
    for horizon in (1, 2, 5):
        error = flight["y"] - found.predict(flight, horizon)[:, 0]
        expected = np.sqrt(np.sum(impulse[:horizon] ** 2)) * e.std()
        # 4000 samples, correlated over h: 1.1 % to 2.5 %
        assert np.nanstd(error[100:]) == pytest.approx(expected, rel=0.06)


def test_the_model_is_saved_with_its_noise(tmp_path):
    flight, _ = flown("output", n=300)
    found = idn.fit(PLANT, flight, METHOD["output"])
    again = idn.model.LPVARXModel.load(found.save(tmp_path / "bj.json"))
    np.testing.assert_array_equal(again.predict(flight, 3), found.predict(flight, 3))
    with pytest.raises(InputError, match="hold_p"):
        found.predict(flight, 3, hold_p=True)


def test_zeros_outside_the_unit_circle_are_mirrored():
    """1 + 2 q^-1 and 1 + .5 q^-1 have one spectrum; only the second is invertible."""
    rng = np.random.default_rng(0)
    v = lfilter([1.0, 2.0], [1.0], rng.normal(size=20000))[:, None]
    found = NoiseModel.of([v], 0, 1)
    assert found.stable
    assert found.ma[0, 0] == pytest.approx(0.5, abs=0.05)
    with pytest.raises(InputError, match="enters"):
        NoiseModel([[0.1]], [[0.2]], "state")


@pytest.mark.slow
def test_the_lpv_box_jenkins_system_is_reproduced():
    """a1 at p = .5 is .725; least squares and ARMAX are biased. Scatter of one flight: .02."""
    found = [of_seed(seed) for seed in range(2)]
    at = {n: np.mean([one[n][0] @ [1.0, 0.5, 0.25] for one in found]) for n in METHODS}
    assert at["Box-Jenkins, noise of order 2"] == pytest.approx(0.725, abs=0.03)
    assert abs(at["least squares"] - 0.725) > 0.1
    noise = idn.fit(STRUCTURE, record(0), METHODS["Box-Jenkins, noise of order 2"]).noise
    np.testing.assert_allclose(noise.ar[0], [-1.0, 0.2], atol=0.05)
    assert TRUE[0] @ [1.0, 0.5, 0.25] == pytest.approx(0.725)
