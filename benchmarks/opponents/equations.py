"""X-Cell .60 with the rotor speed held, written by hand from Gavrilets (2015) as docs/model.md
reads it; plain floats.

`build()` gives the functions as Python; `build(numba.njit)` the same functions compiled. Nothing
here comes from symheli: that both agree is a check of both (see tests/benchmarks).
"""

from math import cos, pi, sin, sqrt, tan
from typing import NamedTuple

RHO, G = 1.225, 9.81
MASS, IXX, IYY, IZZ, I_ROTOR = 8.2, 0.18, 0.34, 0.28, 0.095
OMEGA = 167.0

R_MR, C_MR, A_MR, CD0_MR, CTMAX_MR = 0.775, 0.058, 5.5, 0.024, 0.0055
H_MR, K_BETA, K_MU, A_NOM, B_NOM, GAMMA_FB = 0.235, 54.0, 0.2, 4.2, 4.2, 0.8
ETA_W = 0.9

R_TR, C_TR, A_TR, CD0_TR, CTMAX_TR = 0.13, 0.029, 5.0, 0.024, 0.05
N_TR, L_TR, H_TR = 4.66, 0.91, 0.08

S_X, S_Y, S_Z = 0.1, 0.22, 0.15
S_VF, CLA_VF, EPS_VF = 0.012, 2.0, 0.2
S_HT, CLA_HT, L_HT = 0.01, 3.0, 0.71

TIP_MR, TIP_TR = OMEGA * R_MR, N_TR * OMEGA * R_TR
SIGMA_MR, SIGMA_TR = 2 * C_MR / (pi * R_MR), 2 * C_TR / (pi * R_TR)
FORCE_MR, FORCE_TR = RHO * TIP_MR**2 * pi * R_MR**2, RHO * TIP_TR**2 * pi * R_TR**2
BLOCKAGE = 1 - 0.75 * S_VF / (pi * R_TR**2)
TAU_E = 16 / (GAMMA_FB * OMEGA)
G_I, G_F = (L_TR - R_MR - R_TR) / H_TR, (L_TR - R_MR + R_TR) / H_TR

CONVERGED = 1e-9  # Newton squares the error: after a step this small the next one would be rounding


class Equations(NamedTuple):
    """quaternion(u v w p q r q0 q1 q2 q3 x_n x_e x_d a1 b1, d_lon d_lat d_col d_ped, wind n e d) ->
    15 derivatives; euler(u v w p q r phi theta a1 b1, d_lon d_lat d_col d_ped) -> 10 derivatives,
    in still air.
    """

    quaternion: object
    euler: object


def build(compile=lambda function: function):
    """The equations of motion; `compile` is applied to every function."""

    @compile
    def inflow(c0, c1, ct_max, mu2, mu_z):
        """(lam0, C_T): 2 eta lam0 sqrt(mu^2 + (lam0 - mu_z)^2) = C_T = c0 - c1 lam0, or +-ct_max
        where the blades stall.
        """
        sign = 1.0
        if c0 < 0:  # thrust down: the mirror image
            sign, c0, mu_z = -1.0, -c0, -mu_z
        for stalled in range(2):
            # above the root: the axial solution (exact for mu = 0), and the one with all flow
            # edgewise
            if c0 > c1 * mu_z or mu_z <= 0:
                b = 2 * ETA_W * mu_z - c1
                lam = (b + sqrt(b * b + 8 * ETA_W * c0)) / (4 * ETA_W)
            else:
                lam = mu_z
            lam = min(lam, c0 / (2 * ETA_W * sqrt(mu2) + c1 + 1e-300))
            for _ in range(50):
                axial = lam - mu_z
                root = sqrt(mu2 + axial * axial)
                step = (2 * ETA_W * lam * root - c0 + c1 * lam) / (
                    2 * ETA_W * (root + lam * axial / (root + 1e-300)) + c1
                )
                lam -= step
                if abs(step) < CONVERGED:
                    break
            if stalled or c0 - c1 * lam <= ct_max:
                break
            c0, c1 = ct_max, 0.0
        return sign * lam, sign * (c0 - c1 * lam)

    @compile
    def aerodynamics(u, v, w, p, q, r, a1, b1, d_lon, d_lat, d_col, d_ped):
        """Force (N), moment with the shaft's reaction (N m), a1', b1' from the velocity through the
        air and the controls.
        """
        # main rotor
        mu_x, mu_y, mu_z = u / TIP_MR, v / TIP_MR, w / TIP_MR
        mu2 = mu_x * mu_x + mu_y * mu_y
        mu = sqrt(mu2)
        half = 0.5 * A_MR * SIGMA_MR
        lam0, ct = inflow(
            half * (d_col * (1 / 3 + 0.5 * mu2) + 0.5 * mu_z), 0.5 * half, CTMAX_MR, mu2, mu_z
        )
        T = ct * FORCE_MR
        Q = (ct * (lam0 - mu_z) + CD0_MR * SIGMA_MR / 8 * (1 + 7 / 3 * mu2)) * FORCE_MR * R_MR
        v_i = lam0 * TIP_MR
        a1_mu = 2 * K_MU * (4 / 3 * d_col - lam0)
        a1_muz = 16 * K_MU * mu * mu_x / ((1 - 0.5 * mu2) * (8 * mu + A_MR * SIGMA_MR))
        a1_dot = -q + (-a1 + a1_mu * mu_x + a1_muz * mu_z + A_NOM * d_lon) / TAU_E
        b1_dot = -p + (-b1 - a1_mu * mu_y + B_NOM * d_lat) / TAU_E

        # fuselage in the downwash
        w_fus = w - v_i
        drag = -0.5 * RHO * sqrt(u * u + v * v + w_fus * w_fus)

        # main-rotor wake over the tail
        k_lam = 0.0
        if v_i > w:
            chi = u / max(v_i - w, 1e-3)
            k_lam = min(max(1.5 * (chi - G_I) / (G_F - G_I), 0.0), 1.5)
        wake = k_lam * v_i

        # tail rotor
        w_tr, v_tr = w + L_TR * q - wake, v - L_TR * r + H_TR * p
        flow2 = u * u + w_tr * w_tr
        mu2_tr, muz_tr = flow2 / (TIP_TR * TIP_TR), v_tr / TIP_TR
        half_tr = 0.5 * A_TR * SIGMA_TR
        lam_tr, ct_tr = inflow(
            half_tr * (d_ped * (1 / 3 + 0.5 * mu2_tr) + 0.5 * muz_tr),
            0.5 * half_tr,
            CTMAX_TR,
            mu2_tr,
            muz_tr,
        )
        Q_tr = (
            (ct_tr * (lam_tr - muz_tr) + CD0_TR * SIGMA_TR / 8 * (1 + 7 / 3 * mu2_tr))
            * FORCE_TR
            * R_TR
        )
        Y_tail = -BLOCKAGE * ct_tr * FORCE_TR

        # vertical fin, at the tail rotor
        v_vf = v - EPS_VF * lam_tr * TIP_TR - L_TR * r
        limit = 0.5 * RHO * S_VF * (flow2 + v_vf * v_vf)
        Y_tail += min(
            max(-0.5 * RHO * S_VF * (CLA_VF * sqrt(flow2) + abs(v_vf)) * v_vf, -limit), limit
        )

        # horizontal tail
        w_ht = w + L_HT * q - wake
        limit = 0.5 * RHO * S_HT * (u * u + w_ht * w_ht)
        Z_ht = min(max(-0.5 * RHO * S_HT * (CLA_HT * abs(u) + abs(w_ht)) * w_ht, -limit), limit)

        hub = K_BETA + T * H_MR
        return (
            -T * a1 + drag * S_X * u,
            T * b1 + drag * S_Y * v + Y_tail,
            -T + drag * S_Z * w_fus + Z_ht,
            hub * b1 + Y_tail * H_TR,
            hub * a1 + Z_ht * L_HT,
            -Y_tail * L_TR - Q - N_TR * Q_tr,
            a1_dot,
            b1_dot,
        )

    @compile
    def quaternion(
        u,
        v,
        w,
        p,
        q,
        r,
        q0,
        q1,
        q2,
        q3,
        x_n,
        x_e,
        x_d,
        a1,
        b1,
        d_lon,
        d_lat,
        d_col,
        d_ped,
        w_n,
        w_e,
        w_d,
    ):
        # body to earth
        r00, r01, r02 = (
            q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3,
            2 * (q1 * q2 - q0 * q3),
            2 * (q1 * q3 + q0 * q2),
        )
        r10, r11, r12 = (
            2 * (q1 * q2 + q0 * q3),
            q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3,
            2 * (q2 * q3 - q0 * q1),
        )
        r20, r21, r22 = (
            2 * (q1 * q3 - q0 * q2),
            2 * (q2 * q3 + q0 * q1),
            q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3,
        )
        X, Y, Z, L, M, N, a1_dot, b1_dot = aerodynamics(
            u - (r00 * w_n + r10 * w_e + r20 * w_d),
            v - (r01 * w_n + r11 * w_e + r21 * w_d),
            w - (r02 * w_n + r12 * w_e + r22 * w_d),
            p,
            q,
            r,
            a1,
            b1,
            d_lon,
            d_lat,
            d_col,
            d_ped,
        )
        return (
            v * r - w * q + r20 * G + X / MASS,
            w * p - u * r + r21 * G + Y / MASS,
            u * q - v * p + r22 * G + Z / MASS,
            (q * r * (IYY - IZZ) + L) / IXX,
            (p * r * (IZZ - IXX) + M) / IYY,
            (p * q * (IXX - IYY) + N) / (IZZ + I_ROTOR),
            0.5 * (-q1 * p - q2 * q - q3 * r),
            0.5 * (q0 * p + q2 * r - q3 * q),
            0.5 * (q0 * q + q3 * p - q1 * r),
            0.5 * (q0 * r + q1 * q - q2 * p),
            r00 * u + r01 * v + r02 * w,
            r10 * u + r11 * v + r12 * w,
            r20 * u + r21 * v + r22 * w,
            a1_dot,
            b1_dot,
        )

    @compile
    def euler(u, v, w, p, q, r, phi, theta, a1, b1, d_lon, d_lat, d_col, d_ped):
        X, Y, Z, L, M, N, a1_dot, b1_dot = aerodynamics(
            u, v, w, p, q, r, a1, b1, d_lon, d_lat, d_col, d_ped
        )
        s, c = sin(phi), cos(phi)
        return (
            v * r - w * q - G * sin(theta) + X / MASS,
            w * p - u * r + G * s * cos(theta) + Y / MASS,
            u * q - v * p + G * c * cos(theta) + Z / MASS,
            (q * r * (IYY - IZZ) + L) / IXX,
            (p * r * (IZZ - IXX) + M) / IYY,
            (p * q * (IXX - IYY) + N) / (IZZ + I_ROTOR),
            p + tan(theta) * (q * s + r * c),
            q * c - r * s,
            a1_dot,
            b1_dot,
        )

    return Equations(quaternion, euler)
