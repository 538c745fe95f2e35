"""Operators: systems are multiplied and added like the matrices of their inputs and outputs."""

from dataclasses import replace
from functools import partial

import control
import numpy as np
import pytest
from families import random_lpv

from symheli import LFT, LinearModel, LPVStateSpace, UncertainStateSpace
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import append, feedback, parallel, series
from symheli.values import NamedVector, OperatingPoint, Signal

POINTS = np.array([0.0, 0.3 + 0.2j, -0.1 + 2j, 5j, 40.0])
"""s, or z, where no pole of the systems below is."""


def linear(seed, nu=2, ny=2, dt=None, names="xuy"):
    """Random, stable: poles about -3, or about 1/4 of a sampled one."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(3, 3)) - 4 * np.eye(3)
    A = A if dt is None else 0.1 * A
    sizes = (A, rng.normal(size=(3, nu)), rng.normal(size=(ny, 3)), rng.normal(size=(ny, nu)))
    own = ([f"{c}{seed}{i}" for i in range(n)] for c, n in zip(names, (3, nu, ny), strict=True))
    return LinearModel(*sizes, *own, dt=dt)


def values(system):
    """The transfer matrix by python-control, points first."""
    system = system.to_control() if isinstance(system, LinearModel) else system
    return np.moveaxis(np.atleast_3d(system(POINTS, squeeze=False)), -1, 0)


def named(system):
    return [str(u) for u in system.inputs], [str(y) for y in system.outputs]


@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize(
    "build",
    [
        lambda P, Q: P * Q,
        lambda P, Q: P + Q,
        lambda P, Q: P - Q,
        lambda P, Q: -P,
        lambda P, Q: 2.5 * P - Q * 0.5 + P / 4,
        lambda P, Q: np.array([[1.0, -2.0]]) * P * Q,
        lambda P, Q: P * np.array([[1.0], [3.0]]),
        lambda P, Q: P + np.eye(2) - Q * P,
        lambda P, Q: np.eye(2) - P,
        lambda P, Q: np.float64(3.0) * P,
        lambda P, Q: P[1, 0],
    ],
)
def test_linear_models_are_joined_as_python_control_joins_them(build, dt):
    P, Q = linear(1, dt=dt), linear(2, dt=dt)
    found, expected = build(P, Q), build(P.to_control(), Q.to_control())
    assert isinstance(found, LinearModel)
    assert found.dt == dt
    np.testing.assert_allclose(found(POINTS), values(expected), rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("sign", [1, -1])
def test_feedback_of_either_sign_is_that_of_python_control(sign, dt):
    P, K = linear(1, dt=dt), 0.1 * linear(2, dt=dt)
    expected = control.feedback(P.to_control(), K.to_control(), sign=sign)
    np.testing.assert_allclose(feedback(P, K, sign=sign)(POINTS), values(expected), rtol=1e-10)
    if sign == -1:  # the default there
        same = control.feedback(P.to_control(), K.to_control())
        np.testing.assert_allclose(feedback(P, K, -1)(POINTS), values(same), rtol=1e-10)


@pytest.mark.parametrize("sign", [None, 0, -2, "negative"])
def test_feedback_without_a_sign_shows_both_calls(sign):
    with pytest.raises(InputError) as told:
        feedback(linear(1), linear(2), *([] if sign is None else [sign]))
    for call in ("feedback(P, K, sign=+1)", "feedback(P, K, sign=-1)", "control.feedback(P, K)"):
        assert call in str(told.value)


def test_the_methods_named_feedback_close_positive_loops():
    P = linear(1, 1, 1)
    loop = P.feedback({("u10", "y10"): 0.3})
    np.testing.assert_allclose(loop(POINTS), feedback(P, 0.3, sign=+1)(POINTS), rtol=1e-12)


@pytest.mark.parametrize("of_lft", [False, True])
@pytest.mark.parametrize(
    "build",
    [
        lambda P, Q, L: P * L,
        lambda P, Q, L: L * P,
        lambda P, Q, L: P * Q,
        lambda P, Q, L: P + L - Q,
        lambda P, Q, L: L + P,
        lambda P, Q, L: -P * 2 + np.ones((2, 2)),
        lambda P, Q, L: np.ones((1, 2)) * P[["y2", "y1"], "u1"],
        lambda P, Q, L: P[:, "u2"] - 3 * Q[:, 1],
    ],
)
def test_models_in_p_are_joined_as_their_frozen_models_are(build, of_lft):
    P, Q = (random_lpv(2, ny=2, seed=seed)[0] for seed in (0, 1))
    L = linear(5)
    if of_lft:
        P, Q = P.to_lft().reduce(), Q.to_lft().reduce()
    found = build(P, Q, L)
    assert type(found) is type(P)
    for p in (0.5, 4.2, 11.0):
        expected = build(P.at(p), Q.at(p), L)
        np.testing.assert_allclose(found.at(p)(POINTS), expected(POINTS), rtol=1e-8, atol=1e-10)
        assert named(found) == named(expected)


def test_kinds_and_systems_of_python_control_mix():
    P, L = random_lpv(2, nu=1, ny=1)[0], linear(5, 1, 1)
    C, T = L.to_control(), control.tf([1.0], [1.0, 3.0])
    assert isinstance(P.to_lft() * P, LFT)
    assert isinstance(P * L, LPVStateSpace)
    for found, expected in (
        (L * C, L * L),
        (C * L, L * L),
        (L + C, L + L),
        (C - 2 * L, L - 2 * L),
        (T * L, LinearModel.from_control(T) * L),
        (L - T, L - LinearModel.from_control(T)),
        (T * P, LinearModel.from_control(T) * P),
        (C * P + T, L * P + LinearModel.from_control(T)),
    ):
        a, b = (m if isinstance(m, LinearModel) else m.at(4.2) for m in (found, expected))
        np.testing.assert_allclose(a(POINTS), b(POINTS), rtol=1e-10, atol=1e-12)


def test_names_follow():
    P, K = linear(1, nu=2, ny=3), linear(2, nu=1, ny=2)
    assert named(P * K) == (["u20"], ["y10", "y11", "y12"])
    assert named(P + linear(3, nu=2, ny=3)) == named(P)
    assert named(linear(3, nu=2, ny=3) - P) == named(linear(3, nu=2, ny=3))
    for same in (-P, 2 * P, P * 2, P / 2, +P, P + np.ones((3, 2)), np.ones((3, 2)) - P):
        assert named(same) == named(P)
    assert named(np.ones((2, 3)) * P) == (["u10", "u11"], ["y1", "y2"])
    assert named(P["y12", "u11"]) == (["u11"], ["y12"])
    assert named(P[["y12", "y10"], :]) == (["u10", "u11"], ["y12", "y10"])
    assert named(P[1:, -1]) == (["u11"], ["y11", "y12"])
    units = replace(P, outputs=[Signal("phi", "rad"), Signal("p", "rad/s"), Signal("v", "m/s")])
    assert [y.unit for y in (-units * K).outputs] == ["rad", "rad/s", "m/s"]


def test_an_array_without_axes_is_a_number():
    P = linear(1, nu=2, ny=3)
    for same in (np.array(6.0) * P, P * np.array(3.0) * np.int64(2)):
        np.testing.assert_allclose(same(POINTS), 6 * P(POINTS), rtol=1e-13)


def test_a_sum_of_many_is_that_of_the_builtin_function():
    P, Q = linear(1), linear(2)
    np.testing.assert_allclose(sum([P, Q])(POINTS), (P + Q)(POINTS), rtol=1e-13)


def test_a_sign_or_a_size_keeps_the_operating_point_and_every_bit():
    P = linear(1)
    x, u = NamedVector(P.states, np.ones(3)), NamedVector(P.inputs, np.ones(2))
    point = OperatingPoint(x=x, u=u, xdot=x)
    P = replace(P, point=point)
    assert (-P).point is point
    assert np.array_equal((-P).C, -P.C)
    assert np.array_equal((2 * P).A, P.A)
    assert not np.any(np.signbit((-replace(P, D=np.zeros((2, 2)))).D))


@pytest.mark.parametrize("dt", [None, 0.1])
def test_a_transfer_matrix_at_a_point_is_that_of_python_control(dt):
    P = linear(4, nu=3, ny=2, dt=dt)
    assert P(2.0).shape == (2, 3)
    assert P(POINTS.reshape(5, 1)).shape == (5, 1, 2, 3)
    np.testing.assert_allclose(P(POINTS), values(P), rtol=1e-11)
    omega = np.array([0.3, 7.0])
    s = 1j * omega if dt is None else np.exp(1j * omega * dt)
    np.testing.assert_array_equal(P(s), P.frequency_response(omega))
    np.testing.assert_array_equal(P(np.inf), P.D)
    np.testing.assert_allclose(P([np.inf, 1.0])[1], P(1.0))


def test_at_a_pole_there_is_no_value():
    integrator = LinearModel([[0.0]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"])
    with pytest.raises(InputError, match="pole"):
        integrator([1.0, 0.0])
    with pytest.raises(InputError, match="complex numbers"):
        integrator(np.nan)


def unc():
    model = random_lpv(1, ny=2, seed=3)[0]
    model = replace(model, D=0 * model.D)  # no loop through feedthrough that moves with p
    return UncertainStateSpace(model, ["u2"], ["y2"], 0.4, 1.0, "a test")


def test_an_uncertain_model_keeps_its_block():
    found = -(2.0 * unc()) * linear(2, 1, 1) + linear(3, 1, 1)
    assert isinstance(found, UncertainStateSpace)
    assert (found.bound, found.source) == (0.4, "a test")
    frozen = unc().nominal.at(4.2)
    expected = -2.0 * frozen * linear(2, 1, 1) + linear(3, 1, 1)
    np.testing.assert_allclose(found.nominal.at(4.2)(POINTS), expected(POINTS), rtol=1e-9)
    delta = [[0.3]]
    drawn = found.perturbed(delta).at(4.2)(POINTS)
    expected = -2.0 * unc().perturbed(delta).at(4.2) * linear(2, 1, 1) + linear(3, 1, 1)
    np.testing.assert_allclose(drawn, expected(POINTS), rtol=1e-8)
    assert named(unc()["y1", "u1"]) == (["u1"], ["y1"])


P2, P32 = partial(linear, 1), partial(linear, 1, nu=2, ny=3)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: P2() * linear(2, ny=3), r"u10, u11.*y20, y21, y22.*P\[outputs, inputs\]"),
        (lambda: P2() + linear(2, ny=3), r"y10, y11.*y20, y21, y22.*P\[outputs, inputs\]"),
        (lambda: feedback(P32(), P2(), sign=1), r"u10, u11.*y10, y11, y12.*lower_feedback"),
        (lambda: P2() * linear(2, dt=0.1), "one sample period.*discretize"),
        (lambda: P2() - linear(2, dt=0.1), "one sample period"),
        (lambda: linear(1, dt=0.2) + linear(2, dt=0.1), "one sample period"),
        (lambda: P2() + 1.0, r"one input and one output.*1 \* np.eye\(n\)"),
        (lambda: 1.0 - P2(), r"np\.ones"),
        (lambda: P2() * "K", "got str"),
        (lambda: P2() * 1j, "got complex"),
        (lambda: P2()["y10"], r"expected P\[outputs, inputs\], such as P\['y10', 'u10'\]"),
        (lambda: P2()[2, 0], "output 2: the system has 2: y10, y11"),
        (lambda: P2()[1.5, 0], "a name, a list of names"),
        (lambda: unc() + unc(), "2 uncertain"),
        (lambda: random_lpv(1)[0](1j), r"P\.at\(airspeed\)\(s\), got P\(s\)"),
        (lambda: random_lpv(1)[0].to_lft()(1j), r"P\.at\(airspeed\)\(s\)"),
        (lambda: unc()(1j), r"P\.nominal\.at\(airspeed\)\(s\)"),
    ],
)
def test_what_does_not_fit_is_refused_in_words(build, words):
    with pytest.raises(InputError, match=words):
        build()


def test_a_misspelt_channel_is_named():
    with pytest.raises(UnknownNameError, match="did you mean 'y11'"):
        P2()["y11x", "u10"]


def test_a_system_is_no_sequence_and_no_array():
    with pytest.raises(TypeError):
        list(P2())
    with pytest.raises(TypeError):
        P2() / P2()


def test_functions_and_operators_are_one_algebra():
    P, K = linear(1), linear(2)
    for a, b in ((P * K, series(K, P)), (P + K, parallel(P, K))):
        for name in "ABCD":
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    both = append(P, K)
    np.testing.assert_allclose(both[:2, :2](POINTS), P(POINTS), rtol=1e-14)
