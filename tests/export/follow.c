/* A controller that commands the reference, as an FMU: FMI 3.0, or 2.0 with -DTWO; and with faults, for the tests. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define JOINTS 6
/* Value references: 0..5 reference positions, 10..15 commands. */
typedef struct {
    double in[JOINTS], out[JOINTS], time;
} Instance;

static int set(Instance *i, const uint32_t *vr, size_t n, const double *v)
{
    for (size_t k = 0; k < n; k++)
        if (vr[k] < JOINTS) i->in[vr[k]] = v[k];
        else return 3;
    return 0;
}

static int get(Instance *i, const uint32_t *vr, size_t n, double *v)
{
    for (size_t k = 0; k < n; k++)
        if (vr[k] >= 10 && vr[k] < 10 + JOINTS) v[k] = i->out[vr[k] - 10];
        else return 3;
    return 0;
}

static int step(Instance *i, double from, double by)
{
    i->time = from + by;
    memcpy(i->out, i->in, sizeof i->out);
#ifdef HANG
    if (i->time > 0.1) pause();
#endif
#ifdef CRASH
    if (i->time > 0.1) abort();
#endif
#ifdef BAD
    if (i->time > 0.1) i->out[2] = NAN;
#endif
#ifdef ERRS
    if (i->time > 0.1) return 3;
#endif
    return 0;
}

#ifdef TWO
typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} Callbacks;

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *uri, const Callbacks *callbacks, int visible, int logging)
{
    if (type != 1 || strcmp(guid, "follow") || strncmp(uri, "file:///", 8)) {
        callbacks->logger(NULL, name, 3, "error", "not what the description says: %d", type);
        return NULL;
    }
    return callbacks->allocate(1, sizeof(Instance));
}
int fmi2SetupExperiment(void *c, int a, double b, double d, int e, double f) { return 0; }
int fmi2EnterInitializationMode(void *c) { return 0; }
int fmi2ExitInitializationMode(void *c) { return 0; }
int fmi2Terminate(void *c) { return 0; }
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetReal(void *c, const uint32_t *vr, size_t n, const double *v) { return set(c, vr, n, v); }
int fmi2GetReal(void *c, const uint32_t *vr, size_t n, double *v) { return get(c, vr, n, v); }
int fmi2DoStep(void *c, double from, double by, int no_state) { return step(c, from, by); }
#else
typedef void Log(void *, int, const char *, const char *);

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *path, bool visible, bool logging, bool events, bool early,
                                  const uint32_t *required, size_t n, void *environment, Log *log, void *update)
{
    if (strcmp(token, "follow") || events || path[strlen(path) - 1] != '/') {
        log(environment, 3, "error", "not what the description says");
        return NULL;
    }
    return calloc(1, sizeof(Instance));
}
int fmi3EnterInitializationMode(void *c, bool a, double b, double d, bool e, double f) { return 0; }
int fmi3ExitInitializationMode(void *c) { return 0; }
int fmi3Terminate(void *c) { return 0; }
void fmi3FreeInstance(void *c) { free(c); }
int fmi3SetFloat64(void *c, const uint32_t *vr, size_t n, const double *v, size_t m) { return m == n ? set(c, vr, n, v) : 3; }
int fmi3GetFloat64(void *c, const uint32_t *vr, size_t n, double *v, size_t m) { return m == n ? get(c, vr, n, v) : 3; }
int fmi3DoStep(void *c, double from, double by, bool no_state, bool *event, bool *end, bool *early, double *last)
{
    *event = *end = *early = false;
    *last = from + by;
    return step(c, from, by);
}
#endif
