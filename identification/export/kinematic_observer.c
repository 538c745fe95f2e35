/* See observer.h. Of a library only sin, cos and tan. */
#include <math.h>
#include "observer.h"
#include "observer_body.h"

typedef observer_real real;

enum { WIDE = OBSERVER_NY, FAST = 6, NX = OBSERVER_NX, NU = OBSERVER_NU };

/* lagged, remembered: of (x, u) side by side, what a coefficient multiplies, and what x below its
   first rows remembers; kept: of (u v w p q r, u) so many samples back, what it begins with */
/* @constants@ */

static int is_finite(real value) { return value - value == 0; }

static int are_finite(const real *value, int count)
{
    int all = 1;
    for (int i = 0; i < count; i++) all = all && is_finite(value[i]);
    return all;
}

void observer_init(observer_state *s) { s->started = s->filled = 0; }

/* x and its covariance from the samples that fill the past, newest first. */
static void begin(observer_state *s, const real *y)
{
    for (int i = 0; i < NX; i++)
        for (int j = 0; j < NX; j++) s->P[i][j] = 0;
    for (int i = 0; i < WIDE; i++) {
        s->x[i] = y[i];
        s->P[i][i] = sensor[i];
    }
    for (int i = 0; i < REMEMBERED; i++) {
        const int column = kept[i][0], row = WIDE + i;
        s->x[row] = s->past[kept[i][1]][column];
        s->P[row][row] = column < FAST ? sensor[column] : 0;
    }
    s->started = 1;
}

static int starting(observer_state *s, const real *y, const real *u, const real *p)
{
    if (!are_finite(y, WIDE)) {
        observer_init(s);
        return OBSERVER_MISSING;
    }
    for (int k = OBSERVER_MEMORY - 1; k > 0; k--)
        for (int i = 0; i < FAST + NU; i++) s->past[k][i] = s->past[k - 1][i];
    for (int i = 0; i < FAST; i++) s->past[0][i] = y[i];
    for (int i = 0; i < NU; i++) s->past[0][FAST + i] = s->u[i] = u[i];
    for (int i = 0; i < OBSERVER_NP; i++) s->p[i] = p[i];
    s->filled++;
    if (s->filled >= OBSERVER_MEMORY) begin(s, y);
    return OBSERVER_STARTING;
}

/* J = half a period times the derivatives of body_rates at y. */
static void jacobian(const real *y, real J[WIDE][WIDE])
{
    const real u = y[0], v = y[1], w = y[2], p = y[3], q = y[4], r = y[5];
    const real sp = (real)sin(y[6]), cp = (real)cos(y[6]), st = (real)sin(y[7]),
               ct = (real)cos(y[7]), tt = (real)tan(y[7]), turn = q * sp + r * cp;
    const real rows[WIDE][WIDE] = {
        {0, r, -q, 0, -w, v, 0, -GRAVITY * ct},
        {-r, 0, p, w, 0, -u, GRAVITY * cp * ct, -GRAVITY * sp * st},
        {q, -p, 0, -v, u, 0, -GRAVITY * sp * ct, -GRAVITY * cp * st},
        {0},
        {0},
        {0},
        {0, 0, 0, 1, tt * sp, tt * cp, tt * (q * cp - r * sp), turn / (ct * ct)},
        {0, 0, 0, 0, cp, -sp, -turn, 0},
    };
    for (int i = 0; i < WIDE; i++)
        for (int j = 0; j < WIDE; j++) J[i][j] = HALF_PERIOD * rows[i][j];
}

/* I becomes the inverse of M, which is lost: Gauss and Jordan, with the largest pivot of each
   column. */
static void invert(real M[WIDE][WIDE], real I[WIDE][WIDE])
{
    for (int i = 0; i < WIDE; i++)
        for (int j = 0; j < WIDE; j++) I[i][j] = i == j;
    for (int k = 0; k < WIDE; k++) {
        int pivot = k;
        for (int i = k + 1; i < WIDE; i++)
            if (fabs((double)M[i][k]) > fabs((double)M[pivot][k])) pivot = i;
        for (int j = 0; j < WIDE; j++) {
            const real a = M[k][j], b = I[k][j];
            M[k][j] = M[pivot][j];
            M[pivot][j] = a;
            I[k][j] = I[pivot][j];
            I[pivot][j] = b;
        }
        const real by = 1 / M[k][k];
        for (int j = 0; j < WIDE; j++) {
            M[k][j] *= by;
            I[k][j] *= by;
        }
        for (int i = 0; i < WIDE; i++) {
            const real factor = M[i][k];
            if (i == k) continue;
            for (int j = 0; j < WIDE; j++) {
                M[i][j] -= factor * M[k][j];
                I[i][j] -= factor * I[k][j];
            }
        }
    }
}

/* Row i of A times a column v with so many numbers to its next entry; A has s->A on top, and below
   it what is remembered. */
static real next(const observer_state *s, int i, const real *v, int stride)
{
    real sum = 0;
    if (i >= WIDE) return remembered[i - WIDE] < NX ? v[remembered[i - WIDE] * stride] : 0;
    for (int k = 0; k < NX; k++) sum += s->A[i][k] * v[k * stride];
    return sum;
}

/* A = d x(k) / d x(k-1) in its first rows, from y before and now; solved: (1 - J(now))^-1. */
static void linearize(observer_state *s, const real *before, const real *now,
                      real solved[WIDE][WIDE])
{
    real J[WIDE][WIDE];
    jacobian(now, J);
    for (int i = 0; i < WIDE; i++)
        for (int j = 0; j < WIDE; j++) J[i][j] = (real)(i == j) - J[i][j];
    invert(J, solved);
    jacobian(before, J);
    for (int i = 0; i < WIDE; i++) {
        for (int j = 0; j < NX; j++) s->A[i][j] = 0;
        for (int j = 0; j < WIDE; j++)
            for (int k = 0; k < WIDE; k++)
                s->A[i][j] += solved[i][k] * ((real)(k == j) + J[k][j]);
        for (int e = 0; e < LAGGED; e++)
            for (int k = 0; k < FAST; k++)
                if (lagged[e] < NX)
                    s->A[i][lagged[e]] += solved[i][k] * s->coefficients[e * FAST + k];
    }
}

/* P = A P A' and what gusts add. */
static void spread(observer_state *s, real solved[WIDE][WIDE])
{
    for (int i = 0; i < NX; i++)
        for (int j = 0; j < NX; j++) s->work[i][j] = next(s, i, &s->P[0][j], NX);
    for (int i = 0; i < NX; i++)
        for (int j = 0; j < NX; j++) s->P[i][j] = next(s, j, s->work[i], 1);
    for (int i = 0; i < WIDE; i++)
        for (int j = 0; j < WIDE; j++)
            for (int k = 0; k < FAST; k++) s->P[i][j] += solved[i][k] * process[k] * solved[j][k];
}

static int predicted(observer_state *s, const real *p)
{
    real added[FAST] = {0}, y[WIDE], solved[WIDE][WIDE], moved[NX];
    const real *known = s->coefficients + LAGGED * FAST;
    if (!observer_aero_coefficients(p, s->coefficients)) return OBSERVER_REFUSED;
    for (int k = 0; k < FAST; k++) {
        for (int e = 0; e < LAGGED; e++) {
            const real value = lagged[e] < NX ? s->x[lagged[e]] : s->u[lagged[e] - NX];
            added[k] += value * s->coefficients[e * FAST + k];
        }
        added[k] += known[k];
        for (int d = 0; d < MOVING; d++) added[k] += (p[d] - s->p[d]) * known[(d + 1) * FAST + k];
    }
    if (!observer_body_step(s->x, added, y)) return OBSERVER_LOST;
    linearize(s, s->x, y, solved);
    spread(s, solved);
    for (int i = 0; i < WIDE; i++) moved[i] = y[i];
    for (int i = 0; i < REMEMBERED; i++) {
        const int from = remembered[i];
        moved[WIDE + i] = from < NX ? s->x[from] : s->u[from - NX];
    }
    for (int i = 0; i < NX; i++) s->x[i] = moved[i];
    return OBSERVER_ESTIMATED;
}

/* One measurement of x[m] after the other: their errors have nothing to do with each other. */
static void corrected(observer_state *s, const real *y)
{
    real gain[NX], row[NX];
    for (int m = 0; m < WIDE; m++) {
        if (!is_finite(y[m])) continue;
        const real wrong = y[m] - s->x[m], by = 1 / (s->P[m][m] + sensor[m]);
        for (int i = 0; i < NX; i++) {
            gain[i] = s->P[i][m] * by;
            s->x[i] += gain[i] * wrong;
        }
        for (int j = 0; j < NX; j++) row[j] = s->P[m][j];
        for (int i = 0; i < NX; i++)
            for (int j = 0; j < NX; j++) s->P[i][j] -= gain[i] * row[j];
        /* Joseph: stays symmetric */
        for (int i = 0; i < NX; i++) row[i] = s->P[i][m];
        for (int i = 0; i < NX; i++)
            for (int j = 0; j < NX; j++)
                s->P[i][j] += (gain[i] * sensor[m] - row[i]) * gain[j];
    }
}

int observer_update(observer_state *s, const real *y, const real *u, const real *p, real *estimate)
{
    int said;
    for (int i = 0; i < WIDE; i++) estimate[i] = y[i];
    if (!are_finite(u, NU) || !are_finite(p, OBSERVER_NP)) {
        observer_init(s);
        return OBSERVER_MISSING;
    }
    if (!s->started) return starting(s, y, u, p);
    said = predicted(s, p);
    if (said == OBSERVER_ESTIMATED) {
        corrected(s, y);
        if (!are_finite(s->x, NX)) said = OBSERVER_LOST;
    }
    if (said != OBSERVER_ESTIMATED) {
        observer_init(s);
        return said;
    }
    for (int i = 0; i < WIDE; i++) estimate[i] = s->x[i];
    for (int i = 0; i < NU; i++) s->u[i] = u[i];
    for (int i = 0; i < OBSERVER_NP; i++) s->p[i] = p[i];
    return said;
}
