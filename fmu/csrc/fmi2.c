/* FMI 2.0 for Co-Simulation and Model Exchange: types and names. instance.h declares what the calls do. */

#include "instance.h"

/* Statically linked units are told apart by a prefix of their functions. */
#ifndef FMI2_FUNCTION_PREFIX
#define FMI2_FUNCTION_PREFIX MODEL_PREFIX
#endif
#include "fmi2Functions.h"

/* ---- inquiry, creation, destruction, logging ---- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

static void log2_message(const Instance *instance, Status status, const char *category, const char *message)
{
    fmi2CallbackLogger logger = (fmi2CallbackLogger)instance->logger;
    if (logger) logger(instance->environment, instance->name, (fmi2Status)status, category, message);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources, (void)visible;
    void (*logger)(void) = functions ? (void (*)(void))functions->logger : NULL;
    return instance_create(name, type == fmi2CoSimulation ? FOR_CO_SIMULATION : FOR_MODEL_EXCHANGE, guid, log2_message, logger,
                           functions ? functions->componentEnvironment : NULL, logging);
}

void fmi2FreeInstance(fmi2Component c) { instance_free(c); }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    return (fmi2Status)instance_set_logging(c, "fmi2SetDebugLogging", on, count, categories);
}

/* ---- life cycle ---- */

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop)
{
    Instance *instance = enter(c, SETUP, "fmi2SetupExperiment");
    if (!instance) return fmi2Error;
    return (fmi2Status)instance_setup(instance, "fmi2SetupExperiment", tolerance_defined, tolerance, start, stop_defined, stop);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    return (fmi2Status)instance_move(c, ENTER_INITIALIZATION, "fmi2EnterInitializationMode", INITIALIZATION);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    return (fmi2Status)instance_exit_initialization(c, "fmi2ExitInitializationMode");
}

fmi2Status fmi2Terminate(fmi2Component c) { return (fmi2Status)instance_move(c, TERMINATE, "fmi2Terminate", TERMINATED); }
fmi2Status fmi2Reset(fmi2Component c) { return (fmi2Status)instance_reset(c, "fmi2Reset"); }

/* ---- values ---- */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    return (fmi2Status)instance_get(c, "fmi2GetReal", REAL, (Selection){vr, nvr}, value, nvr);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    return (fmi2Status)instance_set(c, "fmi2SetReal", REAL, (Selection){vr, nvr}, value, nvr);
}

/* FMI 2 passes Booleans as ints. Whether the number asked for fits into an array of bool; if not, says so. */
static bool booleans_fit(fmi2Component c, Call call, const char *function, size_t count)
{
    Instance *instance = enter(c, call, function);
    if (instance && count > N_REFERENCES)
        refuse(instance, "%s: found %zu variables, expected at most %d", function, count, N_REFERENCES);
    return instance && count <= N_REFERENCES;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    bool ours[N_REFERENCES];
    if (!booleans_fit(c, GET_VALUES, "fmi2GetBoolean", nvr)) return fmi2Error;
    Status status = instance_get(c, "fmi2GetBoolean", BOOLEAN, (Selection){vr, nvr}, value ? ours : NULL, nvr);
    for (size_t i = 0; i < nvr && status == OK; i++) value[i] = ours[i] ? fmi2True : fmi2False;
    return (fmi2Status)status;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    bool ours[N_REFERENCES];
    if (!booleans_fit(c, SET_VALUES, "fmi2SetBoolean", nvr)) return fmi2Error;
    for (size_t i = 0; i < nvr && value; i++) ours[i] = value[i] != fmi2False;
    return (fmi2Status)instance_set(c, "fmi2SetBoolean", BOOLEAN, (Selection){vr, nvr}, value ? ours : NULL, nvr);
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    (void)vr, (void)value;
    return (fmi2Status)instance_none(c, GET_VALUES, "fmi2GetInteger", "Integer", nvr);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    (void)vr, (void)value;
    return (fmi2Status)instance_none(c, GET_VALUES, "fmi2GetString", "String", nvr);
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    (void)vr, (void)value;
    return (fmi2Status)instance_none(c, SET_VALUES, "fmi2SetInteger", "Integer", nvr);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    (void)vr, (void)value;
    return (fmi2Status)instance_none(c, SET_VALUES, "fmi2SetString", "String", nvr);
}

/* ---- saved states and derivatives ---- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) { return (fmi2Status)instance_save(c, "fmi2GetFMUstate", state); }
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) { return (fmi2Status)instance_restore(c, "fmi2SetFMUstate", state); }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) { return (fmi2Status)instance_free_state(c, "fmi2FreeFMUstate", state); }

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    return (fmi2Status)instance_saved_size(c, "fmi2SerializedFMUstateSize", state, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    return (fmi2Status)instance_serialise(c, "fmi2SerializeFMUstate", state, (unsigned char *)bytes, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    return (fmi2Status)instance_deserialise(c, "fmi2DeSerializeFMUstate", (const unsigned char *)bytes, size, state);
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n_unknown,
                                        const fmi2ValueReference known[], size_t n_known, const fmi2Real seed[],
                                        fmi2Real sensitivity[])
{
    return (fmi2Status)instance_derivative(c, "fmi2GetDirectionalDerivative", false, (Selection){unknown, n_unknown},
                                           (Selection){known, n_known}, (Seed){seed, n_known}, (Image){sensitivity, n_unknown});
}

/* ---- Co-Simulation ---- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real point, fmi2Real step, fmi2Boolean no_rollback)
{
    (void)no_rollback;
    return (fmi2Status)instance_step(c, "fmi2DoStep", point, step);
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    enter(c, CANCEL_STEP, "fmi2CancelStep");
    return fmi2Error;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[],
                                        fmi2Real value[])
{
    return (fmi2Status)instance_output_derivatives(c, "fmi2GetRealOutputDerivatives", (Selection){vr, nvr}, order, value, nvr);
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[],
                                       const fmi2Real value[])
{
    return (fmi2Status)instance_set_input_derivatives(c, "fmi2SetRealInputDerivatives", (Selection){vr, nvr}, order, value);
}

/* Steps are never pending: the only statuses are the last time and "not terminated". */
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    Instance *instance = enter(c, GET_STATUS, "fmi2GetRealStatus");
    if (!instance || !value) return fmi2Error;
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = instance->core.unit.time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    Instance *instance = enter(c, GET_STATUS, "fmi2GetBooleanStatus");
    if (!instance || !value) return fmi2Error;
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = fmi2False;
    return fmi2OK;
}

static fmi2Status no_status(fmi2Component c, const char *function) { return enter(c, GET_STATUS, function) ? fmi2Discard : fmi2Error; }

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value)
{
    (void)kind, (void)value;
    return no_status(c, "fmi2GetStatus");
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)kind, (void)value;
    return no_status(c, "fmi2GetIntegerStatus");
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    (void)kind, (void)value;
    return no_status(c, "fmi2GetStringStatus");
}

/* ---- Model Exchange ---- */

fmi2Status fmi2EnterEventMode(fmi2Component c) { return (fmi2Status)instance_move(c, ENTER_EVENT, "fmi2EnterEventMode", EVENT); }

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    return (fmi2Status)instance_move(c, ENTER_CONTINUOUS, "fmi2EnterContinuousTimeMode", CONTINUOUS);
}

/* There are no discrete states, no events and no event indicators. */
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{
    if (!enter(c, DISCRETE_STATES, "fmi2NewDiscreteStates") || !info) return fmi2Error;
    *info = (fmi2EventInfo){0};
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_rollback, fmi2Boolean *event_mode, fmi2Boolean *terminate)
{
    (void)no_rollback;
    if (!enter(c, COMPLETE_STEP, "fmi2CompletedIntegratorStep") || !event_mode || !terminate) return fmi2Error;
    *event_mode = *terminate = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) { return (fmi2Status)instance_set_time(c, "fmi2SetTime", time); }

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx)
{
    return (fmi2Status)instance_set_states(c, "fmi2SetContinuousStates", x, nx);
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx)
{
    return (fmi2Status)instance_get_states(c, "fmi2GetContinuousStates", STATE, x, nx);
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx)
{
    return (fmi2Status)instance_get_states(c, "fmi2GetDerivatives", DERIVATIVE, derivatives, nx);
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominals[], size_t nx)
{
    return (fmi2Status)instance_get_nominals(c, "fmi2GetNominalsOfContinuousStates", nominals, nx);
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real indicators[], size_t ni)
{
    (void)indicators;
    Instance *instance = enter(c, GET_STATES, "fmi2GetEventIndicators");
    if (!instance) return fmi2Error;
    return ni ? (fmi2Status)refuse(instance, "fmi2GetEventIndicators: found %zu values, expected 0", ni) : fmi2OK;
}
