/* Controller in a table over @parameter@, for every @dt@ s.

     x(k+1) = A x + B e + L (u - w)        e = measured - reference
     w = trim + C x + D e, or, where a command integrates, w = u(k-1) + C x + D e
     u = w within its limits
     A .. L straight between @knots@ values of @parameter@ from @low@ to @high@
     the one in use moves at @rate@ @per_second@ at most

   32-bit numbers, SI units and radians, but @parameter@ (@unit@); body axes x forward, y right,
   z down. No allocation, no library. Compiled with -ffp-contract=off (not with -ffast-math) it
   gives the bits of what was analysed and flown in simulation.

   controller_init once; on the ground controller_reset every sample; in flight controller_enter
   once with the command in force, then controller_update every sample. After a gap enter again.
*/
#ifndef CONTROLLER_H
#define CONTROLLER_H

#include <stdint.h>

/* sizes; indices and units of measured and reference, of commands with their limits */
/* @sizes@ */

/* What controller_update met with: bits. HELD: a number that is none came in or out; the commands
   in force stay, and nothing else changed. PARAMETER: it was bad and not followed. FALLBACK: it was
   so for too long. SATURATED: a command stands at its limit. */
enum {
    CONTROLLER_SATURATED = 1,
    CONTROLLER_PARAMETER = 2,
    CONTROLLER_FALLBACK = 4,
    CONTROLLER_HELD = 8
};

/* One flight. A controller without states keeps room for one. */
typedef struct {
    float x[CONTROLLER_NX > 0 ? CONTROLLER_NX : 1];
    float command[CONTROLLER_NY], offset[CONTROLLER_NY];
    float reading, target, filtered, used; /* of @parameter@; used: where in the table */
    int32_t same, bad, started;
    int32_t entry[CONTROLLER_NY];
    uint32_t axes;
} controller_state;

#ifdef __cplusplus
extern "C" {
#endif
/* All axes are flown; then as controller_reset. */
void controller_init(controller_state *s);
/* States, filters and integrators as on the ground; the axes stay. The parameter in use starts at
   the next reading, the commands at their trim. */
void controller_reset(controller_state *s);
/* The same, but the next commands are command[CONTROLLER_NY], those in force now, whatever is
   measured then; what they differ by from the controller's own fades with @fade@ s. */
void controller_enter(controller_state *s, const float *command);
/* Fly the commands whose bit (1 << index) is set. The others stay at what is applied there, to
   which the states follow; when they are flown again they begin at it. */
void controller_set_axes(controller_state *s, uint32_t axes);
/* command[CONTROLLER_NY] from measured, reference[CONTROLLER_NU], trim[CONTROLLER_NY], the commands
   applied on axes that are not flown, others[CONTROLLER_NY] (NULL: their trim), and the parameter,
   @parameter@ (@unit@) @follow@, with whether it is trusted. A number that is not finite marks a
   missing one. */
int controller_update(controller_state *s, const float *measured, const float *reference,
                      const float *trim, const float *others, float parameter, int parameter_valid,
                      float *command);
#ifdef __cplusplus
}
#endif
#endif
