/* Observer of a rigid vehicle with known kinematics, sampled at @dt@ s: an extended Kalman filter
   around the identified model, observer_aero.h and observer_body.h.

   observer_init once and after a gap, then observer_update every sample. The first OBSERVER_MEMORY
   samples come out as they were measured. No allocation; of a library only sin, cos and tan. SI
   units and radians.
*/
#ifndef OBSERVER_H
#define OBSERVER_H

#include "observer_aero.h"

/* sizes, indices of y, u, p */
/* @sizes@ */

/* What observer_update says. */
enum {
    OBSERVER_ESTIMATED,
    OBSERVER_STARTING, /* y as measured: the past is being filled */
    OBSERVER_MISSING,  /* u, p or, at a start, y is not finite: the next samples are a start */
    OBSERVER_REFUSED,  /* p is outside the model: likewise */
    OBSERVER_LOST      /* the estimate left all bounds, or pitch passed 89 deg: likewise */
};

typedef observer_aero_real observer_real;
typedef struct {
    observer_real x[OBSERVER_NX], P[OBSERVER_NX][OBSERVER_NX]; /* covariance; y come first */
    observer_real u[OBSERVER_NU], p[OBSERVER_NP];
    observer_real past[OBSERVER_MEMORY][6 + OBSERVER_NU];
    int started, filled;
    /* scratch */
    observer_real A[OBSERVER_NY][OBSERVER_NX], work[OBSERVER_NX][OBSERVER_NX];
    observer_real coefficients[OBSERVER_AERO_ENTRIES * OBSERVER_AERO_NY];
} observer_state;

#ifdef __cplusplus
extern "C" {
#endif
/* No past. */
void observer_init(observer_state *s);
/* estimate[OBSERVER_NY] from y[OBSERVER_NY], u[OBSERVER_NU] and p[OBSERVER_NP] at this instant; a y
   that is not finite is missing, and predicted over. Where nothing is estimated y comes out. */
int observer_update(observer_state *s, const observer_real *y, const observer_real *u,
                    const observer_real *p, observer_real *estimate);
#ifdef __cplusplus
}
#endif
#endif
