/* FMI 2.0 Co-Simulation around the unit: the life cycle of an instance. */

#include "fmi2.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- which call is allowed in which state ---- */

static const unsigned ALLOWED[] = {
    [SET_DEBUG_LOGGING] = ANY,
    [SETUP_EXPERIMENT] = INSTANTIATED,
    [ENTER_INITIALIZATION] = INSTANTIATED,
    [EXIT_INITIALIZATION] = INITIALIZATION,
    [TERMINATE] = STEPPING,
    [RESET] = ANY,
    [GET_VALUES] = INITIALIZATION | STEPPING | TERMINATED,
    [SET_VALUES] = INSTANTIATED | INITIALIZATION | STEPPING,
    [DO_STEP] = STEPPING,
    [CANCEL_STEP] = 0, /* no step is ever pending */
    [GET_STATUS] = STEPPING | TERMINATED,
    [NOT_OFFERED] = ANY,
};

static const char *state_name(unsigned state)
{
    switch (state) {
    case INSTANTIATED: return "Instantiated";
    case INITIALIZATION: return "Initialization Mode";
    case STEPPING: return "Step Mode";
    default: return "Terminated";
    }
}

static fmi2Status refuse(const Instance *instance, const char *format, ...)
{
    char message[MESSAGE_SIZE + NAME_SIZE];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    /* Not every importer expands a format: send none. */
    for (char *c = message; *c; c++)
        if (*c == '%') *c = '_';
    if (instance->logger) instance->logger(instance->environment, instance->name, fmi2Error, "logStatusError", message);
    return fmi2Error;
}

static Instance *enter(fmi2Component component, Call call, const char *function)
{
    Instance *instance = component;
    if (!instance || instance->mark != MARK) return NULL;
    if (instance->state & ALLOWED[call]) return instance;
    refuse(instance, "%s: not allowed in state %s", function, state_name(instance->state));
    return NULL;
}

/* ---- inquiry, creation, destruction ---- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    Instance *instance = enter(component, SET_DEBUG_LOGGING, "fmi2SetDebugLogging");
    if (!instance) return fmi2Error;
    (void)on; /* errors, the only category there is, are always logged */
    if (count && !categories) return refuse(instance, "fmi2SetDebugLogging: found no categories, expected %zu", count);
    for (size_t i = 0; i < count; i++)
        if (!categories[i] || strcmp(categories[i], "logStatusError") != 0)
            return refuse(instance, "fmi2SetDebugLogging: found category \"%s\", expected \"logStatusError\"",
                          categories[i] ? categories[i] : "(null)");
    return fmi2OK;
}

/* Why an instance cannot be made, or NULL. */
static const char *instantiation_fault(fmi2String name, fmi2Type type, fmi2String guid)
{
    if (!name || !*name) return "fmi2Instantiate: the instance name is empty, expected a name";
    if (type != fmi2CoSimulation) return "fmi2Instantiate: found type Model Exchange, expected Co-Simulation";
    if (!guid || strcmp(guid, MODEL_TOKEN) != 0)
        return "fmi2Instantiate: the GUID is not this library's: modelDescription.xml and binary are of different builds";
    return NULL;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources, (void)visible, (void)logging;
    const char *fault = instantiation_fault(name, type, guid);
    if (fault) {
        if (functions && functions->logger)
            functions->logger(functions->componentEnvironment, name ? name : "", fmi2Error, "logStatusError", fault);
        return NULL;
    }
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance) return NULL;
    instance->mark = MARK;
    instance->state = INSTANTIATED;
    instance->stop_time = INFINITY;
    snprintf(instance->name, NAME_SIZE, "%s", name);
    if (functions) {
        instance->logger = functions->logger;
        instance->environment = functions->componentEnvironment;
    }
    unit_reset(&instance->unit);
    return instance;
}

void fmi2FreeInstance(fmi2Component component)
{
    Instance *instance = component;
    if (!instance || instance->mark != MARK) return;
    instance->mark = 0;
    free(instance);
}

/* ---- life cycle ---- */

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop)
{
    Instance *instance = enter(component, SETUP_EXPERIMENT, "fmi2SetupExperiment");
    if (!instance) return fmi2Error;
    if (!isfinite(start)) return refuse(instance, "fmi2SetupExperiment: startTime is %g, expected a finite time", start);
    if (stop_defined && !(stop >= start))
        return refuse(instance, "fmi2SetupExperiment: stopTime is %g, expected at least startTime, %g", stop, start);
    if (tolerance_defined && !(tolerance > 0.0 && isfinite(tolerance)))
        return refuse(instance, "fmi2SetupExperiment: tolerance is %g, expected a value above 0", tolerance);
    instance->unit.time = start;
    instance->unit.experiment_tolerance = tolerance_defined ? tolerance : 0.0;
    instance->stop_time = stop_defined ? stop : INFINITY;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    Instance *instance = enter(component, ENTER_INITIALIZATION, "fmi2EnterInitializationMode");
    if (!instance) return fmi2Error;
    instance->state = INITIALIZATION;
    return fmi2OK;
}

static fmi2Status initialise(Instance *instance, const char *function)
{
    char message[MESSAGE_SIZE];
    if (instance->unit.initialised || unit_initialise(&instance->unit, message)) return fmi2OK;
    return refuse(instance, "%s: %s", function, message);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    Instance *instance = enter(component, EXIT_INITIALIZATION, "fmi2ExitInitializationMode");
    if (!instance || initialise(instance, "fmi2ExitInitializationMode") != fmi2OK) return fmi2Error;
    instance->state = STEPPING;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component component)
{
    Instance *instance = enter(component, TERMINATE, "fmi2Terminate");
    if (!instance) return fmi2Error;
    instance->state = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component)
{
    Instance *instance = enter(component, RESET, "fmi2Reset");
    if (!instance) return fmi2Error;
    unit_reset(&instance->unit);
    instance->state = INSTANTIATED;
    instance->stop_time = INFINITY;
    return fmi2OK;
}
