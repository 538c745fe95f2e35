"""Numbers printed in G15 or following from its table in closed form, for the X-Cell .60."""

from __future__ import annotations

import math

import numpy as np
import pytest

import symheli
from symheli.values.kinematics import GRAVITY

M, RHO, OM, R, C, SLOPE = 8.2, 1.225, 167.0, 0.775, 0.058, 5.5
SIGMA, ETA = 2 * C / (math.pi * R), 0.9
SCALE = RHO * (OM * R) ** 2 * math.pi * R**2


def hover_with_thrust_equal_to_weight(heli):
    """Level, at rest, collective solved for T = m g: the condition of the printed hover numbers."""
    from scipy.optimize import brentq

    x = np.zeros(len(heli.states))
    if "Om" in heli.states:
        x[heli.states.index("Om")] = OM

    def excess(d_col):
        return (
            float(heli.compiled("diagnostics")(x=x, u=[0, 0, d_col, 0.25], wind=0)["T_mr"])
            - M * GRAVITY
        )

    d_col = brentq(excess, 0.02, 0.17, xtol=1e-14)
    return (
        x,
        np.array([0, 0, d_col, 0.25]),
        heli.compiled("diagnostics")(x=x, u=[0, 0, d_col, 0.25], wind=0),
    )


def test_hover_inflow_thrust_and_collective(ideal):
    _, u, d = hover_with_thrust_equal_to_weight(ideal)
    assert float(d["C_T"]) == pytest.approx(0.002078, abs=5e-7)  # last printed digit
    assert float(d["lam0"]) == pytest.approx(0.03397, abs=1e-5)
    assert float(d["lam0"]) == pytest.approx(math.sqrt(float(d["C_T"]) / (2 * ETA)), rel=1e-12)
    assert u[2] == pytest.approx(0.0985, abs=5e-5)
    assert float(d["Q_mr"]) == pytest.approx(6.407, abs=5e-4)


def test_ideal_inflow_gives_the_printed_induced_velocity_and_torque():
    ct = M * GRAVITY / SCALE
    lam = math.sqrt(ct / 2)
    assert lam * OM * R == pytest.approx(4.2, abs=0.05)  # V_i, two printed digits
    assert lam == pytest.approx(0.033, abs=0.001)
    torque = (ct * lam + 0.024 * SIGMA / 8) * SCALE * R
    assert torque == pytest.approx(6.298, abs=5e-4)


def test_hover_derivatives_meet_their_closed_forms(ideal):
    """Z_w and Z_col of the rotor alone; the fuselage in the downwash adds to both and is removed by
    its drag areas.
    """
    x, u, d = hover_with_thrust_equal_to_weight(ideal)
    lam = float(d["lam0"])
    A, B, _ = (np.array(m) for m in ideal.compiled("jacobian")(x, u, np.zeros(3)))
    denominator = 16 * ETA * lam + SLOPE * SIGMA
    z_w = -(RHO * OM * R * math.pi * R**2 / M) * 2 * SLOPE * SIGMA * ETA * lam / denominator
    z_col = -(SCALE / M) * (8 / 3) * SLOPE * SIGMA * ETA * lam / denominator
    assert z_w == pytest.approx(-0.778, abs=5e-4)
    assert z_col == pytest.approx(-134.3, abs=0.05)
    # fuselage: Z = 0.5 rho S_z (V_i - w)^2, dZ/dV_i with V_i = lam Om R; dlam/dw and dlam/dcol
    # follow from the thrust slope: C_T = 2 eta lam (lam - mu_z)
    tip, area = OM * R, 0.15
    dct_dw, dct_dcol = -z_w * M / SCALE, -z_col * M / SCALE
    dlam_dw = (dct_dw + 2 * ETA * lam / tip) / (4 * ETA * lam)
    dlam_dcol = dct_dcol / (4 * ETA * lam)
    wash = RHO * area * lam * tip / M
    assert A[2, 2] == pytest.approx(z_w + wash * (dlam_dw * tip - 1), rel=1e-9)
    assert B[2, 2] == pytest.approx(z_col + wash * dlam_dcol * tip, rel=1e-9)


def test_short_period_and_cyclic_gain(ideal):
    x, u, _ = hover_with_thrust_equal_to_weight(ideal)
    A, B, _ = (np.array(m) for m in ideal.compiled("jacobian")(x, u, np.zeros(3)))
    q, p, a1, b1 = (ideal.states.index(s) for s in ("q", "p", "a1", "b1"))
    assert math.sqrt(A[q, a1]) == pytest.approx(14.64, abs=0.005)
    assert math.sqrt(A[p, b1]) == pytest.approx(20.13, abs=0.005)
    assert -1 / A[a1, a1] == pytest.approx(0.1198, abs=5e-5)
    assert B[a1, 0] == pytest.approx(35.07, abs=0.005)
    assert B[b1, 1] == pytest.approx(35.07, abs=0.005)


def test_tail_rotor_derivatives_in_hover_are_inside_the_reading_error(ideal):
    hover = symheli.trim(ideal, 0.0)
    lin = symheli.linearize(ideal, hover, inputs=["d_ped"])
    v = lin.states.index("v")
    assert lin.B[v, 0] == pytest.approx(-5.15, abs=0.05)


def test_yaw_response_to_collective_depends_on_the_governor(ideal, pi):
    """Frozen engine torque gives about 0, the ideal governor -117 1/s^2 per rad; pedal 136 against
    91.
    """
    rows = {}
    for heli in (ideal, pi):
        lin = symheli.linearize(heli, symheli.trim(heli, 0.0))
        rows[heli.governor] = lin.B[lin.states.index("r")]
    assert rows["ideal"][2] == pytest.approx(-117, abs=2)
    assert rows["ideal"][3] == pytest.approx(91, abs=0.5)
    assert abs(rows["pi"][2]) < 1
    assert rows["pi"][3] == pytest.approx(136, abs=0.5)


def test_governor_poles_match_the_linearised_rotor_equation(pi):
    """a11 = -(3 Q0 + P_max K_p)/(Om I_rot), a12 = P_max K_i/(Om I_rot), a21 = -1 with the body
    held.
    """
    hover = symheli.trim(pi, 0.0)
    lin = symheli.linearize(pi, hover)
    Om, om_i, r = (lin.states.index(s) for s in ("Om", "om_i", "r"))
    # add back the -r' of the body: Om' + r' is the torque balance
    a11, a12 = lin.A[Om, Om] + lin.A[r, Om], lin.A[Om, om_i] + lin.A[r, om_i]
    d = pi.compiled("diagnostics")(x=hover.x.array, u=hover.u.array, wind=0)
    shaft = float(d["Q_e"])
    # inflow varies with Om, so the rotor torque is not exactly proportional to Om^2: 15 % covers it
    assert a11 == pytest.approx(-(3 * shaft + 2000 * 0.01) / (OM * 0.095), rel=0.15)
    assert a12 == pytest.approx(2000 * 0.02 / (OM * 0.095), rel=1e-9)
    assert lin.A[om_i, Om] == pytest.approx(-1.0)


def test_pitch_trim_at_fast_flight_and_roll_trim_in_hover(ideal):
    assert math.degrees(symheli.trim(ideal, 14.5).x["theta"]) == pytest.approx(-8.5, abs=0.1)
    assert 4.0 < math.degrees(symheli.trim(ideal, 0.0).x["phi"]) < 6.0


def test_shape_of_the_transition(ideal):
    speeds = np.arange(0.0, 20.5, 0.5)
    family = symheli.sweep(ideal, speeds)
    collective = [t.u["d_col"] for t in family.trims]
    pedal = [t.u["d_ped"] for t in family.trims]
    assert 8 <= speeds[np.argmin(collective)] <= 12
    assert 12 <= speeds[np.argmin(pedal)] <= 16
    hover, fast = family[0].poles(), family[30].poles()
    assert np.sort(np.abs(hover))[-1] == pytest.approx(20, rel=0.05)
    dutch = fast[(fast.imag > 3) & (fast.imag < 8)]
    assert np.abs(dutch).max() > 5
    corners = sorted(v for found in family.kinks.values() for v in found)
    for printed in (0.9, 3.1, 8.8, 10.9, 18.3):
        assert min(abs(c - printed) for c in corners) < 0.12
