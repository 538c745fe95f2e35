"""The stitched model against the models it is made of and against the nonlinear helicopter."""

import dataclasses
import math

import numpy as np
import pytest

import symheli
from symheli.codegen.numeric import Numeric
from symheli.errors import InputError, UnknownNameError
from symheli.flight import StitchedModel
from symheli.integrate import runge_kutta

SMOOTH = (4.0, 8.0)  # m/s: no wake edge, no stall between
ANCHORS = np.linspace(*SMOOTH, 5)
STILL = np.zeros(3)


@pytest.fixture(scope="module")
def family(heli):
    return symheli.sweep(heli, ANCHORS)


@pytest.fixture(scope="module")
def inertia(ideal):
    body = ideal.vehicle.values("body")
    return body["Ixx"], body["Iyy"], body["Izz"], ideal.vehicle.values("drivetrain")["inertia"]


def central(f, x, h=1e-4):
    return np.stack([(f(x + h * e) - f(x - h * e)) / (2 * h) for e in np.eye(len(x))], axis=-1)


def test_every_anchor_is_an_equilibrium(family):
    stitched = StitchedModel.from_family(family)
    for trim in family.trims:
        # the sums of the trim's forces cancel to rounding of numbers of the size of gravity
        np.testing.assert_allclose(
            stitched.rhs(trim.x.array, trim.u.array), trim.xdot.array, atol=1e-12
        )


def test_with_the_lookup_held_the_derivatives_at_an_anchor_are_those_of_the_family(family, heli):
    stitched = StitchedModel.from_family(family)
    for k, trim in enumerate(family.trims):
        x, u, p = trim.x.array, trim.u.array, family.airspeeds[k]
        # differences of a function whose only nonlinear terms are products and sines: h^2/6 times
        # 9.81 is 2e-8
        np.testing.assert_allclose(
            central(lambda z, u=u, p=p: stitched.rhs(z, u, lookup=p), x), family.A[k], atol=1e-7
        )
        np.testing.assert_allclose(
            central(lambda z, x=x, p=p: stitched.rhs(x, z, lookup=p), u), family.B[k], atol=1e-9
        )
        # the wind enters by the velocity through the air alone: the column of the gusts comes out
        # without being a table
        gusts = heli.numeric("jacobian")(x, u, STILL)[2]
        np.testing.assert_allclose(
            central(lambda z, x=x, u=u, p=p: stitched.rhs(x, u, z, lookup=p), STILL),
            gusts,
            atol=1e-9,
        )


def test_any_attitude_is_exact_at_an_anchor(family, heli):
    """Gravity and attitude kinematics are the nonlinear ones, so that nothing is lost at angles no
    linear model reaches.
    """
    stitched = StitchedModel.from_family(family)
    for trim in family.trims:
        for phi, theta in ((1.2, 0.3), (-0.6, -0.9), (2.5, 0.1)):
            x = trim.x.array.copy()
            x[6:8] = phi, theta
            np.testing.assert_allclose(
                stitched.rhs(x, trim.u.array),
                heli.numeric("rhs")(x, trim.u.array, STILL)[0],
                atol=1e-9,
            )


def test_gyroscopic_moments_are_those_of_the_rigid_body(ideal, inertia):
    family = symheli.sweep(ideal, [4.0, 6.0])
    without, given = (
        StitchedModel.from_family(family),
        StitchedModel.from_family(family, inertia=inertia),
    )
    x = family.trims[0].x.array.copy()
    x[3:6] = p, q, r = 0.7, -1.1, 0.4
    Ixx, Iyy, Izz, rotor = inertia
    expected = [
        q * r * (Iyy - Izz) / Ixx,
        p * r * (Izz - Ixx) / Iyy,
        p * q * (Ixx - Iyy) / (Izz + rotor),
    ]
    difference = given.rhs(x, family.trims[0].u.array) - without.rhs(x, family.trims[0].u.array)
    np.testing.assert_allclose(difference[3:6], expected, atol=1e-12)


@pytest.mark.parametrize(("kind", "order"), [("linear", 2), ("spline", 3)])
def test_trims_between_the_anchors_converge_with_more_anchors(ideal, kind, order):
    """Straight tables miss by the square of the spacing; splines by its fourth power inside (a
    third is asked: the ends are one-sided).
    """
    points = [symheli.trim(ideal, v) for v in (5.125, 5.9, 6.625)]

    def miss(anchors):
        stitched = StitchedModel.from_family(
            symheli.sweep(ideal, np.linspace(*SMOOTH, anchors)), kind=kind
        )
        return max(np.abs(stitched.rhs(p.x.array, p.u.array)).max() for p in points)

    coarse, fine = miss(5), miss(17)
    assert fine < coarse / 4 ** (order - 0.5)
    assert coarse < 0.02  # m/s^2 or rad/s^2


def test_a_manoeuvre_about_an_anchor_differs_from_the_nonlinear_flight_in_second_order(ideal):
    """Doublets on all inputs: half the amplitude leaves a quarter of the difference."""
    family = symheli.sweep(ideal, ANCHORS)
    stitched, trim = StitchedModel.from_family(family, kind="spline"), family.trims[2]
    step = Numeric(runge_kutta(ideal, 0.02, 4))
    shape = np.concatenate([np.ones(12), -np.ones(12), np.zeros(26)])[:, None] * np.array(
        [0.01, -0.008, 0.005, 0.02]
    )

    def difference(size):
        u = trim.u.array + size * shape
        x = trim.x.array
        cp, sp, ct, st = (f(a / 2) for a in x[6:8] for f in (np.cos, np.sin))
        flight = np.concatenate([x[:6], [cp * ct, sp * ct, cp * st, -sp * st], np.zeros(3), x[8:]])
        truth = []
        for row in u:
            truth.append(flight[:6])
            flight = step(flight, row, STILL)[0]
        return np.abs(stitched.simulate(u, x, dt=0.02)[:, :6] - np.array(truth)).max()

    whole, half, quarter = (difference(size) for size in (1.0, 0.5, 0.25))
    assert whole / half == pytest.approx(4, abs=1)
    assert half / quarter == pytest.approx(4, abs=0.6)


def test_looking_up_at_the_airspeed_itself_does_not_count_speed_derivatives_twice(ideal):
    """The trims move with the lookup and give back through f0 what x - x0 loses: the total
    derivative is the family's.
    """
    family = symheli.sweep(ideal, np.linspace(*SMOOTH, 9))
    stitched, k = StitchedModel.from_family(family, kind="spline"), 4
    trim = family.trims[k]
    total = central(lambda z: stitched.rhs(z, trim.u.array), trim.x.array)
    # what is left is the slope of a spline through nodes 0.5 m/s apart; seen: 2e-4
    np.testing.assert_allclose(total[:, :3], family.A[k][:, :3], atol=2e-3)
    # with f0 left out the moving trims would change these derivatives by twenty times that
    slope = stitched.basis(trim.airspeed, 1)
    assert (
        np.abs(stitched.A[k] @ (slope @ stitched.x0) + stitched.B[k] @ (slope @ stitched.u0)).max()
        > 0.04
    )


@pytest.mark.slow
def test_the_filter_decides_where_the_tables_are_read(ideal):
    family = symheli.sweep(ideal, ANCHORS)
    u = np.tile(family.trims[2].u.array, (60, 1))
    start = family.trims[2].x.array
    held = StitchedModel.from_family(family, filter=math.inf)
    point = dataclasses.replace(
        held,
        **{n: np.repeat(getattr(held, n)[2:3], 5, axis=0) for n in ("x0", "u0", "f0", "A", "B")},
    )
    u[10:, 0] += 0.01
    np.testing.assert_allclose(
        held.simulate(u, start, dt=0.02), point.simulate(u, start, dt=0.02), atol=1e-12
    )
    slow, fast, none = (
        StitchedModel.from_family(family, filter=f).simulate(u, start, dt=0.02)
        for f in (1.0, 1e-2, 0.0)
    )
    assert np.abs(fast - none).max() < 0.1 * np.abs(slow - none).max()


@pytest.mark.slow
def test_flights_side_by_side_are_flights_one_by_one(ideal):
    family = symheli.sweep(ideal, ANCHORS)
    stitched = StitchedModel.from_family(family, filter=0.5)
    starts = np.stack([t.x.array for t in family.trims])
    u = np.stack([t.u.array for t in family.trims]) + 0.003 * np.sin(np.arange(20))[:, None, None]
    wind = np.array([0.5, -0.3, 0.1])
    together = stitched.simulate(u, starts, dt=0.02, wind=wind)
    for i in range(len(starts)):
        np.testing.assert_allclose(
            together[:, i], stitched.simulate(u[:, i], starts[i], dt=0.02, wind=wind), atol=1e-12
        )


def test_what_cannot_be_stitched_is_said(ideal):
    family = symheli.sweep(ideal, [4.0, 6.0], inputs=["d_lon", "u_w"])
    with pytest.raises(InputError, match="leave u_w out"):
        StitchedModel.from_family(family)
    family = family.select(inputs=["d_lon"])
    with pytest.raises(InputError, match="needs the states u v w p q r phi theta first"):
        StitchedModel.from_family(family.select(states=["u", "w", "q", "theta"]))
    with pytest.raises(InputError, match=r"sampled at 0.02 s"):
        StitchedModel.from_family(family.discretize(0.02))
    with pytest.raises(InputError, match="time constant >= 0"):
        StitchedModel.from_family(family, filter=-1.0)
    with pytest.raises(UnknownNameError, match="cubic"):
        StitchedModel.from_family(family, kind="cubic")
    stitched = StitchedModel.from_family(family)
    with pytest.raises(InputError, match=r"expected x0 \(..., 10\) and u \(n, ..., 1\)"):
        stitched.simulate(np.zeros((5, 4)), family.trims[0].x.array, dt=0.02)
    with pytest.raises(InputError, match="finite"):
        stitched.simulate(np.full((5, 1), np.nan), family.trims[0].x.array, dt=0.02)
