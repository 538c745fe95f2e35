/* A controller in a table as an FMU. It has its own clock: at the start time and every PERIOD
   seconds after it is sampled, with the inputs of the step in which that time lies. */
#include "controller.h"

/* measured, reference, trim, parameter; then commands and the parameter in use */
/* @variables@ */

enum { MEASURED = 1, REFERENCE = MEASURED + CONTROLLER_NU, TRIM = REFERENCE + CONTROLLER_NU };
enum { PARAMETER = TRIM + CONTROLLER_NY, COMMAND, USED = COMMAND + CONTROLLER_NY };

typedef struct {
    controller_state state;
    double start, samples;
} model;

#include "fmi3_interface.h"

static const char *model_begin(model *m, double *real, int *whole)
{
    controller_init(&m->state);
    m->start = real[0];
    m->samples = 0;
    for (int i = 0; i < CONTROLLER_NY; i++) real[COMMAND + i] = real[TRIM + i];
    real[USED] = real[PARAMETER];
    whole[0] = 0;
    return 0;
}

static const char *model_step(model *m, double *real, int *whole, double step)
{
    float given[PARAMETER + 1], command[CONTROLLER_NY];
    if (step > 1e7 * PERIOD) return "the step is too long";
    for (int i = MEASURED; i <= PARAMETER; i++) given[i] = (float)real[i];
    for (; m->start + m->samples * PERIOD < real[0] + step - 1e-6 * PERIOD; m->samples++) {
        whole[0] = controller_update(&m->state, given + MEASURED, given + REFERENCE,
                                     given + TRIM, 0, given[PARAMETER], 1, command);
        for (int i = 0; i < CONTROLLER_NY; i++) real[COMMAND + i] = command[i];
        real[USED] = m->state.used;
    }
    return 0;
}
