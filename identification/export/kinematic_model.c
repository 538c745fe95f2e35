/* See model.h. */
#include "model.h"
#include "model_body.h"

enum { FAST = 6 }; /* u v w p q r */

void model_init(model_state *s) { model_aero_init(&s->aero); }

int model_predict(model_state *s, const model_real *p, model_real *y)
{
    const model_real later[MODEL_AERO_NU] = {0}; /* inputs act from the next sample on: observed */
    model_real added[FAST], next[MODEL_NY];
    const int said = model_aero_predict(&s->aero, later, p, added);
    if (said == MODEL_AERO_REFUSED) return MODEL_REFUSED;
    if (said == MODEL_AERO_NO_PAST) return MODEL_NO_PAST;
    if (!model_body_step(s->y, added, next)) return MODEL_LOST;
    for (int i = 0; i < MODEL_NY; i++) y[i] = next[i];
    return MODEL_PREDICTED;
}

void model_observe(model_state *s, const model_real *y, const model_real *u)
{
    model_real added[FAST] = {0}; /* no regressor holds it: only whether it is finite counts */
    for (int i = 0; i < MODEL_NY; i++) added[0] += (s->y[i] = y[i]) - y[i];
    for (int i = 0; i < MODEL_NU; i++) added[0] += u[i] - u[i];
    for (int i = 0; i < FAST; i++) s->aero.u[0][i] = y[i];
    for (int i = 0; i < MODEL_NU; i++) s->aero.u[0][FAST + i] = u[i];
    model_aero_observe(&s->aero, added);
}
