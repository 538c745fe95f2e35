/* The equations of motion as an FMU: inputs held over a step, which is cut into Runge-Kutta steps
   of LONGEST seconds at most. */
#include "helicopter.h"
#include "travel.h"

/* inputs, cut to their travel; wind north east down; states; then attitude and airspeed */
/* @variables@ */

enum { INPUTS = 1, WIND = INPUTS + RHS_N_U, STATES = WIND + RHS_N_EARTH };
enum { ATTITUDE = STATES + RHS_N_FLIGHT, AIRSPEED = ATTITUDE + 3, Q = STATES + RHS_FLIGHT_q0 };

typedef struct {
    int unused;
} model;

#include "fmi3_interface.h"

static const char *model_output(double *real)
{
    const double *w = real + WIND, *x = real + STATES;
    const double a = real[Q], b = real[Q + 1], c = real[Q + 2], d = real[Q + 3];
    const double u = x[0] - ((1 - 2 * (c * c + d * d)) * w[0] + 2 * (b * c + a * d) * w[1]
                             + 2 * (b * d - a * c) * w[2]);
    const double v = x[1] - (2 * (b * c - a * d) * w[0] + (1 - 2 * (b * b + d * d)) * w[1]
                             + 2 * (c * d + a * b) * w[2]);
    const double z = x[2] - (2 * (b * d + a * c) * w[0] + 2 * (c * d - a * b) * w[1]
                             + (1 - 2 * (b * b + c * c)) * w[2]);
    const double sine = 2 * (a * c - b * d);
    for (int i = 0; i < RHS_N_FLIGHT; i++)
        if (!isfinite(x[i])) return "a state is not finite";
    real[ATTITUDE] = atan2(2 * (c * d + a * b), 1 - 2 * (b * b + c * c));
    real[ATTITUDE + 1] = asin(sine > 1 ? 1 : sine < -1 ? -1 : sine);
    real[ATTITUDE + 2] = atan2(2 * (b * c + a * d), 1 - 2 * (c * c + d * d));
    real[AIRSPEED] = sqrt(u * u + v * v + z * z);
    return 0;
}

static const char *model_begin(model *m, double *real, int *whole)
{
    double norm = 0;
    (void)m, (void)whole;
    for (int i = Q; i < Q + 4; i++) norm += real[i] * real[i];
    if (!(norm > 0.5 && norm < 2)) return "q0 q1 q2 q3 is not of length 1";
    if (fabs(norm - 1) > 1e-12)
        for (int i = Q; i < Q + 4; i++) real[i] /= sqrt(norm);
    return model_output(real);
}

static const char *model_step(model *m, double *real, int *whole, double step)
{
    const double wanted = ceil(step / LONGEST - 1e-9);
    double u[RHS_N_U];
    (void)m, (void)whole;
    if (wanted > 1e7) return "the step is too long";
    for (int i = 0; i < RHS_N_U; i++) {
        const double given = real[INPUTS + i];
        u[i] = given > travel[i] ? travel[i] : given < -travel[i] ? -travel[i] : given;
    }
    for (long n = wanted < 1 ? 1 : (long)wanted, k = 0; k < n; k++)
        heli_flight_step(real + STATES, u, real + WIND, step / (double)n);
    return model_output(real);
}
