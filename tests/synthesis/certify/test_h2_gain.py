"""H2 norm of LPV models: against Gramians, against the energy-to-peak gain, along trajectories."""

import math

import numpy as np
import pytest
from scipy import linalg

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from synthesis import Certificate, h2_gain
from synthesis.analysis import energy_to_peak
from synthesis.design.lti.h2 import h2_norm
from synthesis.forms import Spline

p = Scheduling("p", "1", 0.0, 1.0, rate=0.3)


def spring(outputs=2, dt=None):
    """A spring that softens with p, or a sampled lag; two inputs, these many outputs."""
    if dt is None:
        A = [[[0.0, 1.0], [-1.0, -0.4]], [[0.0, 0.0], [0.6, 0.0]]]
        D = [[[0.0, 0.0]] * outputs]
    else:
        A = [[[0.5, 0.2], [-0.1, 0.8]], [[0.0, 0.0], [0.1, 0.0]]]
        D = [[[0.1, 0.0], [0.0, 0.3]][:outputs]]
    B, C = [[[0.0, 1.0], [1.0, 0.0]]], [[[1.0, 0.0], [0.5, 1.0]][:outputs]]
    return LPVStateSpace.polynomial(A, B, C, D, p, dt=dt)


@pytest.mark.parametrize("dt", [None, 0.1])
def test_at_rest_it_is_the_worst_norm_of_the_frozen_models(dt):
    model = spring(dt=dt)
    worst = max(h2_norm(model.at(q)) for q in np.linspace(0.0, 1.0, 101))
    cert = h2_gain(model, 0.0, search=None)
    # P of degree 2 in p, and the loosenings of the proof
    assert worst * (1 - 1e-9) <= cert.gamma <= 1.005 * worst
    assert cert.frozen == pytest.approx(worst, rel=1e-6)


@pytest.mark.slow
def test_of_one_output_it_is_the_energy_to_peak_gain():
    form = Spline(degree=2, segments=1)
    one = spring(outputs=1)
    found = [of(one, form=form, search=None).gamma for of in (h2_gain, energy_to_peak)]
    assert found[0] == pytest.approx(found[1], rel=1e-4)  # two programs, each to 1e-5 or so


@pytest.mark.slow
def test_it_lies_between_the_largest_direction_and_the_sum_of_the_outputs():
    model = spring()
    each = [h2_gain(model.select(outputs=[y]), search=None).gamma for y in model.outputs]
    found = h2_gain(model, search=None).gamma
    assert energy_to_peak(model, search=None).gamma < found <= 1.001 * math.hypot(*each)


@pytest.mark.slow
def test_the_variance_along_a_trajectory_stays_below_it():
    """dQ/dt = A Q + Q A' + B B' by small steps of the exponential, p up and down at full rate."""
    model, step = spring(), 0.02
    Q, worst = np.zeros((2, 2)), 0.0
    for k in range(6000):
        phase = (k * step * p.rate) % 2.0
        A, B, C, _ = model.matrices(min(phase, 2.0 - phase))
        whole = linalg.expm(step * np.block([[-A, B @ B.T], [np.zeros((2, 2)), A.T]]))
        Phi = whole[2:, 2:].T
        Q = Phi @ Q @ Phi.T + Phi @ whole[:2, 2:]
        worst = max(worst, float(np.trace(C @ Q @ C.T)))
    cert = h2_gain(model)
    assert math.sqrt(worst) <= cert.gamma
    assert cert.lower <= cert.gamma <= 1.1 * cert.lower


def test_its_proof_is_exact_and_saved(tmp_path):
    cert = h2_gain(spring(), form=Spline(degree=1, segments=1), search=None)
    cert.save(tmp_path / "proof.json")
    again = Certificate.load(tmp_path / "proof.json")
    assert again.kind == "h2 gain"
    assert again.verify(rigorous=True)
    assert "white noise of unit intensity" in str(again.hypotheses)


def test_feedthrough_is_refused():
    model = LPVStateSpace.polynomial([[[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.5]]], p)
    with pytest.raises(InputError, match="the h2 gain of a continuous model needs D = 0"):
        h2_gain(model)
