/* Does the model predict and run free as Python computed? Exit status 0: every number to TOLERANCE
   of max(1, its size). */
#include <math.h>
#include <stdio.h>
#include "model.h"

/* samples: y, u, p; predicted: one step ahead, where the past is complete; simulated: free run from
   the first MODEL_MEMORY samples, up to the missing one */
/* @cases@ */

static double worst;

static void compare(const model_real *got, const model_real *expected)
{
    for (int i = 0; i < MODEL_NY; i++) {
        const double size = fabs((double)expected[i]);
        const double error = fabs((double)got[i] - (double)expected[i]) / (size > 1 ? size : 1);
        if (!(error <= worst)) worst = error; /* a NaN stays */
    }
}

int main(void)
{
    model_state s;
    model_real y[MODEL_NY];
    int there = 0;
    model_init(&s);
    for (int k = 0; k < SAMPLES; k++) {
        const model_real *u = samples[k] + MODEL_NY, *p = u + MODEL_NU;
        if (model_predict(&s, @present@, y) == MODEL_PREDICTED) {
            if (there < THERE) compare(y, predicted[there]);
            there++;
        }
        model_observe(&s, samples[k]@past@);
    }
    model_init(&s);
    for (int k = 0; k < HALF; k++) {
        const model_real *u = samples[k] + MODEL_NY, *p = u + MODEL_NU;
        const int free_run = model_predict(&s, @present@, y) == MODEL_PREDICTED;
        if (free_run) compare(y, simulated[k]);
        model_observe(&s, free_run ? y : samples[k]@past@);
    }
    printf("model: %d of %d predictions and a free run, largest difference %.2e\n", there, THERE,
           worst);
    return !(there == THERE && worst <= TOLERANCE);
}
