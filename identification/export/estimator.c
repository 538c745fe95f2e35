/* See estimator.h. */
#include "estimator.h"

/* @configuration@ */
static rls_real state[ESTIMATOR_STATE], work[ESTIMATOR_WORK];

int estimator_init(void)
{
    if (rls_state_size(&config) != ESTIMATOR_STATE) return 1;
    if (rls_work_size(&config) != ESTIMATOR_WORK) return 1;
    rls_init(&config, state, work);
    return 0;
}

int estimator_update(const rls_real *y, const rls_real *u, const rls_real *p)
{
    return rls_update(&config, state, work, y, u, p);
}

void estimator_coefficients(rls_real *theta) { rls_coefficients(&config, state, theta); }

const rls_real *estimator_innovation(void) { return rls_innovation(&config, work); }

rls_real *estimator_state(void) { return state; }
