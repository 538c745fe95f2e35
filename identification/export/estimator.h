/* Recursive identification of an LPV input-output model; see rls.h.
   @precision@ precision, @bytes@ bytes of memory.

     y(k) = theta' phi(k) + e(k)
     phi: -y, u, 1 and the change of p at the lags below, times the functions of p at @at@
     functions @basis@
     forgetting @forgetting@

   Outputs that share a triangular factor:
@groups@

   Call estimator_init() once, then estimator_update(y, u, p) every sample. NaN marks what is
   missing.
*/
#ifndef ESTIMATOR_H
#define ESTIMATOR_H

#include "rls.h"

/* sizes; indices of y, u, p, and of the regressors: row i of theta, column j the output */
/* @sizes@ */

#ifdef __cplusplus
extern "C" {
#endif
/* The state that knows nothing; 0, or 1 where the sizes above are not those of rls.c, which then
   must not be used. */
int estimator_init(void);
/* y[ESTIMATOR_NY], u[ESTIMATOR_NU], p[ESTIMATOR_NP] of one instant; returns the bits of rls.h:
   RLS_LEARNT, RLS_DETERMINED, ... */
int estimator_update(const rls_real *y, const rls_real *u, const rls_real *p);
/* theta[ESTIMATOR_N * ESTIMATOR_NY], row by row */
void estimator_coefficients(rls_real *theta);
/* [ESTIMATOR_NY], of the last sample that was learnt */
const rls_real *estimator_innovation(void);
/* [ESTIMATOR_STATE], all that is remembered: save it, and write it back to go on to the last bit */
rls_real *estimator_state(void);
#ifdef __cplusplus
}
#endif
#endif
