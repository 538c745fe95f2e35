/* @title@: equations of motion; see the header for the meaning of every entry. */
#include "@stem@.h"
#if defined(__GNUC__)
/* the generated functions take work arrays that they do not need */
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

/* @generated@ */

void heli_rhs(const double *x, const double *u, const double *wind, double *xdot)
{
    const double *arg[3];
    double *res[1];
    arg[0] = x; arg[1] = u; arg[2] = wind; res[0] = xdot;
    rhs(arg, res, 0, 0, 0);
}

void heli_flight_rhs(const double *x, const double *u, const double *wind, double *xdot)
{
    const double *arg[3];
    double *res[1];
    arg[0] = x; arg[1] = u; arg[2] = wind; res[0] = xdot;
    flight_rhs(arg, res, 0, 0, 0);
}

void heli_flight_step(double *x, const double *u, const double *wind, double h)
{
    enum { N = RHS_N_FLIGHT, Q = RHS_FLIGHT_q0 };
    double k1[N], k2[N], k3[N], k4[N], z[N], norm = 0;
    int i;
    heli_flight_rhs(x, u, wind, k1);
    for (i = 0; i < N; i++) z[i] = x[i] + h / 2 * k1[i];
    heli_flight_rhs(z, u, wind, k2);
    for (i = 0; i < N; i++) z[i] = x[i] + h / 2 * k2[i];
    heli_flight_rhs(z, u, wind, k3);
    for (i = 0; i < N; i++) z[i] = x[i] + h * k3[i];
    heli_flight_rhs(z, u, wind, k4);
    for (i = 0; i < N; i++) x[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
    for (i = Q; i < Q + 4; i++) norm += x[i] * x[i];
    norm = sqrt(norm);
    for (i = Q; i < Q + 4; i++) x[i] /= norm;
}
