"""Right-hand side and Jacobian against 50-digit evaluation with an inflow root and differences of
its own.
"""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from exact import DIGITS, Exact

import symheli
from symheli.equations import evaluate

ROUNDING = 1e-11
"""Of derivatives in floating point, relative to 1 + |value|: seen are 2e-15 at trims, and some
thousand operations may add up.
"""


@pytest.fixture(scope="module")
def exact(heli):
    return Exact(heli)


def inflow_start(heli, x, u, wind):
    """Inflow ratios to two digits, to point out the branch; the root finder does the rest."""
    values = heli.numeric("diagnostics")(x, u, wind)
    d = dict(zip(heli.diagnostics.name_out(), (v[0] for v in values), strict=True))
    tail = heli.vehicle.values("tail_rotor")
    speed = x[heli.states.index("Om")] if "Om" in heli.states else heli.nominal_speed
    return [
        float(f"{lam:.1e}")
        for lam in (d["lam0"], d["V_itr"] / (tail["gear_ratio"] * speed * tail["radius"]))
    ]


def jacobian(heli, x, u, wind):
    return np.hstack(heli.numeric("jacobian")(x, u, wind))


def states_of_the_envelope(heli, count, seed):
    """States, inputs and winds anywhere in the envelope, away from vortex ring, where no accuracy
    is promised.
    """
    rng = np.random.default_rng(seed)
    found = []
    while len(found) < count:
        own = [0.05, 0.05, 20.0, 0.0][: len(heli.states) - 8] * rng.normal(
            size=len(heli.states) - 8
        ) + [0, 0, 167.0, 14.0][: len(heli.states) - 8]
        x = np.concatenate(
            [
                [rng.uniform(-3, 20)],
                rng.normal(size=2) * [3, 1.5],
                rng.normal(size=3) * 0.5,
                rng.normal(size=2) * 0.3,
                own,
            ]
        )
        u, wind = (
            rng.uniform([-0.09, -0.09, 0.0, -0.1], [0.09, 0.09, 0.18, 0.38]),
            rng.normal(size=3),
        )
        if (
            max(v for name, v in heli.switches(x, u, wind).items() if name.endswith("vortex ring"))
            < 0
        ):
            found.append((x, u, wind))
    return found


@pytest.mark.slow
def test_right_hand_side_and_jacobian_over_the_envelope(heli, exact):
    for x, u, wind in states_of_the_envelope(heli, 8, seed=11):
        z, start = np.concatenate([x, u, wind]), inflow_start(heli, x, u, wind)
        value = exact.rhs(z, start)
        np.testing.assert_allclose(
            heli.numeric("rhs")(x, u, wind)[0], value, rtol=1e-12, atol=1e-12 * np.abs(value).max()
        )
        np.testing.assert_allclose(
            jacobian(heli, x, u, wind), exact.jacobian(z, start), rtol=ROUNDING, atol=ROUNDING
        )


@pytest.mark.slow(but="pi-6.0")
@pytest.mark.parametrize("speed", [0.7, 2.0, 6.0, 9.5, 14.0, 20.0])
def test_right_hand_side_and_jacobian_at_trims(heli, exact, speed):
    point = symheli.trim(heli, speed)
    x, u, wind = point.x.array, point.u.array, np.zeros(3)
    z, start = np.concatenate([x, u, wind]), inflow_start(heli, x, u, wind)
    assert np.abs(exact.rhs(z, start) - point.xdot.array).max() < 1e-12  # against terms of 1e1
    np.testing.assert_allclose(
        jacobian(heli, x, u, wind), exact.jacobian(z, start), rtol=ROUNDING, atol=ROUNDING
    )


@pytest.mark.slow(but="pi")
def test_jacobian_in_hover_is_one_of_the_one_sided_derivatives(heli, exact):
    """Hover sits on several corners at once (|u|, wake, limits of flows that vanish): each entry
    equals one side to rounding.
    """
    point = symheli.trim(heli, 0.0)
    x, u, wind = point.x.array, point.u.array, np.zeros(3)
    z, start = np.concatenate([x, u, wind]), inflow_start(heli, x, u, wind)
    forwards, backwards = (exact.jacobian(z, start, sides) for sides in ((1, 0), (0, -1)))
    J = jacobian(heli, x, u, wind)
    miss = np.minimum(np.abs(J - forwards), np.abs(J - backwards))
    assert np.all(miss < ROUNDING * (1 + np.abs(J)))


def either_side(heli, cause, speed):
    """Two points (x, u) on a line across a corner at a trim, a billionth of the line (4 cm/s)
    before and behind it: far enough for rounding, too near for the derivative to change.
    """
    ends = [
        np.concatenate([p.x.array, p.u.array])
        for p in (symheli.trim(heli, speed + change) for change in (-0.02, 0.02))
    ]
    n = len(heli.states)

    def at(share):
        z = ends[0] + share * (ends[1] - ends[0])
        return z[:n], z[n:]

    low, high = 0.0, 1.0
    first = heli.switches(*at(low))[cause]
    assert first * heli.switches(*at(high))[cause] < 0
    while high - low > 1e-13:
        middle = (low + high) / 2
        low, high = (
            (middle, high) if first * heli.switches(*at(middle))[cause] > 0 else (low, middle)
        )
    return at(low - 1e-9), at(high + 1e-9)


@pytest.mark.slow
def test_jacobian_on_both_sides_of_every_kink_of_the_transition(ideal):
    """Close to each corner the Jacobian is that of its side, and across it the two sides differ."""
    exact, wind = Exact(ideal), np.zeros(3)
    kinks = symheli.sweep(ideal, np.arange(0.1, 20.0, 0.6)).kinks
    corners = [(cause, speed) for cause, speeds in kinks.items() for speed in speeds]
    for documented in (0.28, 0.96, 3.15, 8.82, 10.86, 18.37, 18.41):
        assert min(abs(speed - documented) for _, speed in corners) < 0.006
    jumps = []
    for cause, speed in corners:
        sides = []
        for x, u in either_side(ideal, cause, speed):
            J = exact.jacobian(np.concatenate([x, u, wind]), inflow_start(ideal, x, u, wind))
            np.testing.assert_allclose(
                jacobian(ideal, x, u, wind),
                J,
                rtol=ROUNDING,
                atol=ROUNDING,
                err_msg=f"{cause} at {speed:.2f} m/s",
            )
            sides.append(J)
        jumps.append(np.abs(sides[1] - sides[0]).max())
    assert (
        np.count_nonzero(np.array(jumps) > 1e-3) >= 6
    )  # corners they are; a flow that reverses has a continuous derivative


def test_inflow_root_meets_the_momentum_balance_written_by_hand(ideal):
    """2 eta lam sqrt(mu^2 + (lam - mu_z)^2) = (a sigma/2) [d_col (1/3 + mu^2/2) + (mu_z - lam)/2],
    from the vehicle's numbers alone.
    """
    exact, par = Exact(ideal), ideal.vehicle.values("main_rotor")
    for speed in (0.0, 4.0, 12.0):
        point = symheli.trim(ideal, speed)
        x, u = point.x.array, point.u.array
        with mpmath.workdps(DIGITS):
            lam = exact.inflow(
                [mpmath.mpf(float(v)) for v in (*x, *u, 0, 0, 0)],
                inflow_start(ideal, x, u, np.zeros(3)),
            )[0]
            tip = mpmath.mpf(ideal.nominal_speed) * mpmath.mpf(par["radius"])
            mu_x, mu_y, mu_z = (mpmath.mpf(float(v)) / tip for v in x[:3])
            solidity = (
                mpmath.mpf(par["blades"])
                * mpmath.mpf(par["chord"])
                / (mpmath.pi * mpmath.mpf(par["radius"]))
            )
            half = mpmath.mpf(par["lift_slope"]) * solidity / 2
            pitch = mpmath.mpf(float(u[2]))
            thrust = half * (
                pitch * (mpmath.mpf(1) / 3 + (mu_x**2 + mu_y**2) / 2) + (mu_z - lam) / 2
            )
            carried = (
                2
                * mpmath.mpf(par["inflow_efficiency"])
                * lam
                * mpmath.sqrt(mu_x**2 + mu_y**2 + (lam - mu_z) ** 2)
            )
            # the model's pi and 1/3 are floats (1e-16 of terms of 2e-3), its root has a guard of
            # 1e-20
            assert abs(carried - thrust) < mpmath.mpf("1e-17")
        assert math.isclose(
            float(lam),
            float(ideal.compiled("diagnostics")(x=x, u=u, wind=0)["lam0"]),
            rel_tol=1e-14,
        )


def test_flight_form_in_fifty_digits(heli):
    """The quaternion form, its inflow iteration included, against itself with 50 digits: what
    rounding does.
    """
    rng = np.random.default_rng(12)
    for x, u, wind in states_of_the_envelope(heli, 5, seed=13):
        quaternion = rng.normal(size=4)
        flight = np.concatenate(
            [x[:6], quaternion / np.linalg.norm(quaternion), [1.0, 2.0, -3.0], x[8:]]
        )
        value = np.array(evaluate(heli.flight_rhs, flight, u, wind)[0].tolist(), float).ravel()
        np.testing.assert_allclose(
            heli.numeric("flight_rhs")(flight, u, wind)[0],
            value,
            rtol=1e-12,
            atol=1e-12 * np.abs(value).max(),
        )
