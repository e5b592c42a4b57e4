#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ANY (INSTANTIATED | INITIALIZATION | STEPPING | EVENT | CONTINUOUS | TERMINATED)
#define RUNNING (STEPPING | EVENT | CONTINUOUS)
#if FMI_VERSION == 3
#define STARTS_READABLE INSTANTIATED /* FMI 2 does not allow it */
#else
#define STARTS_READABLE 0
#endif

static const unsigned ALLOWED[N_CALLS] = {
    [SET_LOGGING] = ANY,
    [SETUP] = INSTANTIATED,
    [ENTER_INITIALIZATION] = INSTANTIATED,
    [EXIT_INITIALIZATION] = INITIALIZATION,
    [TERMINATE] = RUNNING,
    [RESET] = ANY,
    [GET_VALUES] = STARTS_READABLE | INITIALIZATION | RUNNING | TERMINATED,
    [SET_VALUES] = INSTANTIATED | INITIALIZATION | RUNNING,
    [DO_STEP] = STEPPING,
    [SET_INPUT_DERIVATIVES] = INSTANTIATED | INITIALIZATION | STEPPING,
    [CANCEL_STEP] = 0, /* no step is ever pending */
    [GET_STATUS] = STEPPING | TERMINATED,
    [SAVE_STATE] = ANY,
    [GET_DERIVATIVES] = INITIALIZATION | RUNNING | TERMINATED,
    [GET_OUTPUT_DERIVATIVES] = STEPPING | TERMINATED,
    [ENTER_EVENT] = CONTINUOUS,
    [ENTER_CONTINUOUS] = EVENT,
    [DISCRETE_STATES] = EVENT,
    [SET_TIME] = EVENT | CONTINUOUS,
    [SET_STATES] = CONTINUOUS,
    [GET_STATES] = INITIALIZATION | EVENT | CONTINUOUS | TERMINATED,
    [COMPLETE_STEP] = CONTINUOUS,
    [ASK] = ANY,
};

static const char *state_name(unsigned state)
{
    switch (state) {
    case INSTANTIATED: return "Instantiated";
    case INITIALIZATION: return "Initialization Mode";
    case STEPPING: return "Step Mode";
    case EVENT: return "Event Mode";
    case CONTINUOUS: return "Continuous-Time Mode";
    default: return "Terminated";
    }
}

/* ---- messages ---- */

/* Some importers pass messages to printf: send no percent signs. */
static void remove_formats(char *message)
{
    for (char *c = message; *c; c++)
        if (*c == '%') *c = '_';
}

/* A text in UTF-8 that was cut off may end with a part of a character: cut that off, too. */
static void end_with_a_character(char *text)
{
    char *end = text + strlen(text), *last = end;
    while (last > text && (*--last & 0xC0) == 0x80) continue;
    const int lead = (unsigned char)*last, size = lead < 0xC0 ? 1 : lead < 0xE0 ? 2 : lead < 0xF0 ? 3 : 4;
    if (end - last < size) *last = '\0';
}

static const char *const CATEGORIES[N_CATEGORIES] = {
    [ON_EVENTS] = "logEvents",
    [ON_WARNINGS] = "logStatusWarning",
    [ON_ERRORS] = "logStatusError",
};

static void say(const Instance *instance, Category category, Status status, const char *format, va_list arguments)
{
    char message[LINE_SIZE];
    if (!instance->logs[category]) return;
    if (vsnprintf(message, sizeof message, format, arguments) >= LINE_SIZE) end_with_a_character(message);
    remove_formats(message);
    instance->log(instance, status, CATEGORIES[category], message);
}

static Status refuse(const Instance *instance, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    say(instance, ON_ERRORS, ERROR, format, arguments);
    va_end(arguments);
    return ERROR;
}

static void remark(const Instance *instance, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    say(instance, ON_WARNINGS, WARNING, format, arguments);
    va_end(arguments);
}

static void report(const Instance *instance, const char *event)
{
    char message[MESSAGE_SIZE];
    if (!instance->logs[ON_EVENTS]) return;
    const Unit *unit = &instance->core.unit;
    const int length = snprintf(message, sizeof message, "%s at %.17g s", event, unit->time);
    if (unit->tolerance > 0.0) snprintf(message + length, sizeof message - (size_t)length, ", tolerance %g", unit->tolerance);
    instance->log(instance, OK, CATEGORIES[ON_EVENTS], message);
}

static Instance *enter(void *component, Call call, const char *function)
{
    Instance *instance = component;
    if (!instance || instance->mark != MARK) return NULL;
    if (instance->core.state & ALLOWED[call]) return instance;
    refuse(instance, "%s: not allowed in state %s", function, state_name(instance->core.state));
    return NULL;
}

/* ---- creation and destruction ---- */

/* Why an instance cannot be created, or NULL. */
static const char *creation_fault(const char *name, Interface interface, const char *token)
{
    if (interface == FOR_MODEL_EXCHANGE && N_STATES == 0) return "the unit is sampled: expected Co-Simulation";
    if (!name || !*name) return "the instance name is empty, expected a name";
    if (!token || strcmp(token, MODEL_TOKEN) != 0)
        return "the token is not this library's: modelDescription.xml and binary are of different builds";
    return NULL;
}

static Instance *instance_create(const char *name, Interface interface, const char *token, Log *log, void (*logger)(void),
                                 void *environment, bool log_events)
{
    const size_t length = name ? strlen(name) : 0;
    Instance *instance = calloc(1, sizeof *instance + length + 1);
    if (!instance) return NULL;
    if (length > 0) memcpy(instance->name, name, length);
    remove_formats(instance->name);
    instance->log = log;
    instance->logger = logger;
    instance->environment = environment;
    instance->logs[ON_ERRORS] = instance->logs[ON_WARNINGS] = true;
    instance->logs[ON_EVENTS] = log_events;
    const char *fault = creation_fault(name, interface, token);
    if (fault) {
        refuse(instance, "instantiation: %s", fault);
        free(instance);
        return NULL;
    }
    instance->mark = MARK;
    instance->core.state = INSTANTIATED;
    instance->core.interface = interface;
    instance->core.stop_time = INFINITY;
    unit_reset(&instance->core.unit);
    return instance;
}

static void instance_free(void *component)
{
    Instance *instance = component;
    if (!instance || instance->mark != MARK) return;
    instance->mark = 0;
    free(instance);
}

/* ---- life cycle ---- */

static Status instance_set_logging(void *component, const char *function, bool on, size_t count, const char *const *categories)
{
    Instance *instance = enter(component, SET_LOGGING, function);
    if (!instance) return ERROR;
    if (count && !categories) return refuse(instance, "%s: found a null pointer, expected %zu categories", function, count);
    bool meant[N_CATEGORIES];
    for (int k = 0; k < N_CATEGORIES; k++) meant[k] = count == 0;
    for (size_t i = 0; i < count; i++) {
        const char *name = categories[i] ? categories[i] : "(null)";
        int found = 0;
        while (found < N_CATEGORIES && strcmp(name, CATEGORIES[found]) != 0) found++;
        if (found == N_CATEGORIES)
            return refuse(instance, "%s: found category \"%s\", expected %s, %s or %s", function, name, CATEGORIES[ON_EVENTS],
                          CATEGORIES[ON_WARNINGS], CATEGORIES[ON_ERRORS]);
        meant[found] = true;
    }
    for (int k = 0; k < N_CATEGORIES; k++)
        if (meant[k]) instance->logs[k] = on;
    return OK;
}

static Status instance_setup(Instance *instance, const char *function, bool tolerance_defined, double tolerance, double start,
                             bool stop_defined, double stop)
{
    if (!isfinite(start)) return refuse(instance, "%s: startTime is %g, expected a finite time", function, start);
    if (stop_defined && !(stop >= start))
        return refuse(instance, "%s: stopTime is %g, expected at least startTime, %g", function, stop, start);
    if (tolerance_defined && !(tolerance > 0.0 && isfinite(tolerance)))
        return refuse(instance, "%s: tolerance is %g, expected a value above 0", function, tolerance);
    Core *core = &instance->core;
    core->unit.time = start;
    core->unit.experiment_tolerance = tolerance_defined ? tolerance : 0.0;
    core->unit.initialised = false;
    core->stop_time = stop_defined ? stop : INFINITY;
    return OK;
}

static Status initialise(Instance *instance, const char *function)
{
    char message[MESSAGE_SIZE];
    Unit *unit = &instance->core.unit;
    if (unit->initialised || unit_initialise(unit, message)) return OK;
    return refuse(instance, "%s: %s", function, message);
}

static Status check_states(Instance *instance, const char *function)
{
    char message[MESSAGE_SIZE];
    return unit_check_states(&instance->core.unit, message) ? OK : refuse(instance, "%s: %s", function, message);
}

static Status update(Instance *instance, const char *function, unsigned kinds)
{
    if (kinds & (OUTPUT | DERIVATIVE) && check_states(instance, function) != OK) return ERROR;
    unit_update(&instance->core.unit, kinds);
    return OK;
}

static Status instance_exit_initialization(void *component, const char *function)
{
    Instance *instance = enter(component, EXIT_INITIALIZATION, function);
    if (!instance || initialise(instance, function) != OK) return ERROR;
    instance->core.state = instance->core.interface == FOR_CO_SIMULATION ? STEPPING : EVENT;
    report(instance, "initialised");
    return OK;
}

static Status instance_move(void *component, Call call, const char *function, unsigned state)
{
    Instance *instance = enter(component, call, function);
    if (!instance) return ERROR;
    instance->core.state = state;
    if (state == TERMINATED) report(instance, "terminated");
    return OK;
}

static Status instance_reset(void *component, const char *function)
{
    Instance *instance = enter(component, RESET, function);
    if (!instance) return ERROR;
    report(instance, "reset");
    unit_reset(&instance->core.unit);
    instance->core.state = INSTANTIATED;
    instance->core.stop_time = INFINITY;
    return OK;
}
