/* @title@
   source: @source@

   Continuous time, SI units and radians, body axes x forward, y right, z down.
   Air density @density@ kg/m^3, governor "@governor@". d_ped is the total tail blade pitch.
*/
#ifndef @guard@
#define @guard@

/* states x of heli_rhs, and their derivatives xdot (unit per second) */
/* @states@ */

/* states x of heli_flight_rhs: scalar-first quaternion, position north east down */
/* @flight@ */

/* inputs u; travel of each: symmetric */
/* @inputs@ */

/* wind of heli_rhs, body axes */
/* @wind@ */

/* wind of heli_flight_rhs, north east down */
/* @earth@ */

#ifdef __cplusplus
extern "C" {
#endif
/* xdot[RHS_N_X] from x[RHS_N_X], u[RHS_N_U], wind[RHS_N_WIND]: the Euler form */
void heli_rhs(const double *x, const double *u, const double *wind, double *xdot);
/* xdot[RHS_N_FLIGHT] from x[RHS_N_FLIGHT], u[RHS_N_U], wind[RHS_N_EARTH]: the quaternion form */
void heli_flight_rhs(const double *x, const double *u, const double *wind, double *xdot);
/* x[RHS_N_FLIGHT] after h seconds (5 ms or less) with u and wind held: one classical Runge-Kutta
   step, quaternion of length 1 */
void heli_flight_step(double *x, const double *u, const double *wind, double h);
#ifdef __cplusplus
}
#endif
#endif
