/* X-Cell .60 with the rotor speed held, written by hand from Gavrilets (2015); the same equations
   as equations.py. States u v w p q r q0 q1 q2 q3 x_n x_e x_d a1 b1; inputs d_lon d_lat d_col
   d_ped; wind north east down. SI and radians. */
#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846
enum { NX = 15, NU = 4 };

static const double RHO = 1.225, G = 9.81;
static const double MASS = 8.2, IXX = 0.18, IYY = 0.34, IZZ = 0.28, I_ROTOR = 0.095;
static const double H_MR = 0.235, K_BETA = 54.0, K_MU = 0.2, A_NOM = 4.2, B_NOM = 4.2, ETA_W = 0.9;
static const double L_TR = 0.91, H_TR = 0.08, N_TR = 4.66;
static const double S_X = 0.1, S_Y = 0.22, S_Z = 0.15;
static const double S_VF = 0.012, CLA_VF = 2.0, EPS_VF = 0.2, S_HT = 0.01, CLA_HT = 3.0,
                    L_HT = 0.71;

#define OMEGA 167.0
#define R_MR 0.775
#define R_TR 0.13
#define TIP_MR (OMEGA * R_MR)
#define TIP_TR (4.66 * OMEGA * R_TR)
#define A_SIGMA_MR (5.5 * 2 * 0.058 / (PI * R_MR))
#define A_SIGMA_TR (5.0 * 2 * 0.029 / (PI * R_TR))
#define PROFILE_MR (0.024 * 2 * 0.058 / (PI * R_MR) / 8)
#define PROFILE_TR (0.024 * 2 * 0.029 / (PI * R_TR) / 8)
#define FORCE_MR (1.225 * TIP_MR * TIP_MR * PI * R_MR * R_MR)
#define FORCE_TR (1.225 * TIP_TR * TIP_TR * PI * R_TR * R_TR)
#define BLOCKAGE (1 - 0.75 * 0.012 / (PI * R_TR * R_TR))
#define TAU_E (16 / (0.8 * OMEGA))
#define G_I ((0.91 - R_MR - R_TR) / 0.08)
#define G_F ((0.91 - R_MR + R_TR) / 0.08)

static const double CONVERGED =
    1e-9; /* Newton squares the error: after such a step the next would be rounding */

static inline double limited(double x, double low, double high)
{
    return x < low ? low : x > high ? high : x;
}

/* lam0 and *ct of 2 eta lam0 sqrt(mu^2 + (lam0 - mu_z)^2) = C_T = c0 - c1 lam0, or +-ct_max where
 * the blades stall */
static inline double inflow(double c0, double c1, double ct_max, double mu2, double mu_z,
                            double *restrict ct)
{
    const double sign = c0 < 0 ? -1 : 1;
    double lam = 0;
    c0 *= sign;
    mu_z *= sign;
    for (int stalled = 0; stalled < 2; stalled++) {
        if (c0 > c1 * mu_z || mu_z <= 0) {
            const double b = 2 * ETA_W * mu_z - c1;
            lam = (b + sqrt(b * b + 8 * ETA_W * c0)) * (1 / (4 * ETA_W));
        } else {
            lam = mu_z;
        }
        const double forward = c0 / (2 * ETA_W * sqrt(mu2) + c1 + 1e-300);
        if (forward < lam) lam = forward;
        for (int i = 0; i < 50; i++) {
            const double axial = lam - mu_z, root = sqrt(mu2 + axial * axial);
            /* numerator and denominator times root: one division a step */
            const double step = (2 * ETA_W * lam * root - c0 + c1 * lam) * root /
                                (2 * ETA_W * (root * root + lam * axial) + c1 * root + 1e-300);
            lam -= step;
            if (fabs(step) < CONVERGED) break;
        }
        if (stalled || c0 - c1 * lam <= ct_max) break;
        c0 = ct_max;
        c1 = 0;
    }
    *ct = sign * (c0 - c1 * lam);
    return sign * lam;
}

void rates(const double *restrict x, const double *restrict in, const double *restrict wind,
           double *restrict dx)
{
    const double u = x[0], v = x[1], w = x[2], p = x[3], q = x[4], r = x[5];
    const double q0 = x[6], q1 = x[7], q2 = x[8], q3 = x[9], a1 = x[13], b1 = x[14];
    const double d_lon = in[0], d_lat = in[1], d_col = in[2], d_ped = in[3];

    /* body to earth, and the velocity through the air */
    const double r00 = q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3, r01 = 2 * (q1 * q2 - q0 * q3),
                 r02 = 2 * (q1 * q3 + q0 * q2);
    const double r10 = 2 * (q1 * q2 + q0 * q3), r11 = q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3,
                 r12 = 2 * (q2 * q3 - q0 * q1);
    const double r20 = 2 * (q1 * q3 - q0 * q2), r21 = 2 * (q2 * q3 + q0 * q1),
                 r22 = q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3;
    const double ua = u - (r00 * wind[0] + r10 * wind[1] + r20 * wind[2]);
    const double va = v - (r01 * wind[0] + r11 * wind[1] + r21 * wind[2]);
    const double wa = w - (r02 * wind[0] + r12 * wind[1] + r22 * wind[2]);

    /* main rotor */
    const double mu_x = ua / TIP_MR, mu_y = va / TIP_MR, mu_z = wa / TIP_MR;
    const double mu2 = mu_x * mu_x + mu_y * mu_y, mu = sqrt(mu2);
    double ct, ct_tr;
    const double lam0 = inflow(0.5 * A_SIGMA_MR * (d_col * (1.0 / 3 + 0.5 * mu2) + 0.5 * mu_z),
                               0.25 * A_SIGMA_MR, 0.0055, mu2, mu_z, &ct);
    const double T = ct * FORCE_MR;
    const double Q = (ct * (lam0 - mu_z) + PROFILE_MR * (1 + 7.0 / 3 * mu2)) * (FORCE_MR * R_MR);
    const double v_i = lam0 * TIP_MR;
    const double a1_mu = 2 * K_MU * (4.0 / 3 * d_col - lam0);
    const double a1_muz = 16 * K_MU * mu * mu_x / ((1 - 0.5 * mu2) * (8 * mu + A_SIGMA_MR));

    /* fuselage in the downwash */
    const double w_fus = wa - v_i, drag = -0.5 * RHO * sqrt(ua * ua + va * va + w_fus * w_fus);

    /* main-rotor wake over the tail */
    double wake = 0;
    if (v_i > wa) {
        const double chi = ua / fmax(v_i - wa, 1e-3);
        wake = limited((chi - G_I) * (1.5 / (G_F - G_I)), 0, 1.5) * v_i;
    }

    /* tail rotor */
    const double w_tr = wa + L_TR * q - wake, v_tr = va - L_TR * r + H_TR * p;
    const double flow2 = ua * ua + w_tr * w_tr, mu2_tr = flow2 / (TIP_TR * TIP_TR),
                 muz_tr = v_tr / TIP_TR;
    const double lam_tr =
        inflow(0.5 * A_SIGMA_TR * (d_ped * (1.0 / 3 + 0.5 * mu2_tr) + 0.5 * muz_tr),
               0.25 * A_SIGMA_TR, 0.05, mu2_tr, muz_tr, &ct_tr);
    const double Q_tr =
        (ct_tr * (lam_tr - muz_tr) + PROFILE_TR * (1 + 7.0 / 3 * mu2_tr)) * (FORCE_TR * R_TR);

    /* vertical fin */
    const double v_vf = va - EPS_VF * lam_tr * TIP_TR - L_TR * r,
                 most_vf = 0.5 * RHO * S_VF * (flow2 + v_vf * v_vf);
    const double Y_tail =
        -BLOCKAGE * ct_tr * FORCE_TR +
        limited(-0.5 * RHO * S_VF * (CLA_VF * sqrt(flow2) + fabs(v_vf)) * v_vf, -most_vf, most_vf);

    /* horizontal tail */
    const double w_ht = wa + L_HT * q - wake, most_ht = 0.5 * RHO * S_HT * (ua * ua + w_ht * w_ht);
    const double Z_ht =
        limited(-0.5 * RHO * S_HT * (CLA_HT * fabs(ua) + fabs(w_ht)) * w_ht, -most_ht, most_ht);

    const double hub = K_BETA + T * H_MR;
    dx[0] = v * r - w * q + r20 * G + (-T * a1 + drag * S_X * ua) / MASS;
    dx[1] = w * p - u * r + r21 * G + (T * b1 + drag * S_Y * va + Y_tail) / MASS;
    dx[2] = u * q - v * p + r22 * G + (-T + drag * S_Z * w_fus + Z_ht) / MASS;
    dx[3] = (q * r * (IYY - IZZ) + hub * b1 + Y_tail * H_TR) / IXX;
    dx[4] = (p * r * (IZZ - IXX) + hub * a1 + Z_ht * L_HT) / IYY;
    dx[5] = (p * q * (IXX - IYY) - Y_tail * L_TR - Q - N_TR * Q_tr) / (IZZ + I_ROTOR);
    dx[6] = 0.5 * (-q1 * p - q2 * q - q3 * r);
    dx[7] = 0.5 * (q0 * p + q2 * r - q3 * q);
    dx[8] = 0.5 * (q0 * q + q3 * p - q1 * r);
    dx[9] = 0.5 * (q0 * r + q1 * q - q2 * p);
    dx[10] = r00 * u + r01 * v + r02 * w;
    dx[11] = r10 * u + r11 * v + r12 * w;
    dx[12] = r20 * u + r21 * v + r22 * w;
    dx[13] = -q + (-a1 + a1_mu * mu_x + a1_muz * mu_z + A_NOM * d_lon) / TAU_E;
    dx[14] = -p + (-b1 - a1_mu * mu_y + B_NOM * d_lat) / TAU_E;
}

/* n inputs held for dt each, `steps` classical Runge-Kutta steps an input; states[(n + 1) * NX],
 * the first row given */
void fly(int n, int steps, double dt, const double *restrict inputs, const double *restrict wind,
         double *restrict states)
{
    const double h = dt / steps;
    double x[NX], z[NX], k1[NX], k2[NX], k3[NX], k4[NX];
    memcpy(x, states, sizeof x);
    for (int k = 0; k < n; k++) {
        const double *restrict u = inputs + NU * k;
        for (int s = 0; s < steps; s++) {
            rates(x, u, wind, k1);
            for (int i = 0; i < NX; i++) z[i] = x[i] + 0.5 * h * k1[i];
            rates(z, u, wind, k2);
            for (int i = 0; i < NX; i++) z[i] = x[i] + 0.5 * h * k2[i];
            rates(z, u, wind, k3);
            for (int i = 0; i < NX; i++) z[i] = x[i] + h * k3[i];
            rates(z, u, wind, k4);
            for (int i = 0; i < NX; i++) x[i] += h / 6 * (k1[i] + 2 * (k2[i] + k3[i]) + k4[i]);
            const double scale = 1 / sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8] + x[9] * x[9]);
            for (int i = 6; i < 10; i++) x[i] *= scale;
        }
        memcpy(states + NX * (k + 1), x, sizeof x);
    }
}
