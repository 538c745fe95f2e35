"""Controllers closed around LPV plants: every frozen loop is the loop of the frozen parts, in every
basis, and nothing moves that need not.
"""

import math
import re
import warnings
from dataclasses import replace

import control
import numpy as np
import pytest
from families import SPEED

from symheli import LinearModel, LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import BSpline, CubicSpline, PiecewiseLinear, Polynomial, Product, UserFunctions
from symheli.lpv.bases import Patches
from symheli.lpv.bases.polynomials import factors_of
from symheli.lpv.lower_feedback import apart
from symheli.lpv.tools import lower_feedback
from symheli.values.signal import signals

ACCELERATION = Scheduling("acceleration", "m/s^2", -3.0, 3.0, 5.0)
POLYNOMIAL = Polynomial(2, 0.0, 13.0)
SPLINE = CubicSpline((0.0, 2.0, 5.0, 9.0, 13.0))
HATS = PiecewiseLinear((0.0, 3.0, 9.0, 13.0))
JUMPS = Patches(1, (0.0, 5.0, 13.0))
BSPLINE = BSpline(2, (0.0, 4.0, 13.0))
INSIDE = np.linspace(0.013, 12.97, 29)  # on no break
ROUNDING = 1e-11
"""Sums of some ten terms of size ten, each of a few products."""


def model(basis, *, inputs, outputs, nx, parameters=SPEED, seed=0, dt=None, prefix="x", through=()):
    """Random coefficients of every function; D only from `through` {output: inputs}."""
    rng = np.random.default_rng(seed)
    n, nu, ny = basis.size, len(inputs), len(outputs)
    D = rng.standard_normal((n, ny, nu))
    for i, y in enumerate(outputs):
        for j, u in enumerate(inputs):
            if (y, u) not in through:
                D[:, i, j] = 0.0
    return LPVStateSpace(
        basis,
        rng.standard_normal((n, nx, nx)),
        rng.standard_normal((n, nx, nu)),
        rng.standard_normal((n, ny, nx)),
        D,
        parameters,
        tuple(f"{prefix}{i + 1}" for i in range(nx)),
        inputs,
        outputs,
        dt=dt,
    )


EVERY = [("z", "w"), ("z", "u1"), ("z", "u2"), ("y1", "w"), ("y2", "w")]


def plant(basis, **options):
    options = {"nx": 3, "through": EVERY, **options}
    return model(basis, inputs=("w", "u1", "u2"), outputs=("z", "y1", "y2"), **options)


def controller(basis, **options):
    options = {"nx": 2, "prefix": "k", "seed": 1, **options}
    through = [(u, y) for u in ("u1", "u2") for y in ("y1", "y2")]
    return model(basis, inputs=("y1", "y2"), outputs=("u1", "u2"), through=through, **options)


def by_equations(P, K):
    """[A B; C D] of the loop, from the equations themselves: with every state and disturbance in
    turn set to one, u and y are what satisfies both models at once.
    """
    u = [P.inputs.index(name) for name in K.outputs]
    y = [P.outputs.index(name) for name in K.inputs]
    w = [i for i in range(len(P.inputs)) if i not in u]
    z = [i for i in range(len(P.outputs)) if i not in y]
    n, m, count = len(P.states), len(K.states), len(u)
    columns = []
    for unit in np.eye(n + m + len(w)):
        x, k, d = unit[:n], unit[n : n + m], unit[n + m :]
        M = np.block([[np.eye(count), -K.D], [-P.D[np.ix_(y, u)], np.eye(len(y))]])
        right = np.concatenate([K.C @ k, P.C[y] @ x + P.D[np.ix_(y, w)] @ d])
        found = np.linalg.solve(M, right)
        given = np.zeros(len(P.inputs))
        given[w], given[u] = d, found[:count]
        columns.append(
            np.concatenate(
                [
                    P.A @ x + P.B @ given,
                    K.A @ k + K.B @ found[count:],
                    (P.C @ x + P.D @ given)[z],
                ]
            )
        )
    return np.stack(columns, axis=1)


def stacked(closed):
    return np.block([[closed.A, closed.B], [closed.C, closed.D]])


def assert_frozen_loops_agree(P, K, points, order=lambda p: (p, p)):
    loop = lower_feedback(P, K)
    for p in points:
        own, other = order(np.atleast_1d(p))
        expected = by_equations(P.at(*own), K.at(*other) if isinstance(K, LPVStateSpace) else K)
        np.testing.assert_allclose(
            stacked(loop.at(*np.atleast_1d(p))), expected, atol=ROUNDING * np.abs(expected).max()
        )
    return loop


@pytest.mark.parametrize("own", [POLYNOMIAL, SPLINE, HATS, JUMPS, BSPLINE], ids=type)
@pytest.mark.parametrize("other", [POLYNOMIAL, SPLINE, HATS, JUMPS, BSPLINE], ids=type)
def test_every_frozen_loop_is_the_loop_of_the_frozen_models(own, other):
    loop = assert_frozen_loops_agree(plant(own), controller(other), INSIDE)
    if own is other is POLYNOMIAL:
        assert loop.basis == Polynomial(6, 0.0, 13.0)  # B2(p) D_K(p) C2(p)
    else:
        breaks = {p.low for b in (own, other) for p in b.pieces()} | {13.0}
        assert loop.basis.breaks == tuple(sorted(breaks))


def test_the_loop_is_the_one_of_python_control():
    P, K = plant(POLYNOMIAL, dt=0.1), controller(POLYNOMIAL, dt=0.1)
    loop = lower_feedback(P, K)
    assert loop.states == ("x1", "x2", "x3", "k1", "k2")
    assert (loop.inputs, loop.outputs, loop.dt) == (("w",), ("z",), 0.1)
    for p in (0.0, 7.7):
        expected = control.interconnect(
            [P.to_control(p).copy(name="plant"), K.to_control(p).copy(name="controller")],
            inputs=["w"],
            outputs=["z"],
        )
        points = np.exp(0.1j * np.linspace(0.1, 30.0, 7))
        own = loop.at(p)
        G = [own.C @ np.linalg.solve(s * np.eye(5) - own.A, own.B) + own.D for s in points]
        there = np.array([expected(s) for s in points])
        np.testing.assert_allclose(np.squeeze(G), np.squeeze(there), rtol=1e-8)


def test_a_constant_controller_around_constant_measurements_leaves_the_basis():
    """A table in p with a servo in front and constant outputs: all loops stay that table."""
    rng = np.random.default_rng(3)
    for basis in (SPLINE, JUMPS, UserFunctions((np.ones_like, np.sqrt, np.cos), 0.0, 13.0)):
        P = plant(basis)
        one = basis.constant()
        C = np.multiply.outer(one, rng.standard_normal((3, 3)))
        D = np.multiply.outer(one, rng.standard_normal((3, 3)))
        P = replace(P, C=C, D=D)
        K = controller(POLYNOMIAL).at(4.0)
        loop = assert_frozen_loops_agree(P, K, INSIDE)
        assert loop.basis == basis


def test_a_scheduled_gain_between_constant_matrices_keeps_its_table():
    one = SPLINE.constant()
    P = plant(SPLINE)
    P = replace(P, B=np.multiply.outer(one, P.B[0]), C=np.multiply.outer(one, P.C[0]), D=0 * P.D)
    loop = assert_frozen_loops_agree(P, controller(SPLINE), INSIDE)
    assert loop.basis == SPLINE


def test_two_parameters_and_a_controller_over_one_of_them():
    box = (SPEED, ACCELERATION)
    both = Product((Polynomial(2, 0.0, 13.0), Polynomial(1, -3.0, 3.0)))
    P = plant(both, parameters=box)
    points = np.random.default_rng(0).uniform([0.1, -2.9], [12.9, 2.9], (11, 2))
    loop = assert_frozen_loops_agree(P, controller(both, parameters=box), points)
    assert loop.basis.degrees == (6, 3)
    for position, scheduling, basis in (
        (0, SPEED, POLYNOMIAL),
        (0, SPEED, SPLINE),
        (1, ACCELERATION, Polynomial(2, -3.0, 3.0)),
    ):
        K = controller(basis, parameters=scheduling)
        loop = assert_frozen_loops_agree(P, K, points, lambda p, i=position: (p, p[[i]]))
        assert loop.parameters == box
        other = factors_of(loop.basis)[1 - position]
        assert other.degree == 2 * both.factors[1 - position].degree  # B2(p) ... C2(p)


def test_parameters_in_another_order_and_a_controller_over_more():
    turned = Product((Polynomial(1, -3.0, 3.0), SPLINE))
    K = controller(turned, parameters=(ACCELERATION, SPEED))
    points = np.random.default_rng(0).uniform([0.1, -2.9], [12.9, 2.9], (7, 2))
    both = Product((Polynomial(2, 0.0, 13.0), Polynomial(1, -3.0, 3.0)))
    P = plant(both, parameters=(SPEED, ACCELERATION))
    assert_frozen_loops_agree(P, K, points, lambda p: (p, p[::-1]))
    wider = assert_frozen_loops_agree(plant(HATS), K, points, lambda p: (p[:1], p[::-1]))
    assert [s.name for s in wider.parameters] == ["airspeed", "acceleration"]


def test_only_products_that_both_vary_raise_the_degree():
    """u1 varies in B and is driven by a constant gain of y1; y2 varies and drives the constant
    u2.
    """
    P = plant(POLYNOMIAL)
    one = POLYNOMIAL.constant()
    B, C = P.B.copy(), P.C.copy()
    B[:, :, 2], C[:, 1] = np.multiply.outer(one, B[0, :, 2]), np.multiply.outer(one, C[0, 1])
    P = replace(P, B=B, C=C, D=0 * P.D)
    K = LinearModel.gain([[0.3, 0.0], [0.0, -0.7]], ["y1", "y2"], ["u1", "u2"])
    assert assert_frozen_loops_agree(P, K, INSIDE).basis == POLYNOMIAL
    crossed = LinearModel.gain([[0.0, 0.3], [0.0, 0.0]], ["y1", "y2"], ["u1", "u2"])
    assert assert_frozen_loops_agree(P, crossed, INSIDE).basis == Polynomial(4, 0.0, 13.0)


def test_a_constant_loop_through_both_feedthroughs_is_solved():
    P = plant(POLYNOMIAL, through=[*EVERY, ("y1", "u1"), ("y2", "u2")])
    D = P.D.copy()
    D[1:, 1:, 1:] = 0.0
    P = replace(P, D=D)
    K = controller(Polynomial(0, 0.0, 13.0))
    assert_frozen_loops_agree(P, K, INSIDE)
    with pytest.raises(InputError, match=r"rational function.*put a servo, a delay or a filter"):
        lower_feedback(P, controller(POLYNOMIAL))
    singular = LinearModel.gain([[1 / P.D[0, 1, 1]]], ["y1"], ["u1"])
    with pytest.raises(InputError, match="not well posed"):
        lower_feedback(P, singular)


def test_feedthrough_that_never_returns_is_no_loop():
    """y1 depends on u1 directly, and the controller passes y1 on to u2 alone: D22(p) D_K(p) moves,
    and its square is zero.
    """
    P = plant(POLYNOMIAL, through=[*EVERY, ("y1", "u1")])
    K = controller(POLYNOMIAL)
    D = np.zeros_like(K.D)
    D[:, 1, 0] = K.D[:, 1, 0]
    assert_frozen_loops_agree(P, replace(K, D=D), INSIDE)


def test_static_feedback_is_the_case_without_states():
    P = plant(SPLINE)
    gains = {("u1", "y1"): 0.4, ("u2", "y1"): -1.0}
    K = LinearModel.gain([[0.4], [-1.0]], ["y1"], ["u1", "u2"])
    every = lower_feedback(P, K, inputs=P.inputs, outputs=P.outputs)
    static = P.feedback(gains)
    assert (every.inputs, every.outputs) == (static.inputs, static.outputs)
    for p in INSIDE[::7]:
        np.testing.assert_array_equal(stacked(every.at(p)), stacked(static.at(p)))


def test_the_fit_of_a_loop_is_a_loop_of_the_fit():
    """Residuals are those of the exact models closed with the same controller."""
    rng = np.random.default_rng(5)
    P, K = plant(POLYNOMIAL), controller(SPLINE)
    nodes = np.linspace(0.0, 13.0, 8)
    off = [0.01 * rng.standard_normal((8, *M.shape[1:])) for M in (P.A, P.B, P.C)]
    exact = P.matrices(nodes)
    exact = exact._replace(A=exact.A + off[0], B=exact.B + off[1], C=exact.C + off[2])
    loop = lower_feedback(P.with_residuals(nodes, exact), K)
    for i, p in enumerate(nodes):
        there = LinearModel(*(M[i] for M in exact), P.states, P.inputs, P.outputs)
        closed = LinearModel(
            *(M[i] for M in loop.fitted_to.matrices), loop.states, loop.inputs, loop.outputs
        )
        np.testing.assert_allclose(stacked(closed), by_equations(there, K.at(p)), atol=1e-9)
    wide = lower_feedback(P.with_residuals(nodes, exact), K.with_parameter(ACCELERATION))
    assert wide.residuals.nodes.shape == (16, 2)
    np.testing.assert_allclose(
        np.abs(wide.residuals.A).max(), np.abs(loop.residuals.A).max(), rtol=1e-6
    )


def test_a_loop_of_constant_models_is_over_the_parameters_of_the_other():
    P, K = plant(POLYNOMIAL), controller(SPLINE)
    frozen_plant, frozen_controller = P.at(3.0), K.at(3.0)
    for loop in (lower_feedback(frozen_plant, K), lower_feedback(P, frozen_controller)):
        assert loop.parameters == (SPEED,)
    alone = lower_feedback(frozen_plant, frozen_controller)
    assert [s.name for s in alone.parameters] == ["constant"]
    np.testing.assert_allclose(
        stacked(alone.at(0.3)), by_equations(frozen_plant, frozen_controller), atol=ROUNDING
    )


def test_states_of_one_name_are_told_apart():
    loop = lower_feedback(plant(POLYNOMIAL), controller(POLYNOMIAL, prefix="x"))
    assert loop.states == ("x1", "x2", "x3", "controller_x1", "controller_x2")
    taken = signals(("x", "cx"))
    assert apart(taken, taken, "c") == ("ccx", "cccx")


def test_every_model_of_an_uncertain_plant_is_closed():
    open_block = model(
        POLYNOMIAL,
        inputs=("w", "u1", "u2", "d"),
        outputs=("z", "y1", "y2", "v"),
        nx=3,
        through=[*EVERY, ("y1", "d"), ("v", "u1"), ("v", "w")],
    )
    unc = UncertainStateSpace(open_block, ["d"], ["v"], 0.5, 0.95, "by choice")
    K = controller(HATS)
    # no loop through the block: y1 depends on d, and u1 on y1, which v sees
    K = replace(K, D=0 * K.D)
    loop = lower_feedback(unc, K)
    assert (loop.inputs, loop.outputs) == (("w",), ("z",))
    for p in INSIDE[::9]:
        np.testing.assert_allclose(
            stacked(loop.nominal.at(p)), by_equations(unc.nominal.at(p), K.at(p)), atol=1e-10
        )
        np.testing.assert_allclose(
            stacked(loop.perturbed([[0.4]]).at(p)),
            by_equations(unc.perturbed([[0.4]]).at(p), K.at(p)),
            atol=1e-9,
        )
    block = LinearModel.gain([[1.0]], ["y1"], ["d"])
    with pytest.raises(UnknownNameError, match="unknown input 'd'"):
        lower_feedback(unc, block)


def test_what_cannot_be_closed_says_what_to_do():
    P, K = plant(POLYNOMIAL), controller(POLYNOMIAL)
    for own, other in ((P, replace(K, dt=0.02)), (replace(P, dt=0.01), replace(K, dt=0.02))):
        with pytest.raises(InputError, match=r"sample both with one period, \.discretize\(dt\)"):
            lower_feedback(own, other)
    with pytest.raises(UnknownNameError, match="did you mean 'y1'"):
        lower_feedback(P, replace(K, inputs=("y1", "y_1")))
    with pytest.raises(UnknownNameError, match="unknown input 'u3'"):
        lower_feedback(P, replace(K, outputs=("u1", "u3")))
    narrow = K.with_scheduling(replace(SPEED, high=10.0))
    with pytest.raises(InputError, match=r"on \[0, 13\] m/s.*on \[0, 10\] only"):
        lower_feedback(P, narrow)
    assert lower_feedback(P.with_scheduling(replace(SPEED, high=9.0)), narrow).scheduling.high == 9
    knots = K.with_scheduling(replace(SPEED, unit="kt"))
    with pytest.raises(InputError, match=r"in kt in the other: \.with_scheduling"):
        lower_feedback(P, knots)
    brought = controller(UserFunctions((np.ones_like, np.sqrt), 0.0, 13.0))
    with pytest.raises(InputError, match="no basis in common"):
        lower_feedback(plant(HATS), brought)
    with pytest.raises(InputError, match="controller: expected an LPVStateSpace"):
        lower_feedback(P, np.eye(2))


def test_a_static_controller_goes_with_any_sample_period():
    K = LinearModel.gain([[0.5]], ["y1"], ["u1"])
    assert lower_feedback(plant(POLYNOMIAL, dt=0.02), K).dt == 0.02
    static = LPVStateSpace.constant(LinearModel.gain([[2.0, 1.0]], ["w", "u1"], ["y1"]))
    dynamic = LinearModel([[0.5]], [[1.0]], [[1.0]], [[0.0]], ("k",), ("y1",), ("u1",), dt=0.1)
    loop = lower_feedback(static, dynamic)
    assert (loop.dt, float(loop.at(0.0).A[0, 0])) == (0.1, 1.5)


@pytest.mark.parametrize(
    ("plants", "others", "said"),
    [
        (
            5.0,
            1.0,
            r"airspeed moves at 1 m/s\^2 at most, in the plant at up to 5 m/s\^2: .*with_rate",
        ),
        (5.0, 5.0, None),
        (5.0, 9.0, None),
        (math.inf, 1.0, None),  # nothing was said of the plant
        ("acceleration", 1.0, r"1 m/s\^2 at most, in the plant at up to 3"),
        ("acceleration", 4.0, None),
        (5.0, "acceleration", "the rate of airspeed is the parameter acceleration"),
        ("acceleration", "acceleration", None),
    ],
)
def test_a_controller_made_for_a_slower_parameter_is_noticed(plants, others, said):
    """The loop takes range and rate of the plant, whatever the controller says of them."""

    def model(rate, inputs, outputs, low, high):
        box = [Scheduling("airspeed", "m/s", low, high, rate)]
        if isinstance(rate, str):
            box.append(Scheduling("acceleration", "m/s^2", -3.0, 2.0))
        gain = LinearModel.gain([[0.5]], inputs, outputs)
        return LPVStateSpace.constant(gain, box)

    P, K = model(plants, ["u"], ["y"], 2.0, 8.0), model(others, ["y"], ["u"], 0.0, 9.0)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        loop = lower_feedback(P, K)
    assert loop.parameters[0] == P.parameters[0]
    assert len(caught) == (said is not None)
    assert said is None or re.search(said, str(caught[0].message))


@pytest.mark.parametrize(
    ("other", "noticed"),
    [
        (Scheduling("u", "m/s", 0.0, 13.0), True),
        (Scheduling("V", "kt", 0.0, 30.0), True),
        (Scheduling("descent", "m/s", -5.0, -1.0), False),  # nothing in common
        (Scheduling("mass", "kg", 5.0, 9.0), False),
    ],
)
def test_two_parameters_that_may_be_one_are_noticed(other, noticed):
    """A plant over airspeed under a controller that calls it otherwise would be closed as if the
    two moved independently.
    """
    airspeed = Scheduling("airspeed", "m/s", 0.0, 13.0)
    one = np.ones((1, 1))
    P = LPVStateSpace.polynomial([-one, -0.1 * one], [one], [one], [0 * one], airspeed)
    none = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    K = LPVStateSpace.polynomial(
        *([M] for M in none), [-one, -0.1 * one], other, inputs=P.outputs, outputs=P.inputs
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        loop = lower_feedback(P, K)
    assert {s.name for s in loop.parameters} == {"airspeed", other.name}
    said = [str(w.message) for w in caught]
    assert bool(said) == noticed
    if noticed:
        assert "with_scheduling(Scheduling('airspeed', 'm/s', low, high))" in said[0]
