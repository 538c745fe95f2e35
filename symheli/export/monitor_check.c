/* Does the monitor say what Python said? Exit status 0: every status. */
#include <math.h>
#include <stdio.h>
#include "monitor.h"

/* given: parameter, seconds, commands; whether the parameter is trusted; expected: statuses */
/* @cases@ */

int main(void)
{
    monitor_state s;
    int equal = 0, met = 0;
    monitor_init(&s);
    for (int k = 0; k < SAMPLES; k++) {
        const float *command = given[k] + 2;
        const int status = monitor_update(&s, given[k][0], valid[k], given[k][1], command);
        equal += status == expected[k];
        met += status == MONITOR_MET;
    }
    printf("monitor: %d of %d statuses equal, all hypotheses met in %d\n", equal, SAMPLES, met);
    return equal != SAMPLES;
}
