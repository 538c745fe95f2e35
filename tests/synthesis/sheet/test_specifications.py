"""The specification sheet: measures against closed forms and slycot, Froude scaling, and what is
refused.
"""

import math
from dataclasses import replace

import control
import numpy as np
import pytest

import synthesis
from symheli import LinearFamily, LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.tools import sample_delay
from symheli.values import Signal
from synthesis.sheet.measures import (
    MEASURES,
    AxisLoop,
    first_order_fit,
    integral,
    mode_damping,
    rejection_bandwidth,
)
from synthesis.sheet.probed import probed
from synthesis.sheet.proven import prove
from synthesis.sheet.sheet import ControlAxis, Sheet, Specification

AXIS = ControlAxis(name="arm", control="u", response="y")
DISK = Specification(
    name="disk",
    axis="arm",
    measure="disk_phase",
    unit="deg",
    source="project target",
    length=1.0,
    sense="at least",
    level_1=40.0,
    level_2=20.0,
)


def spec(measure, **changes):
    return replace(DISK, measure=measure, name=measure, **changes)


def tf(numerator, denominator, dt=None):
    model = LinearModel.from_control(control.tf2ss(control.tf(numerator, denominator, dt or 0)))
    return replace(model, inputs=(Signal("u"),), outputs=(Signal("y"),))


def around(plant, gain=-1.0, **more):
    """The axis of u = gain (y - reference)."""
    K = LinearModel.gain([[gain]], plant.outputs, plant.inputs)
    return AxisLoop(plant=plant, controller=replace(K, dt=plant.dt), axis=AXIS, **more)


def value(measure, at, **changes):
    return MEASURES[measure](at, spec(measure, **changes))


def test_margins_of_a_second_order_loop_are_its_closed_forms():
    """L = w^2 / (s (s + 2 z w)): crossover w sqrt(sqrt(1 + 4 z^4) - 2 z^2), phase margin
    atan(2 z w / wc), delay margin phase / wc, no gain limit."""
    z, w = 0.6, 3.0
    at = around(tf([w**2], [1, 2 * z * w, 0]))
    crossover = w * math.sqrt(math.sqrt(1 + 4 * z**4) - 2 * z**2)
    phase = math.atan2(2 * z * w, crossover)
    assert value("crossover", at) == pytest.approx(crossover)
    assert value("phase_margin", at) == pytest.approx(math.degrees(phase))
    assert value("delay_margin", at) == pytest.approx(1e3 * phase / crossover)
    assert value("gain_margin", at) == math.inf
    # |S - 1/2| = 1/2 |1 - L| / |1 + L| largest over a dense grid: no grid finds more than the peak
    omega = np.geomspace(0.01, 100, 20001)
    L = at.plant.frequency_response(omega)[:, 0, 0]
    disk = 1 / np.abs(1 / (1 + L) - 0.5).max()
    assert value("disk_phase", at) == pytest.approx(math.degrees(2 * math.atan(disk / 2)), 1e-5)
    assert value("disk_gain", at) == pytest.approx(20 * math.log10((2 + disk) / (2 - disk)), 1e-4)


@pytest.mark.parametrize("k", [0.4, 3.0, 50.0])
@pytest.mark.parametrize("dt", [None, 1e-3])
def test_rejection_bandwidth_of_an_integrator(k, dt):
    """|S| of L = k/s is w / sqrt(w^2 + k^2): -3 dB at k / sqrt(10^.3 - 1), and no peak; sampled,
    z = exp(j w dt) in 1 / (1 + k dt / (z - 1)) instead.
    """
    at = around(tf([k], [1, 0]) if dt is None else tf([k * dt], [1, -1], dt))
    found = value("rejection_bandwidth", at)
    exact = k / math.sqrt(10**0.3 - 1)
    if dt is None:
        assert found == pytest.approx(exact, rel=1e-7)
        assert value("rejection_peak", at) == pytest.approx(0.0, abs=1e-6)
    else:
        z = np.exp(1j * found * dt)
        assert abs((z - 1) / (z - 1 + k * dt)) == pytest.approx(10 ** (-3 / 20), rel=1e-6)
        assert found == pytest.approx(exact, rel=0.05)  # half a sample at the fastest: k dt = .05


def test_a_loop_without_rejection_has_no_bandwidth():
    """|S| of L = .1 / (s + 1) is at least 1 / 1.1, above -3 dB everywhere."""
    assert value("rejection_bandwidth", around(tf([0.1], [1, 1]))) == 0.0


def test_rejection_is_the_lowest_rise_through_the_level():
    """S is above -3 dB at rest too where velocity is held: a washed-out loop, L = k s/((s + a)^2)
    ..., crosses downward first; the upward crossing is the one that counts.
    """
    at = around(tf([8.0, 0.0], [1, 0.2, 0.01]))
    found = value("rejection_bandwidth", at)
    S = at.rejection
    gains = np.abs(S.frequency_response([found * 0.99, found * 1.01, 1e-5])[:, 0, 0])
    assert gains[0] < 10 ** (-3 / 20) < gains[1]
    assert gains[2] == pytest.approx(1.0, abs=1e-2)


def test_sensitivity_peaks_are_those_of_slycot():
    pytest.importorskip("slycot")
    at = around(tf([9.0, 9.0], [1, 4, 2, 0]))
    S = control.feedback(1, control.ss(at.plant.to_control()))
    theirs = control.linfnorm(S, tol=1e-10)[0]
    for measure in ("input_peak", "rejection_peak"):
        # 20 log10 magnifies a relative error by 8.7; slycot's own tolerance is 1e-10
        assert value(measure, at) == pytest.approx(20 * math.log10(theirs), abs=1e-7)
    T = control.linfnorm(control.feedback(control.ss(at.plant.to_control()), 1), tol=1e-10)[0]
    assert value("response_peak", at) == pytest.approx(20 * math.log10(T), abs=1e-7)


def test_bandwidth_of_a_command_is_its_definition():
    """T = w^2 / (s^2 + 2 z w s + w^2) lags 135 deg where w_b^2 - 2 z w w_b - w^2 = 0 (tan 135 deg =
    -1); it never lags 180 deg, so it has neither phase delay nor gain limit.
    """
    z, w = 0.7, 4.0
    at = around(tf([w**2], [1, 2 * z * w, 0]))
    exact = z * w + math.sqrt(z**2 + 1) * w
    assert value("bandwidth", at) == pytest.approx(exact, rel=1e-6)
    assert math.isnan(value("phase_delay", at))


def test_phase_delay_of_a_late_response_is_its_definition():
    """T = a late copy of a first-order response: phase -w d - atan(w/a); tau_p =
    (phase at 2 w180 + 180 deg) / (2 w180), evaluated from the closed form.
    """
    dt, late, a = 0.01, 8, 3.0
    lag = tf([a], [1, a]).discretize(dt)
    T = lag.driven_by({"u": sample_delay("u", late, dt)})
    found = synthesis.analysis.attitude_bandwidth(T, (0.1, 80.0), command=True)

    def phase(w):
        z = np.exp(1j * w * dt)
        pole = math.exp(-a * dt)
        return np.angle((1 - pole) / (z - pole)) - late * w * dt

    assert phase(found.omega_180) == pytest.approx(-math.pi, abs=1e-6)
    twice = 2 * found.omega_180
    assert found.phase_delay == pytest.approx((-math.pi - phase(twice)) / twice, rel=1e-6)


@pytest.mark.parametrize("dt", [None, 0.02])
def test_the_integral_of_a_rate_lags_it_by_90_deg(dt):
    """1/jw in continuous time; by the trapezoidal rule a quarter turn too, whatever the gain."""
    rate = tf([5.0], [1, 5.0])
    rate = rate if dt is None else rate.discretize(dt)
    omega = np.array([0.3, 2.0, 20.0])
    ratio = (integral(rate).frequency_response(omega) / rate.frequency_response(omega))[:, 0, 0]
    assert np.angle(ratio) == pytest.approx(-math.pi / 2 * np.ones(3), abs=1e-9)
    assert np.abs(ratio) * omega == pytest.approx(
        np.ones(3), rel=0.02
    )  # (w dt)^2 / 12 at w dt = .4


@pytest.mark.parametrize("dt", [None, 0.01])
def test_damping_is_that_of_the_modes_that_are_seen(dt):
    """A mode of 3 rad/s and damping .3 beside one of .02 that the output hardly shows."""
    seen, hidden = control.tf([9], [1, 1.8, 9]), control.tf([1e-4 * 4], [1, 0.08, 4])
    T = LinearModel.from_control(control.tf2ss(seen + hidden))
    T = T if dt is None else T.discretize(dt)
    assert mode_damping(T, (0.0, 10.0)) == pytest.approx(0.3, abs=1e-6)
    assert mode_damping(T, (4.0, 10.0)) == 1.0
    loud = LinearModel.from_control(control.tf2ss(seen + 1e4 * hidden))
    assert mode_damping(loud, (0.0, 10.0)) == pytest.approx(0.02, abs=1e-6)


@pytest.mark.parametrize(("a", "tau"), [(0.4, 0.0), (2.0, 0.15), (0.0, 0.1)])
def test_the_first_order_fit_recovers_what_made_the_response(a, tau):
    t = np.linspace(0, 2.0, 201)
    after = np.maximum(t - tau, 0)
    y = 0.7 * (-np.expm1(-a * after) / a if a else after)
    found = first_order_fit(y, t)
    assert found == pytest.approx((a, tau), abs=2e-3)  # of a second: a fifth of a sample


def test_effort_and_rate_are_those_of_the_step():
    """u = -k (y - r) before 1/s: largest at the step, k; the command jumps by it in one sample."""
    dt, k, travel, limit = 0.02, 4.0, 8.0, 100.0
    at = around(tf([dt], [1, -1], dt), -k, travel=travel, rate_limit=limit)
    assert value("effort", at) == pytest.approx(100 * k / travel)
    assert value("servo_rate", at) == pytest.approx(100 * k / dt / limit)
    assert value("quickness", at) == pytest.approx(k, rel=1e-3)  # peak of the rate: first sample


def test_froude_scaling_is_exact():
    """N = 4: times half as long, frequencies twice as high, speeds half, lengths a quarter, margins
    and ratios unchanged.
    """
    every = {"time": 0.5, "frequency": 2.0, "speed": 0.5, "length": 0.25, "none": 1.0}
    for scaled, factor in every.items():
        small = spec("coupling", scaled=scaled, length=4.0, window=3.0).at_length(1.0)
        assert small.level_1 == 40.0 * factor
        assert small.level_2 == 20.0 * factor
        assert small.window == 1.5
        assert small.design_margin(40.0 * factor) == 0.0
        assert small.design_margin(20.0 * factor) == -100.0
    sheet = Sheet.load()
    full = sheet.of("heave", "equivalent delay").length
    assert math.sqrt(full / 0.775) == pytest.approx(3.25, abs=0.01)  # UH-60 to X-Cell


def test_the_packaged_sheet_keeps_its_promises():
    """Every entry has a source or the words "not confirmed", which do not count; at least ten of an
    axis count and 17 stand there.
    """
    sheet = Sheet.load()
    for axis in ("roll", "pitch", "yaw", "heave"):
        own = [s for s in sheet.specifications if s.axis == axis]
        assert 17 <= len(own) <= 24
        assert sum(s.counts for s in own) >= 10
        for s in own:
            assert s.source
            assert s.counts != (s.source == "not confirmed" or bool(s.other_task))
            assert s.kind == "flown" or s.measure in MEASURES


def cart(low=0.0, high=1.0):
    p = Scheduling("p", "1", low, high)
    return LPVStateSpace.polynomial(
        [[[0.0]]], [[[1.0]], [[1.0]]], [[[1.0]]], [[[0.0]]], p, inputs=("u",), outputs=("y",)
    )


def sheet_of(*measures, **changes):
    return Sheet(
        title="arm",
        axes={"arm": AXIS},
        specifications=tuple(spec(m, **changes) for m in measures),
    )


def test_the_worst_value_is_found_and_where():
    """3 (1 + p) / s: rejection bandwidth 3 (1 + p) / sqrt(10^.3 - 1), least at p = 0."""
    sheet = sheet_of("rejection_bandwidth", level_1=6.0, level_2=3.0)
    table = synthesis.specifications(cart(), {"P": {("u", "y"): -3.0}}, sheet, at=[0, 0.5, 1])
    exact = 3 * np.array([1, 1.5, 2]) / math.sqrt(10**0.3 - 1)
    assert table.over("P", "arm", "rejection_bandwidth") == pytest.approx(exact, rel=1e-7)
    mark = table.mark("P")
    assert (mark.at, mark.value) == (0.0, pytest.approx(exact[0]))
    assert mark.margin == pytest.approx(100 * (exact[0] - 6) / 3)


def test_an_unstable_loop_fails_whatever_else_it_does():
    table = synthesis.specifications(
        cart(-2.0, 1.0), {"P": {("u", "y"): -3.0}}, sheet_of("disk_phase"), at=[-2.0, 0.0]
    )
    assert table.mark("P").margin == -math.inf
    assert table.mark("P").at == -2.0
    assert "unstable at 1 of 2" in table.verdict("P")


class PI:
    """u = -2 e - 1.5 dt sum e, as somebody else writes it."""

    dt = 0.02

    def reset(self):
        self.sum = 0.0

    def step(self, measured, reference, p):
        e = measured["y"] - reference["y"]
        self.sum += 1.5 * self.dt * e
        return np.array([-2.0 * e - self.sum])


def test_a_controller_that_is_only_asked_becomes_its_linear_model():
    dt = PI.dt
    plant = tf([1.0], [1, 1]).discretize(dt)
    found = probed(PI(), plant.outputs, plant.inputs, Signal("p", "1"), 0.0)
    omega = np.array([0.1, 1.0, 30.0])
    z = np.exp(1j * omega * dt)
    exact = -2.0 - 1.5 * dt * z / (z - 1)
    assert len(found.states) == 1
    assert found.frequency_response(omega)[:, 0, 0] == pytest.approx(exact, rel=1e-6)
    same = LinearModel([[1.0]], [[1.5 * dt]], [[-1.0]], [[-2.0 - 1.5 * dt]], "x", "y", "u", dt)
    family = LinearFamily.from_models([0.0, 1.0], [tf([1.0], [1, 1]), tf([2.0], [1, 1])])
    tables = [
        synthesis.specifications(family, {"PI": K}, sheet_of("disk_phase", "rejection_peak"))
        for K in (PI(), same)
    ]
    assert tables[0].values["PI"] == pytest.approx(tables[1].values["PI"], abs=1e-5)


def test_a_controller_with_a_limit_within_the_pulse_is_refused():
    class Dead(PI):
        def step(self, measured, reference, p):
            return np.clip(super().step(measured, reference, p), -1e-4, 1e-4)

    plant = tf([1.0], [1, 1]).discretize(PI.dt)
    with pytest.raises(InputError, match="not linear around rest"):
        probed(Dead(), plant.outputs, plant.inputs, Signal("p", "1"), 0.0)


@pytest.mark.parametrize(
    "measure",
    [
        "disk_phase",
        pytest.param("input_peak", marks=pytest.mark.slow),
        pytest.param("rejection_peak", marks=pytest.mark.slow),
    ],
)
def test_what_is_proven_is_no_better_than_the_worst_frozen_value(measure):
    """1/(s (s + 1 + p)) with gain 2, held at every p: the proof is above every frozen peak, and
    within 1 % of the largest.
    """
    p = Scheduling("p", "1", 0.0, 1.0)
    arm = LPVStateSpace.polynomial(
        [[[-1.0, 0.0], [1.0, 0.0]], [[-1.0, 0.0], [0.0, 0.0]]],
        [[[1.0], [0.0]]],
        [[[0.0, 1.0]]],
        [[[0.0]]],
        p,
        inputs=("u",),
        outputs=("y",),
    )
    K = LinearModel.gain([[-2.0]], ("y",), ("u",))
    one = (
        spec(measure)
        if measure == "disk_phase"
        else spec(measure, sense="at most", level_1=6.0, level_2=9.0)
    )
    proof = prove(arm, K, one, AXIS)
    table = synthesis.specifications(arm, {"P": K}, replace(sheet_of(), specifications=(one,)))
    worst = table.mark("P")
    assert proof.certificate.verified
    assert proof.margin <= worst.margin + 1e-6
    assert proof.value == pytest.approx(worst.value, rel=0.01)


def test_what_cannot_be_evaluated_is_refused_in_words(tmp_path):
    gain = {("u", "y"): -3.0}
    other = replace(sheet_of("damping"), axes={"arm": replace(AXIS, control="d_lat")})
    with pytest.raises(InputError, match="none of the axes"):
        synthesis.specifications(cart(), {"P": gain}, other)
    with pytest.raises(UnknownNameError, match="damping"):
        synthesis.specifications(cart(), {"P": gain}, sheet_of("dampin"))
    with pytest.raises(InputError, match="wrong side"):
        spec("damping", sense="at most")
    with pytest.raises(InputError, match="needs its boundaries"):
        spec("damping", sense="", level_1=math.nan, level_2=math.nan)
    with pytest.raises(InputError, match="over one parameter"):
        synthesis.specifications(tf([1], [1, 1]), {"P": gain}, sheet_of("damping"))
    (tmp_path / "no.toml").write_text("[[specification]]\nname = 1\n")
    with pytest.raises(InputError, match="an entry of the sheet is wrong"):
        Sheet.load(tmp_path / "no.toml")
    with pytest.raises(InputError, match=r"no\.such"):
        Sheet.load(tmp_path / "no.such")
    with pytest.raises(UnknownNameError, match="rol"):
        Sheet.load().select(["rol"])


def test_rejection_bandwidth_needs_no_grid():
    """A narrow dip below -3 dB, 1e-3 wide, is found."""
    S = LinearModel.from_control(control.tf2ss(control.tf([1, 1e-4, 4], [1, 1e-3, 4])))
    found = rejection_bandwidth(S)
    gain = abs(S.frequency_response([found])[0, 0, 0])
    assert gain == pytest.approx(10 ** (-3 / 20), rel=1e-4)
    assert 2.0 < found < 2.001


def test_a_picture_has_a_mark_an_airspeed_in_the_shades_of_the_levels():
    sheet = sheet_of("rejection_bandwidth", level_1=6.0, level_2=3.0)
    table = synthesis.specifications(cart(), {"P": {("u", "y"): -3.0}}, sheet, at=[0, 0.5, 1])
    ax = table.plot("arm")
    marks = np.concatenate(
        [one.get_offsets() for one in ax.collections if len(one.get_offsets()) == 3]
    )
    exact = 100 * (3 * np.array([1, 1.5, 2]) / math.sqrt(10**0.3 - 1) - 6) / 3
    assert np.asarray(marks)[:, 0] == pytest.approx(np.minimum(exact, 100))
    assert len(ax.patches) == 3
    with pytest.raises(InputError, match="no frozen specification"):
        table.plot("leg")
