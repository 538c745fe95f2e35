/* Does the estimator reproduce what Python computed? Exit status 0: every number to TOLERANCE of
   max(1, its size). */
#include <math.h>
#include <stdio.h>
#include "estimator.h"

/* samples: y, u, p, with a gap before sample GAP; innovations of the samples with a complete
   regressor; coefficients after the last sample */
/* @cases@ */

static double worst;

static void compare(const rls_real *got, const rls_real *expected, int count)
{
    for (int i = 0; i < count; i++) {
        const double size = fabs((double)expected[i]);
        const double error = fabs((double)got[i] - (double)expected[i]) / (size > 1 ? size : 1);
        if (!(error <= worst)) worst = error; /* a NaN stays */
    }
}

int main(void)
{
    rls_real theta[ESTIMATOR_AERO_N * ESTIMATOR_AERO_NY];
    int learnt = 0;
    if (estimator_init()) return 1;
    for (int k = 0; k < SAMPLES; k++) {
        const rls_real *y = samples[k], *u = y + ESTIMATOR_NY, *p = u + ESTIMATOR_NU;
        if (k == GAP) estimator_forget_past();
        if (!(estimator_update(y, u, p) & RLS_LEARNT)) continue;
        if (learnt < LEARNT)
            compare(estimator_aero_innovation(), innovations[learnt], ESTIMATOR_AERO_NY);
        learnt++;
    }
    estimator_aero_coefficients(theta);
    compare(theta, coefficients[0], ESTIMATOR_AERO_N * ESTIMATOR_AERO_NY);
    printf("estimator: %d of %d updates, largest difference %.2e\n", learnt, LEARNT, worst);
    return !(learnt == LEARNT && worst <= TOLERANCE);
}
