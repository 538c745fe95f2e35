/* See model.h. */
#include "model.h"

typedef model_real real;

/* @tables@ */

static int is_finite(real x) { return x - x == 0; }

/* value(factors[i].functions) of factor i at p; 0 where p is outside. */
static int factor_values(int i, real p, real *value)
{
    const real *knot = knots + factors[i].knot;
    const int last = factors[i].pieces, degree = factors[i].degree, count = factors[i].functions;
    int piece = 0;
    if (!(p >= knot[0] - slack[i] && p <= knot[last] + slack[i])) return 0;
    while (piece + 1 < last && p >= knot[piece + 1]) piece++;
    const real x = (p - knot[piece]) / (knot[piece + 1] - knot[piece]);
    for (int j = 0; j < count; j++) { /* de Casteljau */
        const real *b = bernstein + factors[i].bernstein + (piece * count + j) * (degree + 1);
        real c[ORDER];
        for (int d = 0; d <= degree; d++) c[d] = b[d];
        for (int d = degree; d > 0; d--)
            for (int m = 0; m < d; m++) c[m] += x * (c[m + 1] - c[m]);
        value[j] = c[0];
    }
    return 1;
}

/* f(MODEL_NF) at p; 0 where p is outside. */
static int functions(const real *p, real *f)
{
    real value[FACTORS][MOST];
    for (int i = 0; i < FACTORS; i++)
        if (!factor_values(i, p[i], value[i])) return 0;
    for (int j = 0; j < MODEL_NF; j++) {
        f[j] = 1;
        for (int i = 0; i < FACTORS; i++) f[j] *= value[i][products[j * FACTORS + i]];
    }
    return 1;
}

/* What multiplies the coefficients of entry e. */
static real regressor(const model_state *s, int e)
{
    const int i = entries[e].channel, lag = entries[e].lag;
    switch (entries[e].kind) {
    case OUTPUT: return -s->y[lag][i];
    case INPUT: return s->u[lag][i];
    case INCREMENT: return s->p[0][i] - s->p[lag][i];
    default: return 1; /* OFFSET */
    }
}

int model_coefficients(const real *p, real *c)
{
    real f[MODEL_NF];
    if (!functions(p, f)) return 0;
    for (int e = 0; e < ENTRIES; e++)
        for (int o = 0; o < MODEL_NY; o++) {
            real sum = 0;
            for (int j = 0; j < MODEL_NF; j++) sum += theta[e * MODEL_NF + j][o] * f[j];
            c[e * MODEL_NY + o] = sum;
        }
    return 1;
}

void model_init(model_state *s) { s->filled = s->fit = 0; }

int model_predict(model_state *s, const real *u, const real *p, real *y)
{
    real sum[MODEL_NY] = {0};
    for (int k = MODEL_MEMORY; k > 0; k--) {
        for (int i = 0; i < MODEL_NY; i++) s->y[k][i] = s->y[k - 1][i];
        for (int i = 0; i < MODEL_NU; i++) s->u[k][i] = s->u[k - 1][i];
        for (int i = 0; i < MODEL_NP; i++) s->p[k][i] = s->p[k - 1][i];
        for (int i = 0; i < MODEL_NF; i++) s->f[k][i] = s->f[k - 1][i];
    }
    s->fit = functions(p, s->f[0]);
    for (int i = 0; i < MODEL_NU; i++) s->fit = is_finite(s->u[0][i] = u[i]) && s->fit;
    for (int i = 0; i < MODEL_NP; i++) s->p[0][i] = p[i];
    if (!s->fit) {
        s->filled = 0;
        return MODEL_REFUSED;
    }
    if (s->filled < MODEL_MEMORY) return MODEL_NO_PAST;
    for (int e = 0; e < ENTRIES; e++) {
        const real value = regressor(s, e), *f = s->f[entries[e].p_lag];
        for (int j = 0; j < MODEL_NF; j++)
            for (int o = 0; o < MODEL_NY; o++) sum[o] += theta[e * MODEL_NF + j][o] * value * f[j];
    }
    for (int o = 0; o < MODEL_NY; o++) y[o] = sum[o];
    return MODEL_PREDICTED;
}

void model_observe(model_state *s, const real *y)
{
    for (int o = 0; o < MODEL_NY; o++) s->fit = is_finite(s->y[0][o] = y[o]) && s->fit;
    s->filled = s->fit ? s->filled + (s->filled < MODEL_MEMORY) : 0;
}
