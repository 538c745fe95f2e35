"""Derivatives of flights: forward against adjoint, against differences of flights, against the
matrix exponential.
"""

import numpy as np
import pytest
from flights import manoeuvre, without_compiler
from scipy.linalg import expm

import symheli
from symheli import simulate
from symheli.errors import InputError
from symheli.integrate import CashKarp, DormandPrince, Radau, RungeKutta4, gradient, tangent
from symheli.physics.attitude import euler_state, flight_state

METHODS = [RungeKutta4(), CashKarp(1e3, largest=0.01), DormandPrince(1e3, largest=0.01), Radau()]
"""The adaptive ones with equal steps: derivatives are those at the steps taken, and differences
must not change them.
"""


@pytest.fixture(
    params=["ideal", pytest.param("pi", marks=pytest.mark.slow)]
)  # each governor's derivatives take seconds to compile
def either(request):
    return request.getfixturevalue(request.param)


def case(heli, method, m=3, n=6):
    rng = np.random.default_rng(1)
    x0, u = manoeuvre(heli, n=n)
    flown = simulate(heli, x0, u, rng.normal(size=(n, 3)), dt=0.02, method=method)
    directions = (
        rng.normal(size=(len(x0), m)),
        0.1 * rng.normal(size=(n, 4, m)),
        rng.normal(size=(n, 3, m)),
    )
    return flown, directions, rng.normal(size=(*flown.states.shape, 2))


@pytest.mark.slow(but=("ideal-method1", "ideal-method2"))
@pytest.mark.parametrize("method", METHODS)
def test_adjoint_and_tangent_agree_to_rounding(either, method):
    """<weights, tangent(d)> = <gradient(weights), d>: two routes through two separately
    differentiated programs.
    """
    flown, (dx0, du, dwind), weights = case(either, method)
    change, bar = tangent(either, flown, dx0, du, dwind), gradient(either, flown, weights)
    forward = np.einsum("knm,knj->mj", change, weights)
    backward = (
        np.einsum("nm,nj->mj", dx0, bar.x0)
        + np.einsum("knm,knj->mj", du, bar.u)
        + np.einsum("knm,knj->mj", dwind, bar.wind)
    )
    tolerance = (
        1e-9 if isinstance(method, Radau) else 1e-13
    )  # the implicit solutions are good to 1e-12; else sums of 1e3 rounded terms
    np.testing.assert_allclose(
        forward, backward, rtol=tolerance, atol=tolerance * np.abs(forward).max()
    )


@pytest.mark.slow(only="ideal-method3")
@pytest.mark.parametrize("method", METHODS)
def test_tangents_are_the_limit_of_differences_of_flights(either, method):
    flown, directions, _ = case(either, method, m=1)
    dx0, du, dwind = (d[..., 0] for d in directions)
    q = flown.states[0, 6:10]
    dx0[6:10] -= q * (q @ dx0[6:10])  # along the quaternion there is no other attitude

    def states(step):
        x0 = flown.states[0] + step * dx0
        x0[6:10] /= np.linalg.norm(x0[6:10])
        return simulate(
            either, x0, flown.inputs + step * du, flown.wind + step * dwind, dt=0.02, method=method
        ).states

    def central(step):
        return (states(step) - states(-step)) / (2 * step)

    richardson = (4 * central(2e-4) - central(4e-4)) / 3
    # rounding 1e-14/2e-4 and truncation (4e-4)^4 times fifth derivatives meet below 1e-9
    np.testing.assert_allclose(tangent(either, flown, dx0, du, dwind), richardson, atol=1e-8)


def test_about_a_trim_point_the_transition_matrix_is_the_matrix_exponential(either):
    point, n, dt = symheli.trim(either, 6.0), 25, 0.02
    model = symheli.linearize(either, point)
    flown = simulate(
        either, point, np.tile(point.u.array, (n, 1)), dt=dt, method=RungeKutta4(0.001)
    )
    h = 1e-6  # of the Euler angles: differences of closed forms, exact to 1e-10
    basis = np.eye(len(either.states))
    start = np.stack(
        [
            (flight_state(point.x.array + h * e) - flight_state(point.x.array - h * e)) / (2 * h)
            for e in basis
        ],
        axis=1,
    )
    end, du = tangent(either, flown, start)[-1], np.zeros((n, 4, 4))
    du[:] = np.eye(4)

    def in_euler_form(change):
        return np.stack(
            [
                (euler_state(flown.final + h * d) - euler_state(flown.final - h * d)) / (2 * h)
                for d in change.T
            ],
            axis=1,
        )

    block = expm(np.block([[model.A, model.B], [np.zeros((4, len(basis) + 4))]]) * n * dt)[
        : len(basis)
    ]
    np.testing.assert_allclose(
        in_euler_form(end), block[:, : len(basis)], atol=2e-8 * np.abs(block).max()
    )
    np.testing.assert_allclose(
        in_euler_form(tangent(either, flown, du=du)[-1]),
        block[:, len(basis) :],
        atol=2e-8 * np.abs(block).max(),
    )


@pytest.mark.slow
def test_without_a_compiler_derivatives_agree(either, monkeypatch):
    flown, directions, weights = case(either, RungeKutta4(), m=9, n=2)
    change, bar = tangent(either, flown, *directions), gradient(either, flown, weights)
    plain = without_compiler(monkeypatch, either)
    np.testing.assert_allclose(tangent(plain, flown, *directions), change, rtol=1e-12, atol=1e-12)
    for ours, theirs in zip(
        vars(gradient(plain, flown, weights)).values(), vars(bar).values(), strict=True
    ):
        np.testing.assert_allclose(ours, theirs, rtol=1e-11, atol=1e-11)


def test_a_change_along_the_quaternion_vanishes(ideal):
    x0, u = manoeuvre(ideal, n=3)
    flown = simulate(ideal, x0, u, dt=0.02)
    change = tangent(ideal, flown, du=np.random.default_rng(0).normal(size=(3, 4)))
    np.testing.assert_allclose(
        np.einsum("ki,ki->k", flown.states[:, 6:10], change[:, 6:10]), 0.0, atol=1e-15
    )


def test_one_functional_and_many_are_the_same(ideal):
    flown, _, weights = case(ideal, RungeKutta4())
    both, first = gradient(ideal, flown, weights), gradient(ideal, flown, weights[..., 0])
    np.testing.assert_allclose(both.u[..., 0], first.u, rtol=1e-13, atol=1e-15)
    assert first.x0.shape == (15,)


def test_what_does_not_fit_is_refused(ideal):
    flown, (dx0, du, _), _ = case(ideal, RungeKutta4())
    with pytest.raises(InputError, match="give at least one"):
        tangent(ideal, flown)
    with pytest.raises(InputError, match=r"du: expected finite numbers of shape \(6, 4\)"):
        tangent(ideal, flown, du=du[:3])
    with pytest.raises(InputError, match="as many directions"):
        tangent(ideal, flown, dx0, du[..., :1])
    with pytest.raises(InputError, match="weights: expected"):
        gradient(ideal, flown, np.zeros(3))


@pytest.mark.slow(but="method1")
@pytest.mark.parametrize("method", [RungeKutta4(), Radau()])
def test_tangents_along_parameters_are_the_limit_of_differences(ideal, method, monkeypatch):
    flown, _, _ = case(ideal, method, n=4)
    names = ["body.mass", "main_rotor.bar_lock_number", "tail_rotor.arm"]
    values = np.array([ideal.parameters[name] for name in names])
    dp = np.zeros((len(ideal.parameters), 1))
    for name, value in zip(names, values, strict=True):
        dp[[str(p) for p in ideal.parameters].index(name)] = value
    change = tangent(ideal, flown, dp=dp)[..., 0]

    def states(step):
        moved = dict(zip(names, (values * (1 + step)).tolist(), strict=True))
        return simulate(
            ideal.with_parameters(moved),
            flown.states[0],
            flown.inputs,
            flown.wind,
            dt=0.02,
            method=method,
        ).states

    def central(step):
        return (states(step) - states(-step)) / (2 * step)

    richardson = (4 * central(2e-3) - central(4e-3)) / 3
    # rounding 1e-14/4e-3 and truncation (4e-3)^4; Radau's equations are solved to 1e-12
    tolerance = 1e-9 if isinstance(method, Radau) else 1e-10
    np.testing.assert_allclose(change, richardson, atol=tolerance * np.abs(change).max() + 1e-10)
    if isinstance(method, RungeKutta4):
        plain = without_compiler(monkeypatch, ideal)
        np.testing.assert_allclose(
            tangent(plain, flown, dp=dp)[..., 0], change, rtol=1e-12, atol=1e-12
        )
