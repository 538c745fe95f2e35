/* Does the observer reproduce what Python computed? Exit status 0: every number to TOLERANCE of
   max(1, its size). */
#include <math.h>
#include <stdio.h>
#include "observer.h"

/* samples: y, u, p, some of y missing, and one u; expected: estimates, NAN where there is none */
/* @cases@ */

int main(void)
{
    static observer_state s;
    observer_real y[OBSERVER_NY];
    double worst = 0;
    int estimated = 0;
    observer_init(&s);
    for (int k = 0; k < SAMPLES; k++) {
        const observer_real *u = samples[k] + OBSERVER_NY, *p = u + OBSERVER_NU;
        estimated += observer_update(&s, samples[k], u, p, y) == OBSERVER_ESTIMATED;
        for (int i = 0; i < OBSERVER_NY; i++) {
            const double size = fabs((double)expected[k][i]);
            const double error = fabs((double)y[i] - (double)expected[k][i]);
            if (y[i] != y[i] && expected[k][i] != expected[k][i]) continue;
            if (!(error <= worst * (size > 1 ? size : 1))) worst = error / (size > 1 ? size : 1);
        }
    }
    printf("observer: %d of %d estimates, largest difference %.2e\n", estimated, ESTIMATED, worst);
    return !(estimated == ESTIMATED && worst <= TOLERANCE);
}
