/* FMI 3.0 for Co-Simulation and Model Exchange: types and names. instance.h declares what the calls do. Functions for
   features that the unit does not have (other types, Clocks, Scheduled Execution) are in fmi3_absent.c. */

#include "instance.h"

/* Statically linked units are told apart by a prefix of their functions. */
#ifndef FMI3_FUNCTION_PREFIX
#define FMI3_FUNCTION_PREFIX MODEL_PREFIX
#endif
#include "fmi3Functions.h"

/* ---- inquiry, creation, destruction, logging ---- */

const char *fmi3GetVersion(void) { return fmi3Version; }

static void log3_message(const Instance *instance, Status status, const char *category, const char *message)
{
    fmi3LogMessageCallback logger = (fmi3LogMessageCallback)instance->logger;
    if (logger) logger(instance->environment, (fmi3Status)status, category, message);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback logger)
{
    (void)resources, (void)visible;
    return instance_create(name, FOR_MODEL_EXCHANGE, token, log3_message, (void (*)(void))logger, environment, logging);
}

/* The unit never returns early and never calls the intermediate update; the importer's abilities there are ignored. */
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t n_intermediate,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                         fmi3IntermediateUpdateCallback update)
{
    (void)resources, (void)visible, (void)early_return, (void)intermediate, (void)n_intermediate, (void)update;
    Instance *instance =
        instance_create(name, FOR_CO_SIMULATION, token, log3_message, (void (*)(void))logger, environment, logging);
    if (!instance || !event_mode) return instance;
    refuse(instance, "instantiation: eventModeUsed is true, expected false: the unit has no events (hasEventMode is false)");
    instance_free(instance);
    return NULL;
}

void fmi3FreeInstance(fmi3Instance c) { instance_free(c); }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t count, const fmi3String categories[])
{
    return (fmi3Status)instance_set_logging(c, "fmi3SetDebugLogging", on, count, categories);
}

/* ---- life cycle ---- */

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean stop_defined, fmi3Float64 stop)
{
    const char *function = "fmi3EnterInitializationMode";
    Instance *instance = enter(c, ENTER_INITIALIZATION, function);
    if (!instance || instance_setup(instance, function, tolerance_defined, tolerance, start, stop_defined, stop) != OK)
        return fmi3Error;
    return (fmi3Status)instance_move(c, ENTER_INITIALIZATION, function, INITIALIZATION);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    return (fmi3Status)instance_exit_initialization(c, "fmi3ExitInitializationMode");
}

fmi3Status fmi3Terminate(fmi3Instance c) { return (fmi3Status)instance_move(c, TERMINATE, "fmi3Terminate", TERMINATED); }
fmi3Status fmi3Reset(fmi3Instance c) { return (fmi3Status)instance_reset(c, "fmi3Reset"); }

/* ---- values ---- */

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, fmi3Float64 values[], size_t n)
{
    return (fmi3Status)instance_get(c, "fmi3GetFloat64", REAL, (Selection){vr, nvr}, values, n);
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const fmi3Float64 values[], size_t n)
{
    return (fmi3Status)instance_set(c, "fmi3SetFloat64", REAL, (Selection){vr, nvr}, values, n);
}

fmi3Status fmi3GetBoolean(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, fmi3Boolean values[], size_t n)
{
    return (fmi3Status)instance_get(c, "fmi3GetBoolean", BOOLEAN, (Selection){vr, nvr}, values, n);
}

fmi3Status fmi3SetBoolean(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const fmi3Boolean values[], size_t n)
{
    return (fmi3Status)instance_set(c, "fmi3SetBoolean", BOOLEAN, (Selection){vr, nvr}, values, n);
}

/* ---- saved states and derivatives ---- */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) { return (fmi3Status)instance_save(c, "fmi3GetFMUState", state); }
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) { return (fmi3Status)instance_restore(c, "fmi3SetFMUState", state); }
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) { return (fmi3Status)instance_free_state(c, "fmi3FreeFMUState", state); }

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    return (fmi3Status)instance_saved_size(c, "fmi3SerializedFMUStateSize", state, size);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    return (fmi3Status)instance_serialise(c, "fmi3SerializeFMUState", state, bytes, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    return (fmi3Status)instance_deserialise(c, "fmi3DeserializeFMUState", bytes, size, state);
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                        const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                        size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity)
{
    return (fmi3Status)instance_derivative(c, "fmi3GetDirectionalDerivative", false, (Selection){unknowns, n_unknowns},
                                           (Selection){knowns, n_knowns}, (Seed){seed, n_seed}, (Image){sensitivity, n_sensitivity});
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                    size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity)
{
    return (fmi3Status)instance_derivative(c, "fmi3GetAdjointDerivative", true, (Selection){unknowns, n_unknowns},
                                           (Selection){knowns, n_knowns}, (Seed){seed, n_seed}, (Image){sensitivity, n_sensitivity});
}

/* ---- Co-Simulation ---- */

/* A step is complete or fails. The unit never asks for an event or for termination. */
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 point, fmi3Float64 step, fmi3Boolean no_rollback, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early_return, fmi3Float64 *last_time)
{
    (void)no_rollback;
    Instance *instance = enter(c, DO_STEP, "fmi3DoStep");
    if (!instance) return fmi3Error;
    if (!event || !terminate || !early_return || !last_time)
        return (fmi3Status)refuse(instance, "fmi3DoStep: found a null pointer, expected places for eventHandlingNeeded, "
                                            "terminateSimulation, earlyReturn and lastSuccessfulTime");
    const Status status = instance_step(c, "fmi3DoStep", point, step);
    *event = *terminate = *early_return = fmi3False;
    *last_time = instance->core.unit.time;
    return (fmi3Status)status;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t n)
{
    return (fmi3Status)instance_output_derivatives(c, "fmi3GetOutputDerivatives", (Selection){vr, nvr}, orders, values, n);
}

/* ---- Model Exchange ---- */

fmi3Status fmi3EnterEventMode(fmi3Instance c) { return (fmi3Status)instance_move(c, ENTER_EVENT, "fmi3EnterEventMode", EVENT); }

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c)
{
    return (fmi3Status)instance_move(c, ENTER_CONTINUOUS, "fmi3EnterContinuousTimeMode", CONTINUOUS);
}

/* There are no discrete states, no events and no event indicators. */
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *needs_update, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *values_changed,
                                    fmi3Boolean *next_event_defined, fmi3Float64 *next_event)
{
    Instance *instance = enter(c, DISCRETE_STATES, "fmi3UpdateDiscreteStates");
    if (!instance) return fmi3Error;
    if (!needs_update || !terminate || !nominals_changed || !values_changed || !next_event_defined || !next_event)
        return (fmi3Status)refuse(instance, "fmi3UpdateDiscreteStates: found a null pointer, expected places for six answers");
    *needs_update = *terminate = *nominals_changed = *values_changed = *next_event_defined = fmi3False;
    *next_event = 0.0;
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_rollback, fmi3Boolean *event_mode, fmi3Boolean *terminate)
{
    (void)no_rollback;
    Instance *instance = enter(c, COMPLETE_STEP, "fmi3CompletedIntegratorStep");
    if (!instance) return fmi3Error;
    if (!event_mode || !terminate)
        return (fmi3Status)refuse(instance, "fmi3CompletedIntegratorStep: found a null pointer, expected places for "
                                            "enterEventMode and terminateSimulation");
    *event_mode = *terminate = fmi3False;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) { return (fmi3Status)instance_set_time(c, "fmi3SetTime", time); }

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t nx)
{
    return (fmi3Status)instance_set_states(c, "fmi3SetContinuousStates", x, nx);
}

fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t nx)
{
    return (fmi3Status)instance_get_states(c, "fmi3GetContinuousStates", STATE, x, nx);
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 derivatives[], size_t nx)
{
    return (fmi3Status)instance_get_states(c, "fmi3GetContinuousStateDerivatives", DERIVATIVE, derivatives, nx);
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 nominals[], size_t nx)
{
    return (fmi3Status)instance_get_nominals(c, "fmi3GetNominalsOfContinuousStates", nominals, nx);
}

fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 indicators[], size_t n)
{
    (void)indicators;
    Instance *instance = enter(c, GET_STATES, "fmi3GetEventIndicators");
    if (!instance) return fmi3Error;
    return n ? (fmi3Status)refuse(instance, "fmi3GetEventIndicators: found room for %zu values, expected 0", n) : fmi3OK;
}

/* Return a number that exists in Model Exchange only. */
static fmi3Status tell_number(fmi3Instance c, const char *function, size_t *place, size_t number)
{
    Instance *instance = enter(c, ASK, function);
    if (!instance) return fmi3Error;
    if (instance->core.interface != FOR_MODEL_EXCHANGE)
        return (fmi3Status)refuse(instance, "%s: the instance is for Co-Simulation, expected one for Model Exchange", function);
    if (!place) return (fmi3Status)refuse(instance, "%s: found a null pointer, expected a place for the number", function);
    *place = number;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *nx)
{
    return tell_number(c, "fmi3GetNumberOfContinuousStates", nx, N_STATES);
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n)
{
    return tell_number(c, "fmi3GetNumberOfEventIndicators", n, 0);
}
