/* An instance of the unit as FMI sees it, of either version: its life cycle, and calls that are refused with a reason.

   The adapters (fmi2*.c, fmi3*.c) translate types and names; what a call does and when it is allowed is decided here.
   Statuses have the same numbers in FMI 2 and 3. */

#ifndef BARYSCOPE_INSTANCE_H
#define BARYSCOPE_INSTANCE_H

#include "dialect.h"
#include "unit.h"

#include <stdint.h>

#define LINE_SIZE (MESSAGE_SIZE + 128) /* of a message after the name of the function that was called */
#define MARK 0x62617279u /* tells an instance from most other pointers */

typedef enum { OK = 0, WARNING = 1, DISCARD = 2, ERROR = 3 } Status;

/* Categories of messages, that of the description at their places in CATEGORIES. */
typedef enum { ON_EVENTS, ON_WARNINGS, ON_ERRORS, N_CATEGORIES } Category;
/* Importers that compile the sources define the names without FOR_ as macros. */
typedef enum { FOR_MODEL_EXCHANGE, FOR_CO_SIMULATION } Interface;

enum { INSTANTIATED = 1, INITIALIZATION = 2, STEPPING = 4, EVENT = 8, CONTINUOUS = 16, TERMINATED = 32 };

typedef struct Instance Instance;
typedef void Log(const Instance *instance, Status status, const char *category, const char *message);

/* What a saved state holds. */
typedef struct {
    unsigned state;
    Interface interface;
    double stop_time; /* infinite when none is given */
    Unit unit;
} Core;

struct Instance {
    unsigned mark;
    Log *log;
    void (*logger)(void); /* the importer's, of the version's type */
    void *environment;
    bool logs[N_CATEGORIES];
    Core core;
    char name[]; /* whole: importers know their instances by it */
};

/* Calls that are allowed in the same states. */
typedef enum {
    SET_LOGGING, SETUP, ENTER_INITIALIZATION, EXIT_INITIALIZATION, TERMINATE, RESET, GET_VALUES, SET_VALUES, DO_STEP,
    CANCEL_STEP, SET_INPUT_DERIVATIVES, GET_STATUS, SAVE_STATE, GET_DERIVATIVES, GET_OUTPUT_DERIVATIVES, ENTER_EVENT,
    ENTER_CONTINUOUS, DISCRETE_STATES, SET_TIME, SET_STATES, GET_STATES, COMPLETE_STEP, ASK, N_CALLS
} Call;

/* ---- life cycle (instance.c) ---- */

static Instance *instance_create(const char *name, Interface interface, const char *token, Log *log, void (*logger)(void),
                                 void *environment, bool log_events);
static void instance_free(void *component);

/* The instance behind a component, if it is one and its state allows the call; else NULL, with a message. */
static Instance *enter(void *component, Call call, const char *function);

/* Log why a call is refused; the instance is unchanged. Returns ERROR. */
static Status refuse(const Instance *instance, const char *format, ...);

/* Log what a call that succeeds has left out. The call returns OK all the same: many importers stop at a warning. */
static void remark(const Instance *instance, const char *format, ...);

static Status instance_set_logging(void *component, const char *function, bool on, size_t count, const char *const *categories);
static Status instance_setup(Instance *instance, const char *function, bool tolerance_defined, double tolerance, double start,
                             bool stop_defined, double stop);
static Status instance_exit_initialization(void *component, const char *function);
static Status instance_move(void *component, Call call, const char *function, unsigned state);
static Status instance_reset(void *component, const char *function);

/* Compute the initial state if the parameters have changed since the last time. */
static Status initialise(Instance *instance, const char *function);

/* Refuse if the equations have no value at the states that were set. */
static Status check_states(Instance *instance, const char *function);

/* Bring values up to date by their kinds, if the states allow it. */
static Status update(Instance *instance, const char *function, unsigned kinds);

/* ---- values (values.c); `n_values` is the length of the array of values, which exceeds `count` where variables are arrays ---- */

/* The variables that a call asks for. */
typedef struct {
    const uint32_t *references;
    size_t count;
} Selection;

static Status instance_get(void *component, const char *function, Type type, Selection selection, void *values, size_t n_values);
static Status instance_set(void *component, const char *function, Type type, Selection selection, const void *values,
                           size_t n_values);
/* The unit has no variables of other types: every request but the empty one is refused. */
static Status instance_none(void *component, Call call, const char *function, const char *type, size_t count);

/* ---- stepping (step.c) ---- */

static Status instance_step(void *component, const char *function, double point, double step);

/* ---- derivatives, and continuous states for Model Exchange (continuous_calls.c; sampled_calls.c refuses them) ---- */

/* The image of a seed under the Jacobian of unknowns by knowns, or with `reverse` under its transpose. */
typedef struct {
    const double *values;
    size_t count;
} Seed;
typedef struct {
    double *values;
    size_t count;
} Image;
static Status instance_derivative(void *component, const char *function, bool reverse, Selection unknowns, Selection knowns,
                                  Seed seed, Image image);
#if FMI_VERSION == 2 /* in FMI 3 there are none */
static Status instance_set_input_derivatives(void *component, const char *function, Selection selection, const int32_t *orders,
                                             const double *values);
#endif
static Status instance_output_derivatives(void *component, const char *function, Selection selection, const int32_t *orders,
                                          double *values, size_t n_values);
static Status instance_set_time(void *component, const char *function, double time);
static Status instance_set_states(void *component, const char *function, const double *states, size_t count);
static Status instance_get_states(void *component, const char *function, unsigned kind, double *values, size_t count);
static Status instance_get_nominals(void *component, const char *function, double *values, size_t count);

/* ---- saved states (saved.c) ---- */

static Status instance_save(void *component, const char *function, void **saved);
static Status instance_restore(void *component, const char *function, const void *saved);
static Status instance_free_state(void *component, const char *function, void **saved);
static Status instance_saved_size(void *component, const char *function, const void *saved, size_t *size);
static Status instance_serialise(void *component, const char *function, const void *saved, unsigned char *bytes, size_t size);
static Status instance_deserialise(void *component, const char *function, const unsigned char *bytes, size_t size,
                                   void **saved);

#endif
