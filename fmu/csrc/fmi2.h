/* What the files of the FMI 2.0 adapter share: the instance, its states, and how a call is refused. */

#ifndef BARYSCOPE_FMI2_H
#define BARYSCOPE_FMI2_H

#include "unit.h"

#include "fmi2Functions.h"

#define NAME_SIZE 128
#define MARK 0x62617279u /* tells an instance from any other pointer, as far as that can be told */

enum { INSTANTIATED = 1, INITIALIZATION = 2, STEPPING = 4, TERMINATED = 8 };
#define ANY (INSTANTIATED | INITIALIZATION | STEPPING | TERMINATED)

typedef struct {
    unsigned mark;
    unsigned state;
    char name[NAME_SIZE];
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    double stop_time; /* infinite when none is given */
    Unit unit;
} Instance;

typedef enum {
    SET_DEBUG_LOGGING, SETUP_EXPERIMENT, ENTER_INITIALIZATION, EXIT_INITIALIZATION, TERMINATE, RESET,
    GET_VALUES, SET_VALUES, DO_STEP, CANCEL_STEP, GET_STATUS, NOT_OFFERED
} Call;

/* Log why a call is refused; the instance stays as it was. */
static fmi2Status refuse(const Instance *instance, const char *format, ...);

/* The instance behind a component, if it is one and may be called so now; else NULL, with a message. */
static Instance *enter(fmi2Component component, Call call, const char *function);

/* Make the initial state if the parameters have changed since. */
static fmi2Status initialise(Instance *instance, const char *function);

#endif
