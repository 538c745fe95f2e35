/* See monitor.h. */
#include "monitor.h"

#ifdef __FAST_MATH__
#error "without -ffast-math: numbers that are not finite must be seen"
#endif

enum { WINDOW = MONITOR_WINDOW, NY = MONITOR_NY };

/* @constants@ */

static int is_finite(float value) { return value - value == 0; }

/* Whether a difference to one of the readings before is more than the rate allows. */
static int too_fast(const monitor_state *s, float parameter, int filled)
{
    float time = 0;
    int found = 0;
    for (int j = 0; j < WINDOW; j++) {
        const float change = parameter - s->reading[j];
        if (j >= filled) break;
        time = j == 0 ? s->elapsed[j] : time + s->elapsed[j];
        if (!((change < 0 ? -change : change) <= rate * time + noise)) found = 1;
    }
    return found;
}

static int commanded(const float *command)
{
    int status = MONITOR_MET;
    for (int i = 0; i < NY; i++) {
        if (!is_finite(command[i])) status |= MONITOR_MISSING;
        if (command[i] <= limits[i][0] || command[i] >= limits[i][1]) status |= MONITOR_SATURATED;
    }
    return status;
}

void monitor_init(monitor_state *s)
{
    for (int j = 0; j < WINDOW; j++) s->reading[j] = s->elapsed[j] = 0;
    s->filled = s->started = 0;
}

int monitor_update(monitor_state *s, float parameter, int parameter_valid, float elapsed,
                   const float *command)
{
    const int known = parameter_valid && is_finite(parameter);
    const int kept = elapsed >= shortest && elapsed <= longest;
    const int filled = s->started && known && kept ? s->filled : 0;
    int status = commanded(command);
    if (!known)
        status |= MONITOR_MISSING;
    else if (!(parameter >= low && parameter <= high))
        status |= MONITOR_RANGE;
    if (s->started && !kept) status |= MONITOR_PERIOD;
    for (int j = WINDOW - 1; j > 0; j--) s->elapsed[j] = s->elapsed[j - 1];
    s->elapsed[0] = elapsed;
    if (too_fast(s, parameter, filled)) status |= MONITOR_RATE;
    if (filled < WINDOW) status |= MONITOR_UNKNOWN;
    for (int j = WINDOW - 1; j > 0; j--) s->reading[j] = s->reading[j - 1];
    s->reading[0] = parameter;
    s->filled = !known ? 0 : filled < WINDOW ? filled + 1 : WINDOW;
    s->started = 1;
    return status;
}
