"""Stability margins against closed forms, python-control, and the onset of instability itself."""

import math

import control
import numpy as np
import pytest

from symheli import LinearModel
from symheli.errors import InputError, UnknownNameError
from synthesis import disk_margin, margins
from synthesis.analysis import attitude_bandwidth, open_loop


def model(numerator, denominator, dt=None):
    return LinearModel.from_control(control.tf2ss(control.tf(numerator, denominator, dt or 0)))


def with_gain(L, k):
    return LinearModel(L.A, L.B, k * L.C, k * L.D, L.states, L.inputs, L.outputs, L.dt)


def closed(L):
    """State matrix under unit negative feedback (no feedthrough)."""
    return L.A - L.B @ L.C


def test_a_third_order_loop_has_its_textbook_margins():
    """L = 1/(s (s+1) (s+2)): gain margin 6 at sqrt(2) rad/s (Routh)."""
    L = model([1], [1, 3, 2, 0])
    m = margins(L)
    assert m.gain == pytest.approx((0.0, 6.0))
    w = m.crossover[0]
    assert abs(L.frequency_response([w])[0, 0, 0]) == pytest.approx(1, abs=1e-9)
    assert m.phase == pytest.approx(math.pi / 2 - math.atan(w) - math.atan(w / 2))
    assert m.delay == pytest.approx(m.phase / w)


def test_margins_without_the_disk_are_the_same_and_the_disk_is_not_known():
    L = model([1], [1, 3, 2, 0])
    whole, bare = margins(L), margins(L, disk=False)
    assert (bare.gain, bare.phase, bare.crossover) == (whole.gain, whole.phase, whole.crossover)
    assert math.isnan(bare.disk)
    assert all(map(math.isnan, (*bare.disk_gain, bare.disk_phase)))


def test_an_unstable_plant_has_a_lower_gain_margin_and_an_integrator_none():
    """L = k/(s - 1) needs k > 1; L = 1/s stands any gain, and 90 deg."""
    m = margins(model([4], [1, -1]))
    assert m.gain == pytest.approx((0.25, math.inf))
    single = margins(model([1], [1, 0]))
    assert single.gain == (0.0, math.inf)
    assert single.phase == pytest.approx(math.pi / 2)
    assert single.delay == pytest.approx(math.pi / 2)
    assert single.disk == pytest.approx(2.0)  # |1/(1+L) - 1/2| = 1/2 at every frequency


@pytest.mark.slow(only=("0", "1"))
@pytest.mark.parametrize("seed", range(8))
def test_margins_are_the_onset_of_instability(seed):
    """Random loops: inside the gain margins every gain is stable, just outside it is not;
    python-control finds the same phase.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    A = rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.3) * np.eye(n)
    L = LinearModel.from_control(
        control.ss(A, rng.standard_normal((n, 1)), rng.standard_normal((1, n)), [[0.0]])
    )
    m = margins(L)
    if not m.stable:
        assert np.linalg.eigvals(closed(L)).real.max() >= 0
        return
    low, high = m.gain
    for k in np.linspace(low * 1.001, min(high * 0.999, 50), 40):
        assert np.linalg.eigvals(closed(with_gain(L, k))).real.max() < 0
    for k in ([high * 1.001] if math.isfinite(high) else []) + ([low * 0.999] if low > 0 else []):
        assert np.linalg.eigvals(closed(with_gain(L, k))).real.max() > 0
    theirs = control.stability_margins(L.to_control())[1]
    if math.isfinite(m.phase):
        assert math.degrees(m.phase) == pytest.approx(abs(theirs), abs=0.01)
    peak = control.disk_margins(L.to_control(), np.geomspace(1e-3, 1e3, 2001))[0]
    assert m.disk == pytest.approx(
        peak, rel=1e-2
    )  # a grid of frequencies 0.7 % apart never finds less than the least
    assert m.disk <= peak * (1 + 1e-9)


def test_sampled_loops_become_unstable_at_their_margins():
    L = model([1], [1, 3, 2, 0]).discretize(0.2)
    m = margins(L)
    assert np.abs(np.linalg.eigvals(closed(with_gain(L, m.gain[1] * 0.999)))).max() < 1
    assert np.abs(np.linalg.eigvals(closed(with_gain(L, m.gain[1] * 1.001)))).max() > 1
    w = m.crossover[0]
    omega = np.linspace(0.9 * w, 1.1 * w, 4001)
    response = L.frequency_response(omega)[:, 0, 0]
    phase = control.stability_margins((np.abs(response), np.degrees(np.angle(response)), omega))[1]
    assert math.degrees(m.phase) == pytest.approx(phase, abs=0.01)
    assert m.delay == pytest.approx(m.phase / w)


def test_everything_inside_the_disk_is_stable():
    L = model([4], [1, 3, 2, 0])
    alpha = margins(L).disk
    for delta in 0.999 * alpha * np.exp(1j * np.linspace(0, np.pi, 25)):
        factor = (1 + delta / 2) / (1 - delta / 2)  # complex gain of the balanced disk
        omega = np.geomspace(1e-3, 1e2, 4000)
        assert np.abs(1 + factor * L.frequency_response(omega)[:, 0, 0]).min() > 1e-4
    assert margins(L).disk_gain[1] <= margins(L).gain[1]
    assert margins(L).disk_phase <= margins(L).phase


def test_an_unstable_loop_has_no_margin():
    m = margins(model([7], [1, 3, 2, 0]))
    assert not m.stable
    assert (m.phase, m.delay, m.disk) == (0.0, 0.0, 0.0)


def test_loops_are_broken_one_at_a_time():
    """The spinning satellite: each loop alone looks perfect, both at once do not (Doyle 1986; Zhou
    and Doyle, Essentials, sec. 8.6).
    """
    a = 10.0
    plant = LinearModel(
        np.array([[0, a], [-a, 0]]),
        np.eye(2),
        np.array([[1, a], [-a, 1]]),
        np.zeros((2, 2)),
        ("x1", "x2"),
        ("u1", "u2"),
        ("y1", "y2"),
    )
    feedback = {("u1", "y1"): -1.0, ("u2", "y2"): -1.0}
    alone = margins(open_loop(plant, feedback, "u1"))
    assert alone.gain == (0.0, math.inf)
    assert alone.disk == pytest.approx(2.0, rel=1e-6)  # L = 1/s
    both = LinearModel(
        plant.A, plant.B, plant.C, plant.D, plant.states, plant.inputs, plant.outputs
    )
    # |S - I/2| with S = s/(s+1) [..]: the multivariable disk is about a tenth of it
    assert disk_margin(both) < 0.25
    with pytest.raises(UnknownNameError):
        open_loop(plant, feedback, "u3")


def test_bandwidth_of_a_damped_response_behind_a_delay():
    """1/(s (s + a)) behind a lag of T: phase -90 - atan(w/a) - atan(w T)."""
    a, T = 8.0, 0.05
    response = attitude_bandwidth(model([1.0], np.polymul([1, a, 0], [T, 1])))
    w180 = math.sqrt(a / T)
    assert response.omega_180 == pytest.approx(w180)
    w135 = response.phase_bandwidth
    assert math.atan(w135 / a) + math.atan(w135 * T) == pytest.approx(math.pi / 4)
    lag = math.pi / 2 + math.atan(2 * w180 / a) + math.atan(2 * w180 * T) - math.pi
    assert response.phase_delay == pytest.approx(lag / (2 * w180))
    size = abs(1 / (1j * w180 * (1j * w180 + a) * (1j * w180 * T + 1)))
    w6 = response.gain_bandwidth
    assert abs(1 / (1j * w6 * (1j * w6 + a) * (1j * w6 * T + 1))) == pytest.approx(2 * size)
    turned = model([-1.0], np.polymul([1, a, 0], [T, 1]))
    assert attitude_bandwidth(turned) == pytest.approx(response)


def test_a_response_that_never_lags_180_degrees_has_no_such_frequency():
    response = attitude_bandwidth(model([1.0], [1, 2.0, 0]))
    assert math.isinf(response.omega_180)
    assert response.attitude_response == pytest.approx(2.0)  # atan(w/2) = 45 deg


def test_actuators_stand_in_series():
    plant = LinearModel.from_control(control.rss(3, 2, 2, strictly_proper=False))
    lag = LinearModel(
        [[-20.0]], [[20.0]], [[1.0]], [[0.0]], ("servo",), ("command",), ("deflection",)
    )
    w = np.array([0.3, 4.0, 30.0])
    name = str(plant.inputs[1])
    whole = plant.driven_by({name: lag}).frequency_response(w)
    alone = plant.frequency_response(w)
    np.testing.assert_allclose(whole[:, :, 0], alone[:, :, 0], rtol=1e-12)
    np.testing.assert_allclose(
        whole[:, :, 1], alone[:, :, 1] * (20 / (1j * w + 20))[:, None], rtol=1e-12
    )
    with pytest.raises(InputError, match="dt = None"):
        plant.driven_by({name: lag.discretize(0.1)})


def test_what_has_no_margin_is_refused():
    two = LinearModel.from_control(control.rss(2, 2, 2))
    with pytest.raises(InputError, match="one input and one output"):
        margins(two)
    with pytest.raises(InputError, match="one attitude"):
        attitude_bandwidth(two)
    direct = LinearModel.from_control(control.ss([[-1.0]], [[1.0]], [[1.0]], [[1.0]]))
    with pytest.raises(InputError, match="directly"):
        open_loop(
            direct, {(str(direct.inputs[0]), str(direct.outputs[0])): -1.0}, str(direct.inputs[0])
        )


def test_a_controller_that_is_a_gain_makes_the_loop_of_these_gains():
    """Two inputs, random plant: L broken at each, the other closed, by both routes."""
    rng = np.random.default_rng(0)
    A = rng.standard_normal((4, 4)) - 3 * np.eye(4)
    B, C, D = rng.standard_normal((4, 3)), rng.standard_normal((3, 4)), np.zeros((3, 3))
    plant = LinearModel(A, B, C, D, list("abcd"), list("uvw"), list("xyz"))
    K = rng.standard_normal((2, 2))
    gains = {(u, y): K[i, j] for i, u in enumerate("vu") for j, y in enumerate("zx")}
    empty = np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0))
    controller = LinearModel(*empty, K, [], list("zx"), list("vu"))
    omega = np.geomspace(0.1, 30, 7)
    for at in "uv":
        got, static = open_loop(plant, controller, at), open_loop(plant, gains, at)
        expected = static.frequency_response(omega)
        np.testing.assert_allclose(got.frequency_response(omega), expected, rtol=1e-9)


def test_a_loop_through_a_lag_has_its_closed_form():
    """1/s behind -k/(s T + 1): phase margin 90 deg - atan(w T) where w sqrt(1 + w^2 T^2) = k."""
    k, T = 3.0, 0.2
    plant = LinearModel([[0.0]], [[1.0]], [[1.0]], [[0.0]], ["y"], ["u"], ["y"])
    lag = LinearModel([[-1 / T]], [[1 / T]], [[-k]], [[0.0]], ["l"], ["y"], ["u"])
    w = math.sqrt((math.sqrt(1 + 4 * (k * T) ** 2) - 1) / (2 * T**2))
    m = margins(open_loop(plant, lag, "u"))
    assert m.crossover == pytest.approx((w,))
    assert m.phase == pytest.approx(math.pi / 2 - math.atan(w * T))
    assert m.gain == (0.0, math.inf)


def test_a_dynamic_controller_that_does_not_fit_is_refused():
    plant = LinearModel([[0.5]], [[1.0]], [[1.0]], [[0.0]], ["y"], ["u"], ["y"], dt=0.02)
    lag = LinearModel([[0.5]], [[1.0]], [[1.0]], [[0.0]], ["l"], ["y"], ["u"], dt=0.01)
    with pytest.raises(InputError, match=r"plant has dt = 0.02 and the controller dt = 0.01"):
        open_loop(plant, lag, "u")
    direct = LinearModel([[0.5]], [[1.0]], [[1.0]], [[0.1]], ["y"], ["u"], ["y"], dt=0.01)
    with pytest.raises(InputError, match="directly"):
        open_loop(direct, lag, "u")
    with pytest.raises(UnknownNameError):
        open_loop(plant, lag, "v")
