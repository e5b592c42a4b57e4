/* The calls of FMI 2 and 3 under common names, for fuzz_harness.c. What one version lacks does nothing there. */

static void hear(const char *message); /* the harness looks at what is logged */

#if FMI_VERSION == 3
#define REFERENCE fmi3ValueReference

static void log_call(fmi3InstanceEnvironment e, fmi3Status s, fmi3String category, fmi3String message)
{
    (void)e, (void)s, (void)category;
    hear(message);
}

static void *call_instantiate(const char *name, Interface kind, const char *token, bool with_logger)
{
    fmi3LogMessageCallback logger = with_logger ? log_call : NULL;
    if (kind == FOR_MODEL_EXCHANGE) return fmi3InstantiateModelExchange(name, token, NULL, false, true, NULL, logger);
    return fmi3InstantiateCoSimulation(name, token, NULL, false, true, false, false, NULL, 0, NULL, logger, NULL);
}

#define CALL(name) fmi3##name
#define call_setup(c, td, t, start, sd, stop) ((void)(c), (Status)-1)
#define call_enter(c, td, t, start, sd, stop) fmi3EnterInitializationMode(c, td, t, start, sd, stop)
#define call_get_real(c, vr, n, v, nv) fmi3GetFloat64(c, vr, n, v, nv)
#define call_set_real(c, vr, n, v, nv) fmi3SetFloat64(c, vr, n, v, nv)
#define call_get_bool(c, vr, n, v, nv) fmi3GetBoolean(c, vr, n, v, nv)
#define call_set_bool(c, vr, n, v, nv) fmi3SetBoolean(c, vr, n, v, nv)
#define BOOLEAN_TYPE fmi3Boolean
#define call_get_other(c, vr, n) fmi3GetInt32(c, vr, n, NULL, n)
#define call_set_other(c, vr, n) fmi3SetString(c, vr, n, NULL, n)
#define call_save fmi3GetFMUState
#define call_restore fmi3SetFMUState
#define call_forget fmi3FreeFMUState
#define call_saved_size fmi3SerializedFMUStateSize
#define call_serialise fmi3SerializeFMUState
#define call_deserialise fmi3DeserializeFMUState
#define BYTE fmi3Byte
#define call_derivative(c, u, nu, k, nk, s, ns, r, nr) fmi3GetDirectionalDerivative(c, u, nu, k, nk, s, ns, r, nr)
#define call_adjoint(c, u, nu, k, nk, s, ns, r, nr) fmi3GetAdjointDerivative(c, u, nu, k, nk, s, ns, r, nr)
#define call_output_derivatives(c, vr, n, o, v, nv) fmi3GetOutputDerivatives(c, vr, n, o, v, nv)
#define call_rates fmi3GetContinuousStateDerivatives
#define ARRAYS 1

static fmi3Status call_step(void *c, double point, double step)
{
    fmi3Boolean event, terminate, early;
    double last;
    return fmi3DoStep(c, point, step, true, &event, &terminate, &early, &last);
}

static fmi3Status call_discrete(void *c, bool null)
{
    fmi3Boolean flags[5];
    double next;
    return fmi3UpdateDiscreteStates(c, null ? NULL : flags, flags + 1, flags + 2, flags + 3, flags + 4, &next);
}

static fmi3Status call_completed(void *c)
{
    fmi3Boolean event, terminate;
    return fmi3CompletedIntegratorStep(c, true, &event, &terminate);
}

/* Inquiries, and calls for what the unit does not have: none of them changes the instance. */
static void call_rest(void *c, unsigned which, bool null)
{
    const fmi3ValueReference reference = 0;
    fmi3Boolean flags[2] = {false, false};
    fmi3Clock clock = false;
    size_t number;
    double value = 0.0;
    switch (which % 10) {
    case 0: fmi3GetNumberOfContinuousStates(c, null ? NULL : &number); break;
    case 1: fmi3GetNumberOfEventIndicators(c, null ? NULL : &number); break;
    case 2: fmi3GetVersion(); break;
    case 3: fmi3GetClock(c, &reference, null ? 0 : 1, &clock); break;
    case 4: fmi3SetClock(c, &reference, null ? 0 : 1, &clock); break;
    case 5: fmi3GetIntervalDecimal(c, &reference, null ? 0 : 1, &value, NULL); break;
    case 6: fmi3EnterConfigurationMode(c); break;
    case 7: fmi3GetNumberOfVariableDependencies(c, reference, null ? NULL : &number); break;
    case 8: fmi3CompletedIntegratorStep(c, true, flags, NULL); break;
    default: fmi3DoStep(c, 0.0, 1.0, true, NULL, flags, flags + 1, &value);
    }
}

#else
#define REFERENCE fmi2ValueReference

static void log_call(fmi2ComponentEnvironment e, fmi2String n, fmi2Status s, fmi2String category, fmi2String message, ...)
{
    (void)e, (void)n, (void)s, (void)category;
    hear(message);
}

static void *call_instantiate(const char *name, Interface kind, const char *token, bool with_logger)
{
    const fmi2CallbackFunctions callbacks = {with_logger ? log_call : NULL, calloc, free, NULL, NULL};
    return fmi2Instantiate(name, kind == FOR_CO_SIMULATION ? fmi2CoSimulation : fmi2ModelExchange, token, NULL, &callbacks, 0, 1);
}

#define CALL(name) fmi2##name
#define call_setup(c, td, t, start, sd, stop) fmi2SetupExperiment(c, td, t, start, sd, stop)
#define call_enter(c, td, t, start, sd, stop) fmi2EnterInitializationMode(c)
#define call_get_real(c, vr, n, v, nv) fmi2GetReal(c, vr, n, v)
#define call_set_real(c, vr, n, v, nv) fmi2SetReal(c, vr, n, v)
#define call_get_bool(c, vr, n, v, nv) fmi2GetBoolean(c, vr, n, v)
#define call_set_bool(c, vr, n, v, nv) fmi2SetBoolean(c, vr, n, v)
#define BOOLEAN_TYPE fmi2Boolean
#define call_get_other(c, vr, n) fmi2GetInteger(c, vr, n, NULL)
#define call_set_other(c, vr, n) fmi2SetString(c, vr, n, NULL)
#define call_save fmi2GetFMUstate
#define call_restore fmi2SetFMUstate
#define call_forget fmi2FreeFMUstate
#define call_saved_size fmi2SerializedFMUstateSize
#define call_serialise fmi2SerializeFMUstate
#define call_deserialise fmi2DeSerializeFMUstate
#define BYTE fmi2Byte
#define call_derivative(c, u, nu, k, nk, s, ns, r, nr) fmi2GetDirectionalDerivative(c, u, nu, k, nk, s, r)
#define call_output_derivatives(c, vr, n, o, v, nv) fmi2GetRealOutputDerivatives(c, vr, n, o, v)
#define call_rates fmi2GetDerivatives
#define ARRAYS 0

static fmi2Status call_step(void *c, double point, double step) { return fmi2DoStep(c, point, step, 1); }

static fmi2Status call_discrete(void *c, bool null)
{
    fmi2EventInfo info;
    return fmi2NewDiscreteStates(c, null ? NULL : &info);
}

static fmi2Status call_completed(void *c)
{
    fmi2Boolean event, terminate;
    return fmi2CompletedIntegratorStep(c, 1, &event, &terminate);
}

/* Inquiries, and calls for what the unit does not have: none of them changes the instance. */
static void call_rest(void *c, unsigned which, bool null)
{
    static const fmi2Boolean flags[N_REFERENCES + 1];
    static const fmi2ValueReference many[N_REFERENCES + 1];
    const fmi2ValueReference reference = 0;
    const fmi2Integer one = 1;
    const fmi2StatusKind kind = (fmi2StatusKind)(which / 16 % 5);
    const double rate = 1.0;
    fmi2Boolean flag;
    fmi2Status status;
    double time;
    switch (which % 10) {
    case 0: fmi2GetRealStatus(c, kind, null ? NULL : &time); break;
    case 1: fmi2GetBooleanStatus(c, kind, null ? NULL : &flag); break;
    case 2: fmi2GetStatus(c, kind, &status); break;
    case 3: fmi2GetIntegerStatus(c, kind, NULL); break;
    case 4: fmi2GetStringStatus(c, kind, NULL); break;
    case 5: fmi2CancelStep(c); break;
    case 6: fmi2SetRealInputDerivatives(c, null ? NULL : &reference, 0, null ? NULL : &one, null ? NULL : &rate); break;
    case 7: fmi2SetBoolean(c, many, N_REFERENCES + 1, flags); break;
    case 8: fmi2SetInteger(c, &reference, null ? 0 : 1, &one); break;
    default: fmi2GetString(c, &reference, null ? 0 : 1, NULL);
    }
}
#endif
