/* Inertial, gravity and Euler terms of a rigid body; see rigid_body.c. */
#ifndef @guard@
#define @guard@

typedef @real@ body_real;

#ifdef __cplusplus
extern "C" {
#endif
/* Rates k[8] of y[8] = (u v w p q r phi theta), SI and radians, where no force or moment of the air
   acts; singular at theta = +-90 deg. */
void body_rates(const body_real *y, body_real *k);
/* added[6]: what u v w p q r gained from `before` to `now`, a sample apart, beyond the kinematics,
   by the trapezoidal rule. */
void body_increments(const body_real *before, const body_real *now, body_real *added);
/* y[8] from `before` and the increments added[6]: the trapezoidal rule by @corrections@
   corrections. 0 where that leaves all bounds or pitch passes 89 deg. */
int body_step(const body_real *before, const body_real *added, body_real *y);
#ifdef __cplusplus
}
#endif
#endif
