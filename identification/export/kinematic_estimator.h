/* Recursive identification of a rigid vehicle with known kinematics, sampled at @dt@ s.

   A sample is y = (u v w p q r phi theta), the controls u and p; what the velocities gained beyond
   the kinematics (estimator_body.h) is the output of the regression in estimator_aero.h, where its
   regressors are listed.

   Call estimator_init() once, then estimator_update(y, u, p) every sample. NaN marks what is
   missing; after a gap in the data call estimator_forget_past(). The next sample is then a start,
   and nothing is learnt until the lags are full again.
*/
#ifndef ESTIMATOR_H
#define ESTIMATOR_H

#include "estimator_aero.h"

/* @sizes@ */

#ifdef __cplusplus
extern "C" {
#endif
/* The state that knows nothing; 0, or 1 where estimator_aero_init says so. */
int estimator_init(void);
/* y[ESTIMATOR_NY], u[ESTIMATOR_NU], p of one instant; returns the bits of rls.h. */
int estimator_update(const rls_real *y, const rls_real *u, const rls_real *p);
/* The next update finds no past: after a gap in the data. */
void estimator_forget_past(void);
#ifdef __cplusplus
}
#endif
#endif
