/* See estimator.h. */
#include "estimator.h"
#include "estimator_body.h"

enum { FAST = 6 }; /* u v w p q r */

static rls_real before[ESTIMATOR_NY];
static int started;

int estimator_init(void)
{
    started = 0;
    return estimator_aero_init();
}

int estimator_update(const rls_real *y, const rls_real *u, const rls_real *p)
{
    rls_real added[FAST] = {0}, lagged[ESTIMATOR_AERO_NU], wrong = 0;
    for (int i = 0; i < ESTIMATOR_NY; i++) wrong += y[i] - y[i]; /* 0, or not a number */
    if (started) estimator_body_increments(before, y, added);
    added[0] += wrong; /* at a start any number will do: there is no regressor yet */
    for (int i = 0; i < FAST; i++) lagged[i] = y[i];
    for (int i = 0; i < ESTIMATOR_NU; i++) lagged[FAST + i] = u[i];
    for (int i = 0; i < ESTIMATOR_NY; i++) before[i] = y[i];
    started = wrong - wrong == 0;
    return estimator_aero_update(added, lagged, p);
}

void estimator_forget_past(void)
{
    rls_real missing[ESTIMATOR_AERO_NU] = {0}, at[ESTIMATOR_AERO_NP] = {0};
    const rls_real zero = 0;
    for (int i = 0; i < ESTIMATOR_AERO_NU; i++) missing[i] = zero / zero;
    started = 0;
    estimator_aero_update(missing, missing, at);
}
