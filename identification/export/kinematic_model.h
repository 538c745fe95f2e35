/* Identified model of a rigid vehicle with known kinematics, sampled at @dt@ s, fitted by
   "@method@".

     y = (u v w p q r phi theta);  y(k) - y(k-1) - dt/2 (kin(y(k)) + kin(y(k-1)))
       = increments of u v w p q r as model_aero.h predicts them, 0 for phi and theta
     kin: what a rigid body does without aerodynamic forces, see model_body.h

   Each sample: model_predict(&s, p, y), then model_observe(&s, y, u) with y as measured (one step
   ahead) or as predicted (free run, after MODEL_MEMORY measured samples) and the controls u of this
   instant. After a gap in the data call model_init, or observe NaN: the next MODEL_MEMORY samples
   fill the past, and until then there is no prediction. No allocation; of a library only sin, cos
   and tan. SI units and radians.
*/
#ifndef MODEL_H
#define MODEL_H

#include "model_aero.h"

/* sizes, indices of y, u, p */
/* @sizes@ */

/* What model_predict says. */
enum { MODEL_PREDICTED, MODEL_NO_PAST, MODEL_REFUSED, MODEL_LOST };

typedef model_aero_real model_real;
typedef struct {
    model_aero_state aero;
    model_real y[MODEL_NY]; /* of the sample before */
} model_state;

#ifdef __cplusplus
extern "C" {
#endif
/* No past. */
void model_init(model_state *s);
/* y[MODEL_NY] of this instant from p[MODEL_NP] now and what was before. Else y is left alone:
   MODEL_NO_PAST: not enough samples yet.
   MODEL_REFUSED: p not finite or outside the range of the model; the past starts afresh.
   MODEL_LOST: the prediction leaves all bounds, or pitch passes 89 deg. */
int model_predict(model_state *s, const model_real *p, model_real *y);
/* What y[MODEL_NY] and u[MODEL_NU] were at this instant. A number that is not finite marks a
   missing sample: the past starts afresh. */
void model_observe(model_state *s, const model_real *y, const model_real *u);
#ifdef __cplusplus
}
#endif
#endif
