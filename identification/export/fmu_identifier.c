/* A recursive estimator as an FMU. It has its own clock: at the start time and every PERIOD seconds
   after it learns from the inputs of the step in which that time lies. */
#include "estimator.c"

/* y, u, p; then innovations and coefficients, row by row */
/* @variables@ */

enum { Y = 1, U = Y + ESTIMATOR_NY, P = U + ESTIMATOR_NU, INNOVATION = P + ESTIMATOR_NP };
enum { THETA = INNOVATION + ESTIMATOR_NY, COEFFICIENTS = ESTIMATOR_N * ESTIMATOR_NY };

typedef struct {
    rls_real state[ESTIMATOR_STATE], work[ESTIMATOR_WORK];
    double start, samples;
} model;

#include "fmi3_interface.h"

static const char *model_begin(model *m, double *real, int *whole)
{
    if (rls_state_size(&config) != ESTIMATOR_STATE || rls_work_size(&config) != ESTIMATOR_WORK)
        return "the sizes of the estimator are not those of rls.c";
    rls_init(&config, m->state, m->work);
    m->start = real[0];
    m->samples = 0;
    for (int i = INNOVATION; i < N_REAL; i++) real[i] = 0;
    whole[0] = 0;
    return 0;
}

static const char *model_step(model *m, double *real, int *whole, double step)
{
    rls_real given[INNOVATION], theta[COEFFICIENTS];
    const rls_real *innovation = rls_innovation(&config, m->work);
    if (step > 1e7 * PERIOD) return "the step is too long";
    for (int i = 0; i < INNOVATION; i++) given[i] = (rls_real)real[i];
    for (; m->start + m->samples * PERIOD < real[0] + step - 1e-6 * PERIOD; m->samples++)
        whole[0] = rls_update(&config, m->state, m->work, given + Y, given + U, given + P);
    rls_coefficients(&config, m->state, theta);
    for (int i = 0; i < ESTIMATOR_NY; i++) real[INNOVATION + i] = innovation[i];
    for (int i = 0; i < COEFFICIENTS; i++) real[THETA + i] = theta[i];
    return 0;
}
