/* See body.h. The only functions of a library are sin, cos and tan. */
#include <math.h>
#include "body.h"

typedef body_real real;

/* @constants@ */

void body_rates(const real *y, real *k)
{
    const real u = y[0], v = y[1], w = y[2], p = y[3], q = y[4], r = y[5];
    const real sine = (real)sin(y[6]), cosine = (real)cos(y[6]), slope = (real)cos(y[7]);
    const real turn = q * sine + r * cosine;
    k[0] = v * r - w * q - GRAVITY * (real)sin(y[7]);
    k[1] = w * p - u * r + GRAVITY * sine * slope;
    k[2] = u * q - v * p + GRAVITY * cosine * slope;
    k[3] = k[4] = k[5] = 0;
    k[6] = p + (real)tan(y[7]) * turn;
    k[7] = q * cosine - r * sine;
}

void body_increments(const real *before, const real *now, real *added)
{
    real first[8], last[8];
    body_rates(before, first);
    body_rates(now, last);
    for (int i = 0; i < 6; i++) added[i] = now[i] - before[i] - HALF_PERIOD * (last[i] + first[i]);
}

int body_step(const real *before, const real *added, real *y)
{
    real rate[8], next[8], gained[8] = {0};
    body_rates(before, rate);
    for (int i = 0; i < 6; i++) gained[i] = added[i];
    for (int i = 0; i < 8; i++) y[i] = before[i] + gained[i] + 2 * HALF_PERIOD * rate[i];
    for (int n = 0; n < CORRECTIONS; n++) {
        body_rates(y, next);
        for (int i = 0; i < 8; i++)
            y[i] = before[i] + gained[i] + HALF_PERIOD * (rate[i] + next[i]);
    }
    for (int i = 0; i < 8; i++)
        if (!(y[i] < DIVERGED && -y[i] < DIVERGED)) return 0;
    return y[7] < STEEP && -y[7] < STEEP;
}
