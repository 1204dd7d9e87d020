/* A mass on a spring with a cubic part, as an FMU for co-simulation: of FMI 3.0, and with -DFMI2 of FMI 2.0.
 *
 *     m a = F - c v - k x - k3 x^3
 *
 * A communication step is made of classical Runge-Kutta steps of at most 50 us. A few functions of the standard are
 * enough for an importer that knows no others; a tool may ask for all of them. `fault` makes it misbehave from the time
 * `fault_s` on, for tests of importers. */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

enum { FORCE = 1, X, V, A, MASS, STIFFNESS, DAMPING, CUBIC, FAULT, FAULT_S, VARIABLES };
enum {
    NONE, RETURNS_ERROR, DISCARDS, TERMINATES, STOPS_EARLY, GIVES_NAN, NEVER_THE_SAME, ROUNDS_OTHERWISE, REFUSES,
    ROUNDS_AND_FAILS, EXITS, CRASHES, PRINTS
};
enum { OK, WARNING, DISCARD, ERROR };

static const char TOKEN[] = "{mass-1}";

typedef struct {
    double value[VARIABLES];
    double time;
} Mass;

/* Shared by all instances of one file: an importer that loads a file twice sees it. */
static int instances;

static double acceleration(const Mass *m, double x, double v)
{
    const double *p = m->value;
    return (p[FORCE] - p[DAMPING] * v - p[STIFFNESS] * x - p[CUBIC] * x * x * x) / p[MASS];
}

static void *make(const char *token)
{
    Mass *m = calloc(1, sizeof *m);
    if (m == NULL || strcmp(token, TOKEN) != 0 || instances > 0) {
        free(m);
        return NULL;
    }
    instances++;
    m->value[MASS] = 2.0;
    m->value[STIFFNESS] = 31582.734;
    m->value[DAMPING] = 5.0;
    return m;
}

static void release(void *instance)
{
    instances--;
    free(instance);
}

static int set(Mass *m, const unsigned references[], size_t count, const double values[])
{
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= VARIABLES) {
            return ERROR;
        }
        m->value[references[i]] = values[i];
    }
    return OK;
}

static int get(Mass *m, const unsigned references[], size_t count, double values[])
{
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= VARIABLES) {
            return ERROR;
        }
        values[i] = m->value[references[i]];
        if (references[i] == A) {
            values[i] = acceleration(m, m->value[X], m->value[V]);
        }
    }
    return OK;
}

static void integrate(Mass *m, double h)
{
    double x = m->value[X], v = m->value[V];
    double v1 = v, a1 = acceleration(m, x, v1);
    double v2 = v + h / 2 * a1, a2 = acceleration(m, x + h / 2 * v1, v2);
    double v3 = v + h / 2 * a2, a3 = acceleration(m, x + h / 2 * v2, v3);
    double v4 = v + h * a3, a4 = acceleration(m, x + h * v3, v4);
    m->value[X] = x + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
    m->value[V] = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
}

/* A step up to a time; how it ended, and the time that was reached. */
static int step(Mass *m, double from, double length, bool *terminates, double *reached)
{
    bool faults = m->value[FAULT] != NONE && from >= m->value[FAULT_S];
    int fault = faults ? (int)m->value[FAULT] : NONE;
    int parts = (int)ceil(length / 50e-6 - 1e-6);
    if (fault == STOPS_EARLY) {
        length /= 2;
    }
    for (int part = 0; part < parts; part++) {
        integrate(m, length / parts);
    }
    if (fault == GIVES_NAN) {
        m->value[X] = NAN;
    }
    if (fault == NEVER_THE_SAME) {
        struct timespec now;
        timespec_get(&now, TIME_UTC);
        m->value[X] += 1e-15 * (double)now.tv_nsec;
    }
    if (fault == EXITS) {
        exit(0);
    }
    if (fault == CRASHES) {
        abort();
    }
    if (fault == PRINTS) {
        puts("{\"samples\": 999999}");
    }
#if defined(__x86_64__)
    if (fault == ROUNDS_OTHERWISE || fault == ROUNDS_AND_FAILS) {
        _mm_setcsr(_mm_getcsr() | 0x8040);
    }
#endif
    m->time = *reached = from + length;
    *terminates = fault == TERMINATES;
    bool fails = fault == RETURNS_ERROR || fault == ROUNDS_AND_FAILS;
    return fails ? ERROR : fault == DISCARDS ? DISCARD : OK;
}

#ifdef FMI2

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} Callbacks;

static bool discarded_at_end;
static double discarded_at;

void *fmi2Instantiate(const char *name, int kind, const char *token, const char *resources, const Callbacks *callbacks,
                      int visible, int logging)
{
    (void)visible, (void)logging;
    void *made = kind == 1 && strncmp(resources, "file:///", 8) == 0 ? make(token) : NULL;
    if (made == NULL) {
        callbacks->logger(callbacks->environment, name, ERROR, "logStatusError", "another token than %s", TOKEN);
    }
    return made;
}
void fmi2FreeInstance(void *instance) { release(instance); }
int fmi2SetupExperiment(void *i, int has_tolerance, double tolerance, double start, int has_stop, double stop)
{
    (void)i, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return OK;
}
int fmi2EnterInitializationMode(void *instance) { return ((Mass *)instance)->value[FAULT] == REFUSES ? ERROR : OK; }
int fmi2ExitInitializationMode(void *instance) { return instance == NULL ? ERROR : OK; }
int fmi2Terminate(void *instance) { return instance == NULL ? ERROR : OK; }
int fmi2SetReal(void *i, const unsigned r[], size_t n, const double v[]) { return set(i, r, n, v); }
int fmi2GetReal(void *i, const unsigned r[], size_t n, double v[]) { return get(i, r, n, v); }
int fmi2DoStep(void *instance, double from, double length, int keeps_no_state)
{
    (void)keeps_no_state;
    int status = step(instance, from, length, &discarded_at_end, &discarded_at);
    return discarded_at_end || discarded_at != from + length ? DISCARD : status;
}
int fmi2GetRealStatus(void *instance, int kind, double *value)
{
    (void)instance;
    *value = discarded_at;
    return kind == 2 ? OK : ERROR;
}
int fmi2GetBooleanStatus(void *instance, int kind, int *value)
{
    (void)instance;
    *value = discarded_at_end;
    return kind == 3 ? OK : ERROR;
}

#else

typedef void Log(void *, int, const char *, const char *);

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                  bool logging, bool event_mode, bool early_return, const unsigned intermediate[],
                                  size_t intermediate_count, void *environment, Log *log, void *update)
{
    (void)name, (void)visible, (void)logging, (void)intermediate, (void)intermediate_count, (void)update;
    size_t length = strlen(resources);
    bool fits = !event_mode && !early_return && length > 0 && resources[length - 1] == '/';
    void *made = fits ? make(token) : NULL;
    if (made == NULL) {
        log(environment, ERROR, "logStatusError", "another token than {mass-1}");
    }
    return made;
}
void fmi3FreeInstance(void *instance) { release(instance); }
int fmi3EnterInitializationMode(void *i, bool has_tolerance, double tolerance, double start, bool has_stop, double stop)
{
    (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return ((Mass *)i)->value[FAULT] == REFUSES ? ERROR : OK;
}
int fmi3ExitInitializationMode(void *instance) { return instance == NULL ? ERROR : OK; }
int fmi3Terminate(void *instance) { return instance == NULL ? ERROR : OK; }
int fmi3SetFloat64(void *i, const unsigned r[], size_t n, const double v[], size_t values)
{
    return values == n ? set(i, r, n, v) : ERROR;
}
int fmi3GetFloat64(void *i, const unsigned r[], size_t n, double v[], size_t values)
{
    return values == n ? get(i, r, n, v) : ERROR;
}
int fmi3DoStep(void *instance, double from, double length, bool keeps_no_state, bool *event, bool *terminates,
               bool *early, double *reached)
{
    (void)keeps_no_state;
    *event = *early = false;
    return step(instance, from, length, terminates, reached);
}

#endif
