/* See controller.h. */
#include "controller.h"

#ifdef __FAST_MATH__
#error "without -ffast-math: numbers that are not finite must be seen"
#endif

enum { NX = CONTROLLER_NX, NU = CONTROLLER_NU, NY = CONTROLLER_NY };
enum { OWN = NX + NU, COLUMNS = OWN + NY };
enum { GROUND, IN_FORCE, UNDER_WAY };
enum { NEVER = 1 << 30 };

/* matrices: [A B L; C D 0], row by row, knot by knot */
/* @tables@ */

static int is_finite(float value) { return value - value == 0; }

static float clipped(float value, float low, float high)
{
    return value < low ? low : value > high ? high : value;
}

static void start(controller_state *s, const float *command)
{
    for (int i = 0; i < NX; i++) s->x[i] = 0;
    for (int i = 0; i < NY; i++) {
        s->command[i] = command ? command[i] : 0;
        s->offset[i] = 0;
        s->entry[i] = command ? IN_FORCE : GROUND;
    }
    s->target = s->filtered = s->used = 0;
    s->reading = 0;
    s->same = -1; /* no reading yet */
    s->bad = s->started = 0;
}

void controller_init(controller_state *s)
{
    s->axes = (1u << NY) - 1;
    controller_reset(s);
}

void controller_reset(controller_state *s) { start(s, 0); }

void controller_enter(controller_state *s, const float *command) { start(s, command); }

void controller_set_axes(controller_state *s, uint32_t axes) { s->axes = axes; }

/* Move the parameter in use towards a reading, or what stands for a bad one. */
static int follow_parameter(controller_state *s, float reading, int valid)
{
    const int again = s->same >= 0 && reading == s->reading;
    int status = 0;
    s->same = !again ? 0 : s->same < NEVER - 1 ? s->same + 1 : s->same;
    s->reading = reading;
    if (valid && reading >= plausible[0] && reading <= plausible[1] && s->same < frozen) {
        s->bad = 0;
        s->target = clipped(reading, knots[0], knots[KNOTS - 1]);
    } else {
        status |= CONTROLLER_PARAMETER;
        if (s->bad < NEVER) s->bad++;
        if (!s->started || s->bad > hold) {
            status |= CONTROLLER_FALLBACK;
            s->target = fallback;
        }
    }
    if (!s->started) {
        s->started = 1;
        s->filtered = s->used = s->target;
        return status;
    }
    if (gain < 1)
        s->filtered = s->filtered + gain * (s->target - s->filtered);
    else
        s->filtered = s->target;
    s->used = clipped(s->used + clipped(s->filtered - s->used, -step, step), knots[0],
                      knots[KNOTS - 1]);
    return status;
}

/* The interval of p, in as many halvings wherever p is. */
static int interval(float p)
{
    int below = 0, above = KNOTS - 1;
    for (int i = 0; i < SEARCHES; i++) {
        const int middle = (below + above) / 2;
        if (middle == below) break;
        if (p >= knots[middle])
            below = middle;
        else
            above = middle;
    }
    return below;
}

/* Columns first .. last - 1 of a row at a weight between two knots, times v; from the first on. */
static float times(const float *below, const float *above, float weight, int first, int last,
                   const float *v)
{
    float sum = 0;
    for (int j = first; j < last; j++) {
        const float entry = below[j] + weight * (above[j] - below[j]);
        const float product = entry * v[j - first];
        sum = j == first ? product : sum + product;
    }
    return sum;
}

int controller_update(controller_state *s, const float *measured, const float *reference,
                      const float *trim, const float *others, float parameter, int parameter_valid,
                      float *command)
{
    int status = follow_parameter(s, parameter, parameter_valid);
    const int i0 = interval(s->used);
    const float weight = (s->used - knots[i0]) / (knots[i0 + 1] - knots[i0]);
    const float *below = matrices + i0 * (NX + NY) * COLUMNS, *above = below + (NX + NY) * COLUMNS;
    float v[OWN], answer[NX + NY], excess[NY], plain[NY], applied[NY], before[NY];
    int sound = 1, saturated = 0, windup = 0;

    for (int j = 0; j < NX; j++) v[j] = s->x[j];
    for (int j = 0; j < NU; j++) v[NX + j] = measured[j] - reference[j];
    for (int i = 0; i < NX + NY; i++)
        answer[i] = times(below + i * COLUMNS, above + i * COLUMNS, weight, 0, OWN, v);
    for (int i = 0; i < NY; i++) {
        const int flown = s->axes >> i & 1;
        const int entering = flown && s->entry[i] == IN_FORCE;
        const float other = others ? others[i] : trim[i];
        float wanted;
        before[i] = s->entry[i] == GROUND && is_finite(trim[i]) ? trim[i] : s->command[i];
        plain[i] = (integrates[i] ? before[i] : trim[i]) + answer[NX + i];
        wanted = plain[i] + s->offset[i];
        if (!flown)
            applied[i] = is_finite(other) ? other : before[i];
        else
            applied[i] = clipped(entering ? before[i] : wanted, limits[i][0], limits[i][1]);
        if (entering) wanted = applied[i];
        excess[i] = applied[i] - wanted;
        if (excess[i] != 0) {
            windup = 1;
            if (flown) saturated = 1;
        }
        sound = sound && is_finite(wanted);
    }
    if (windup)
        for (int i = 0; i < NX; i++)
            answer[i] = answer[i]
                        + times(below + i * COLUMNS, above + i * COLUMNS, weight, OWN, COLUMNS,
                                excess);
    for (int i = 0; i < NX; i++) sound = sound && is_finite(answer[i]);

    for (int i = 0; i < NY; i++) {
        const int flown = s->axes >> i & 1;
        const float kept = s->entry[i] == IN_FORCE ? applied[i] - plain[i] : s->offset[i];
        if (sound) s->offset[i] = fade * (flown && !integrates[i] ? kept : 0);
        if (!flown)
            s->entry[i] = IN_FORCE;
        else if (sound)
            s->entry[i] = UNDER_WAY;
        s->command[i] = command[i] = flown && !sound ? before[i] : applied[i];
    }
    if (!sound) return status | CONTROLLER_HELD;
    for (int i = 0; i < NX; i++) s->x[i] = answer[i];
    return saturated ? status | CONTROLLER_SATURATED : status;
}
