/* Does the controller command what Python computed? Exit status 0: every command to TOLERANCE of
   the largest of its axis, and every status. */
#include <math.h>
#include <stdio.h>
#include "controller.h"

/* events: 1 reset, 2 enter with `others`; given: measured, reference, trim, others, parameter;
   expected: commands; status: what was met with */
/* @cases@ */

int main(void)
{
    static float largest[CONTROLLER_NY];
    controller_state s;
    int equal = 0, wrong = 0;
    double worst = 0;
    for (int k = 0; k < SAMPLES; k++)
        for (int i = 0; i < CONTROLLER_NY; i++)
            if (fabsf(expected[k][i]) > largest[i]) largest[i] = fabsf(expected[k][i]);
    controller_init(&s);
    for (int k = 0; k < SAMPLES; k++) {
        const float *measured = given[k], *reference = measured + CONTROLLER_NU,
                    *trim = reference + CONTROLLER_NU, *others = trim + CONTROLLER_NY;
        float command[CONTROLLER_NY];
        if (events[k] == 1) controller_reset(&s);
        if (events[k] == 2) controller_enter(&s, others);
        controller_set_axes(&s, (uint32_t)axes[k]);
        wrong += controller_update(&s, measured, reference, trim, others, others[CONTROLLER_NY],
                                   valid[k], command)
                 != status[k];
        for (int i = 0; i < CONTROLLER_NY; i++) {
            const double error = fabs((double)command[i] - (double)expected[k][i]);
            equal += command[i] == expected[k][i];
            if (!(error <= worst * (double)largest[i])) worst = error / (double)largest[i];
        }
    }
    printf("controller: %d samples, %d of %d commands equal to the last bit, largest difference"
           " %.2e, %d other statuses\n",
           SAMPLES, equal, SAMPLES * CONTROLLER_NY, worst, wrong);
    return !(wrong == 0 && worst <= TOLERANCE);
}
