/* Monitor of the hypotheses under which a certificate over @parameter@ holds, for every @dt@ s.

     range     @low@ to @high@
     rate      |p(k) - p(k-j)| <= @rate@ (t(k) - t(k-j)) + @noise@   for j = 1 .. @samples@: just
               then some p(t) within the rate passes all these readings within half of @noise@;
               what p does between two samples is not seen
     period    @shortest@ to @longest@ s since the sample before
     commands  within their limits, none at one

   32-bit numbers, @parameter@ in @unit@, commands in their units. No allocation, no library.
   monitor_init once, then monitor_update every sample. 0 says that all hypotheses are met.
*/
#ifndef MONITOR_H
#define MONITOR_H

#include <stdint.h>

/* sizes; indices and units of the commands with their limits */
/* @sizes@ */

/* What is not met: bits. MISSING: a reading or command that is no finite number, or not trusted.
   UNKNOWN: the window is not full, at the start and after a sample that was missing or off its
   period. */
enum {
    MONITOR_MET = 0,
    MONITOR_RANGE = 1,
    MONITOR_RATE = 2,
    MONITOR_SATURATED = 4,
    MONITOR_PERIOD = 8,
    MONITOR_MISSING = 16,
    MONITOR_UNKNOWN = 32
};

typedef struct {
    float reading[MONITOR_WINDOW], elapsed[MONITOR_WINDOW]; /* newest first */
    int32_t filled, started;
} monitor_state;

#ifdef __cplusplus
extern "C" {
#endif
/* No sample yet. */
void monitor_init(monitor_state *s);
/* The bits above, from @parameter@ (@unit@) as measured, with whether it is trusted, the seconds
   since the sample before as measured (anything at the first), and command[MONITOR_NY]. */
int monitor_update(monitor_state *s, float parameter, int parameter_valid, float elapsed,
                   const float *command);
#ifdef __cplusplus
}
#endif
#endif
