/* FMI 3.0 for co-simulation around one model: what the interface specification of the Modelica
   Association names and types, written out here. Instances share nothing.

   The file that includes this one has defined before: N_REAL (variables of 64 bits, the first of
   them time), N_WHOLE (of 32 bits, whole, behind them), TOKEN, names[N_REAL], kinds[N_REAL],
   starts[N_REAL] and `model`; after it come model_begin and model_step. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(__GNUC__)
/* most functions refuse, whatever they are given */
#pragma GCC diagnostic ignored "-Wunused-parameter"
#define EXPORTED __attribute__((visibility("default")))
#elif defined(_WIN32)
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED
#endif

#ifdef FMI3_FUNCTION_PREFIX
#define PASTED_(prefix, name) prefix##name
#define PASTED(prefix, name) PASTED_(prefix, name)
#define NAMED(name) PASTED(FMI3_FUNCTION_PREFIX, name)
#else
#define NAMED(name) name
#endif

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void *fmi3Instance;
typedef void *fmi3FMUState;
typedef void *fmi3Environment;
typedef uint32_t fmi3Reference;
typedef const char *fmi3String;
typedef const uint8_t *fmi3Binary;
typedef void (*fmi3Log)(fmi3Environment, fmi3Status, fmi3String, fmi3String);
typedef void (*fmi3Callback)(void);

enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED, FAILED };

typedef struct {
    model own;
    double real[N_REAL];
    int whole[N_WHOLE > 0 ? N_WHOLE : 1];
    int mode;
} memory;

typedef struct {
    memory now;
    fmi3Environment environment;
    fmi3Log log;
    char name[64];
} instance;

/* At a start, and over a step: what is wrong, or 0. */
static const char *model_begin(model *m, double *real, int *whole);
static const char *model_step(model *m, double *real, int *whole, double step);

/* The status, told with the instance's name. */
static fmi3Status told(instance *i, fmi3Status status, const char *message, const char *about)
{
    char text[256];
    if (i->log) {
        snprintf(text, sizeof text, "%s: %s%s", i->name, about, message);
        i->log(i->environment, status, "logStatusError", text);
    }
    return status;
}

static fmi3Status refused(fmi3Instance given, const char *function)
{
    return given ? told(given, fmi3Error, " is not supported by this model", function) : fmi3Error;
}

static void clear(instance *i)
{
    memset(&i->now, 0, sizeof i->now);
    memcpy(i->now.real, starts, sizeof starts);
}

static int in_mode(const instance *i, int first, int last)
{
    return i && i->now.mode >= first && i->now.mode <= last;
}

#define EXPECT(first, last, function) \
    if (!in_mode(given, first, last)) \
    return given ? told(given, fmi3Error, " is not allowed now", function) : fmi3Error

EXPORTED const char *NAMED(fmi3GetVersion)(void) { return "3.0"; }

EXPORTED fmi3Status NAMED(fmi3SetDebugLogging)(fmi3Instance given, _Bool on, size_t count,
                                               const fmi3String *categories)
{
    return given ? fmi3OK : fmi3Error;
}

EXPORTED fmi3Instance NAMED(fmi3InstantiateCoSimulation)(
    fmi3String name, fmi3String token, fmi3String resources, _Bool visible, _Bool logging,
    _Bool events, _Bool early, const fmi3Reference *intermediate, size_t count,
    fmi3Environment environment, fmi3Log log, fmi3Callback update)
{
    instance *i = calloc(1, sizeof *i);
    if (!i) return 0;
    i->environment = environment;
    i->log = log;
    snprintf(i->name, sizeof i->name, "%s", name ? name : "");
    clear(i);
    if (!token || strcmp(token, TOKEN) != 0) {
        told(i, fmi3Error, "the instantiation token is that of another FMU", "");
        free(i);
        return 0;
    }
    return i;
}

EXPORTED fmi3Instance NAMED(fmi3InstantiateModelExchange)(fmi3String name, fmi3String token,
                                                          fmi3String resources, _Bool visible,
                                                          _Bool logging,
                                                          fmi3Environment environment, fmi3Log log)
{
    return 0;
}

EXPORTED fmi3Instance NAMED(fmi3InstantiateScheduledExecution)(
    fmi3String name, fmi3String token, fmi3String resources, _Bool visible, _Bool logging,
    fmi3Environment environment, fmi3Log log, fmi3Callback update, fmi3Callback lock,
    fmi3Callback unlock)
{
    return 0;
}

EXPORTED void NAMED(fmi3FreeInstance)(fmi3Instance given) { free(given); }

static fmi3Status result(instance *i, const char *wrong)
{
    if (!wrong) return fmi3OK;
    i->now.mode = FAILED;
    return told(i, fmi3Error, wrong, "");
}

EXPORTED fmi3Status NAMED(fmi3EnterInitializationMode)(fmi3Instance given, _Bool tolerated,
                                                       double tolerance, double start, _Bool stops,
                                                       double stop)
{
    instance *i = given;
    EXPECT(INSTANTIATED, INSTANTIATED, "fmi3EnterInitializationMode");
    if (!isfinite(start)) return told(i, fmi3Error, "the start time is not finite", "");
    i->now.real[0] = start;
    i->now.mode = INITIALIZING;
    return result(i, model_begin(&i->now.own, i->now.real, i->now.whole));
}

EXPORTED fmi3Status NAMED(fmi3ExitInitializationMode)(fmi3Instance given)
{
    instance *i = given;
    EXPECT(INITIALIZING, INITIALIZING, "fmi3ExitInitializationMode");
    i->now.mode = STEPPING;
    return result(i, model_begin(&i->now.own, i->now.real, i->now.whole));
}

EXPORTED fmi3Status NAMED(fmi3Terminate)(fmi3Instance given)
{
    EXPECT(STEPPING, STEPPING, "fmi3Terminate");
    ((instance *)given)->now.mode = TERMINATED;
    return fmi3OK;
}

EXPORTED fmi3Status NAMED(fmi3Reset)(fmi3Instance given)
{
    if (!given) return fmi3Error;
    clear(given);
    return fmi3OK;
}

EXPORTED fmi3Status NAMED(fmi3DoStep)(fmi3Instance given, double now, double step, _Bool final,
                                      _Bool *event, _Bool *end, _Bool *early, double *reached)
{
    instance *i = given;
    double *time;
    EXPECT(STEPPING, STEPPING, "fmi3DoStep");
    time = &i->now.real[0];
    *event = *end = *early = 0;
    *reached = *time;
    if (!(fabs(now - *time) <= 1e-9 * (1 + fabs(*time))))
        return told(i, fmi3Error, "the step does not begin where the one before ended", "");
    if (!(step > 0 && isfinite(step)))
        return told(i, fmi3Error, "the step is no positive number of seconds", "");
    if (!(now + step > now))
        return told(i, fmi3Error, "the step is too short for a time so large", "");
    if (result(i, model_step(&i->now.own, i->now.real, i->now.whole, step)) != fmi3OK)
        return fmi3Error;
    *reached = *time = now + step;
    return fmi3OK;
}

/* --- variables --- */

EXPORTED fmi3Status NAMED(fmi3GetFloat64)(fmi3Instance given, const fmi3Reference *which,
                                          size_t count, double *values, size_t room)
{
    instance *i = given;
    const double *from;
    memory begun;
    EXPECT(INSTANTIATED, FAILED, "fmi3GetFloat64");
    from = i->now.real;
    if (i->now.mode == INITIALIZING) { /* outputs of what is set by now; nothing is kept */
        const char *wrong;
        begun = i->now;
        if ((wrong = model_begin(&begun.own, begun.real, begun.whole)))
            return told(i, fmi3Error, wrong, "fmi3GetFloat64: ");
        from = begun.real;
    }
    if (room < count) return told(i, fmi3Error, "fmi3GetFloat64: too few values", "");
    for (size_t k = 0; k < count; k++) {
        if (which[k] >= N_REAL)
            return told(i, fmi3Error, "fmi3GetFloat64: no such value reference", "");
        values[k] = from[which[k]];
    }
    return fmi3OK;
}

EXPORTED fmi3Status NAMED(fmi3SetFloat64)(fmi3Instance given, const fmi3Reference *which,
                                          size_t count, const double *values, size_t room)
{
    instance *i = given;
    EXPECT(INSTANTIATED, STEPPING, "fmi3SetFloat64");
    if (room < count) return told(i, fmi3Error, "fmi3SetFloat64: too few values", "");
    for (size_t k = 0; k < count; k++) {
        if (which[k] >= N_REAL)
            return told(i, fmi3Error, "fmi3SetFloat64: no such value reference", "");
        if (kinds[which[k]] == GIVEN || (kinds[which[k]] == STARTED && i->now.mode == STEPPING))
            return told(i, fmi3Error, " cannot be set now", names[which[k]]);
        if (!isfinite(values[k]))
            return told(i, fmi3Error, " is set to a value that is not finite", names[which[k]]);
    }
    for (size_t k = 0; k < count; k++) i->now.real[which[k]] = values[k];
    return fmi3OK;
}

EXPORTED fmi3Status NAMED(fmi3GetInt32)(fmi3Instance given, const fmi3Reference *which,
                                        size_t count, int32_t *values, size_t room)
{
    instance *i = given;
    EXPECT(INSTANTIATED, FAILED, "fmi3GetInt32");
    if (room < count) return told(i, fmi3Error, "fmi3GetInt32: too few values", "");
    for (size_t k = 0; k < count; k++) {
        if (which[k] < N_REAL || which[k] >= N_REAL + N_WHOLE)
            return told(i, fmi3Error, "fmi3GetInt32: no such value reference", "");
        values[k] = i->now.whole[which[k] - N_REAL];
    }
    return fmi3OK;
}

/* A type that no variable has: no variable may be asked for. */
#define NOTHING_OF(name, type) \
    EXPORTED fmi3Status NAMED(name)(fmi3Instance given, const fmi3Reference *which, size_t count, \
                                    type *values, size_t room) \
    { \
        return count == 0 ? fmi3OK : refused(given, #name); \
    }
NOTHING_OF(fmi3GetFloat32, float)
NOTHING_OF(fmi3GetInt8, int8_t)
NOTHING_OF(fmi3GetUInt8, uint8_t)
NOTHING_OF(fmi3GetInt16, int16_t)
NOTHING_OF(fmi3GetUInt16, uint16_t)
NOTHING_OF(fmi3GetUInt32, uint32_t)
NOTHING_OF(fmi3GetInt64, int64_t)
NOTHING_OF(fmi3GetUInt64, uint64_t)
NOTHING_OF(fmi3GetBoolean, _Bool)
NOTHING_OF(fmi3GetString, fmi3String)
NOTHING_OF(fmi3SetFloat32, const float)
NOTHING_OF(fmi3SetInt8, const int8_t)
NOTHING_OF(fmi3SetUInt8, const uint8_t)
NOTHING_OF(fmi3SetInt16, const int16_t)
NOTHING_OF(fmi3SetUInt16, const uint16_t)
NOTHING_OF(fmi3SetInt32, const int32_t)
NOTHING_OF(fmi3SetUInt32, const uint32_t)
NOTHING_OF(fmi3SetInt64, const int64_t)
NOTHING_OF(fmi3SetUInt64, const uint64_t)
NOTHING_OF(fmi3SetBoolean, const _Bool)
NOTHING_OF(fmi3SetString, const fmi3String)

/* --- the state of an instance --- */

EXPORTED fmi3Status NAMED(fmi3GetFMUState)(fmi3Instance given, fmi3FMUState *state)
{
    if (!given || !state) return fmi3Error;
    if (!*state && !(*state = malloc(sizeof(memory))))
        return told(given, fmi3Error, "no memory is left", "");
    memcpy(*state, &((instance *)given)->now, sizeof(memory));
    return fmi3OK;
}

EXPORTED fmi3Status NAMED(fmi3SetFMUState)(fmi3Instance given, fmi3FMUState state)
{
    if (!given || !state) return fmi3Error;
    memcpy(&((instance *)given)->now, state, sizeof(memory));
    return fmi3OK;
}

EXPORTED fmi3Status NAMED(fmi3FreeFMUState)(fmi3Instance given, fmi3FMUState *state)
{
    if (!given || !state) return fmi3Error;
    free(*state);
    *state = 0;
    return fmi3OK;
}

/* --- what a model of this kind does not offer --- */

#define REFUSED(name, ...) \
    EXPORTED fmi3Status NAMED(name)(fmi3Instance given, __VA_ARGS__) \
    { \
        return refused(given, #name); \
    }
#define REFUSED_MODE(name) \
    EXPORTED fmi3Status NAMED(name)(fmi3Instance given) { return refused(given, #name); }

REFUSED_MODE(fmi3EnterEventMode)
REFUSED_MODE(fmi3EnterStepMode)
REFUSED_MODE(fmi3EnterConfigurationMode)
REFUSED_MODE(fmi3ExitConfigurationMode)
REFUSED_MODE(fmi3EnterContinuousTimeMode)
REFUSED_MODE(fmi3EvaluateDiscreteStates)
REFUSED(fmi3GetBinary, const fmi3Reference *a, size_t b, size_t *c, fmi3Binary *d, size_t e)
REFUSED(fmi3SetBinary, const fmi3Reference *a, size_t b, const size_t *c, const fmi3Binary *d,
        size_t e)
REFUSED(fmi3GetClock, const fmi3Reference *a, size_t b, _Bool *c)
REFUSED(fmi3SetClock, const fmi3Reference *a, size_t b, const _Bool *c)
REFUSED(fmi3GetNumberOfVariableDependencies, fmi3Reference a, size_t *b)
REFUSED(fmi3GetVariableDependencies, fmi3Reference a, size_t *b, fmi3Reference *c, size_t *d,
        int *e, size_t f)
REFUSED(fmi3SerializedFMUStateSize, fmi3FMUState a, size_t *b)
REFUSED(fmi3SerializeFMUState, fmi3FMUState a, uint8_t *b, size_t c)
REFUSED(fmi3DeserializeFMUState, const uint8_t *a, size_t b, fmi3FMUState *c)
REFUSED(fmi3GetDirectionalDerivative, const fmi3Reference *a, size_t b, const fmi3Reference *c,
        size_t d, const double *e, size_t f, double *g, size_t h)
REFUSED(fmi3GetAdjointDerivative, const fmi3Reference *a, size_t b, const fmi3Reference *c,
        size_t d, const double *e, size_t f, double *g, size_t h)
REFUSED(fmi3GetIntervalDecimal, const fmi3Reference *a, size_t b, double *c, int *d)
REFUSED(fmi3GetIntervalFraction, const fmi3Reference *a, size_t b, uint64_t *c, uint64_t *d, int *e)
REFUSED(fmi3GetShiftDecimal, const fmi3Reference *a, size_t b, double *c)
REFUSED(fmi3GetShiftFraction, const fmi3Reference *a, size_t b, uint64_t *c, uint64_t *d)
REFUSED(fmi3SetIntervalDecimal, const fmi3Reference *a, size_t b, const double *c)
REFUSED(fmi3SetIntervalFraction, const fmi3Reference *a, size_t b, const uint64_t *c,
        const uint64_t *d)
REFUSED(fmi3SetShiftDecimal, const fmi3Reference *a, size_t b, const double *c)
REFUSED(fmi3SetShiftFraction, const fmi3Reference *a, size_t b, const uint64_t *c,
        const uint64_t *d)
REFUSED(fmi3UpdateDiscreteStates, _Bool *a, _Bool *b, _Bool *c, _Bool *d, _Bool *e, double *f)
REFUSED(fmi3CompletedIntegratorStep, _Bool a, _Bool *b, _Bool *c)
REFUSED(fmi3SetTime, double a)
REFUSED(fmi3SetContinuousStates, const double *a, size_t b)
REFUSED(fmi3GetContinuousStateDerivatives, double *a, size_t b)
REFUSED(fmi3GetEventIndicators, double *a, size_t b)
REFUSED(fmi3GetContinuousStates, double *a, size_t b)
REFUSED(fmi3GetNominalsOfContinuousStates, double *a, size_t b)
REFUSED(fmi3GetNumberOfEventIndicators, size_t *a)
REFUSED(fmi3GetNumberOfContinuousStates, size_t *a)
REFUSED(fmi3GetOutputDerivatives, const fmi3Reference *a, size_t b, const int32_t *c, double *d,
        size_t e)
REFUSED(fmi3ActivateModelPartition, fmi3Reference a, double b)
