/* Random legal and illegal calls on a sampled unit of FMI 2, to be compiled with its all.c under sanitizers.

   A refused call must leave the instance as it was, bit for bit; outputs must be finite; what follows a saved state must follow it
   again, also in another instance that got its bytes. Prints the numbers of calls and of refused ones; ends with 1 and a line on
   standard error at the first deviation. Usage: fuzz_sampled CALLS SEED */

#include "all.c"

#include <inttypes.h>

#include "fuzz_random.h"

/* Mostly near a start value, sometimes anything. */
static double any_number(double start)
{
    static const double odd[] = {0.0, -1.0, 1.0, 1e-300, -1e300, 1e308, 1e16, NAN, INFINITY, -INFINITY};
    if (below(12) == 0) return odd[below(sizeof odd / sizeof *odd)];
    return below(3) == 0 ? start : start * (0.5 + uniform()) + (below(4) == 0 ? 10.0 * (uniform() - 0.5) : 0.0);
}

static long calls, refused_calls;
static Core before;

static void fail(const char *what)
{
    fprintf(stderr, "call %ld: %s\n", calls, what);
    exit(1);
}

/* Judge a call: one that is refused has changed nothing. */
static bool done(Instance *instance, fmi2Status status)
{
    calls++;
    if (status == fmi2OK) return true;
    refused_calls++;
    if (memcmp(&before, &instance->core, sizeof before) != 0) fail("a refused call has changed the instance");
    return false;
}

static void set_some(Instance *instance)
{
    fmi2ValueReference references[8];
    fmi2Real reals[8];
    fmi2Boolean booleans[8];
    const size_t count = below(8);
    const bool wrong = below(20) == 0;
    const Type type = below(6) == 0 ? BOOLEAN : REAL;
    size_t found = 0;
    for (int tries = 0; tries < 200 && found < count; tries++) {
        const unsigned reference = below(N_REFERENCES + (wrong ? 5 : 0));
        const bool known = reference < N_REFERENCES;
        if (!wrong && !(VARIABLES[reference].kind & (INPUT | PARAMETER | TUNABLE) && VARIABLES[reference].type == type)) continue;
        const bool settable = known && VARIABLES[reference].kind & (INPUT | PARAMETER | TUNABLE);
        references[found] = reference;
        booleans[found] = (fmi2Boolean)below(2);
        reals[found++] = any_number(settable ? STARTS[VARIABLES[reference].offset] : 0.0);
    }
    done(instance, type == REAL ? fmi2SetReal(instance, references, found, reals) : fmi2SetBoolean(instance, references, found, booleans));
}

static void check_outputs(Instance *instance)
{
    double *outputs = instance->core.unit.values + AT_OUTPUTS;
    for (int i = 0; i < N_OUTPUTS; i++)
        if (!isfinite(outputs[i])) fail("an output is not finite");
}

static bool step(Instance *instance)
{
    static const double lengths[] = {0.0, -1.0, 1e-12, 1e-3, 0.1, 1.0, 7.7, 100.0, 1e6, 1e300, NAN};
    const double time = instance->core.unit.time, length = below(4) ? 2.0 * uniform() : lengths[below(11)];
    const bool good = done(instance, fmi2DoStep(instance, below(30) ? time : time + 1.0, length, fmi2True));
    if (good) check_outputs(instance);
    return good;
}

/* Save, go on, come back in this instance and in another one, go on likewise. */
static void replay(Instance *instance, Instance *other)
{
    fmi2FMUstate state = NULL, copy = NULL;
    if (!done(instance, fmi2GetFMUstate(instance, &state))) return;
    size_t size;
    fmi2SerializedFMUstateSize(instance, state, &size);
    fmi2Byte *bytes = malloc(size);
    if (fmi2SerializeFMUstate(instance, state, bytes, size) != fmi2OK) fail("a state was not serialised");
    const uint64_t kept = random_state;
    for (int i = 0; i < 4; i++) before = instance->core, step(instance);
    const Core first = instance->core;
    if (fmi2DeSerializeFMUstate(other, bytes, size, &copy) != fmi2OK || fmi2SetFMUstate(other, copy) != fmi2OK)
        fail("a state was not restored");
    random_state = kept;
    for (int i = 0; i < 4; i++) before = other->core, step(other);
    if (memcmp(&first, &other->core, sizeof first) != 0) fail("after a restored state the run differed");
    if (fmi2SetFMUstate(instance, state) != fmi2OK) fail("a state was not restored");
    fmi2FreeFMUstate(instance, &state);
    fmi2FreeFMUstate(other, &copy);
    free(bytes);
}

static void any_call(Instance *instance, Instance *other)
{
    const unsigned state = instance->core.state;
    const fmi2Boolean tolerant = (fmi2Boolean)below(2);
    double value;
    const fmi2ValueReference reference = below(N_REFERENCES + 3);
    before = instance->core;
    switch (below(state == STEPPING ? 40 : 8)) {
    case 0: done(instance, fmi2SetupExperiment(instance, tolerant, any_number(1e-3), any_number(10.0), fmi2False, 0.0)); break;
    case 1: done(instance, fmi2EnterInitializationMode(instance)); break;
    case 2: done(instance, fmi2ExitInitializationMode(instance)); break;
    case 3: if (below(20) == 0) done(instance, fmi2Terminate(instance)); break;
    case 4: if (below(10) == 0) done(instance, fmi2Reset(instance)); break;
    case 5: replay(instance, other); break;
    case 6: done(instance, fmi2SetRealInputDerivatives(instance, &reference, 1, (int[]){1}, (double[]){1.0})); break;
    case 7: done(instance, fmi2GetDirectionalDerivative(instance, &reference, 1, &reference, 1, (double[]){1.0}, &value)); break;
    case 8: case 9: case 10: case 11: case 12: case 13: set_some(instance); break;
    case 14: done(instance, fmi2GetReal(instance, &reference, 1, &value)); break;
    default: step(instance);
    }
    if (state & (INSTANTIATED | INITIALIZATION) && below(2)) before = instance->core, set_some(instance);
}

static Instance *created(void)
{
    static const fmi2CallbackFunctions callbacks = {NULL, NULL, NULL, NULL, NULL};
    if (fmi2Instantiate("fuzz", fmi2ModelExchange, MODEL_TOKEN, "", &callbacks, fmi2False, fmi2False)) fail("Model Exchange");
    Instance *instance = fmi2Instantiate("fuzz", fmi2CoSimulation, MODEL_TOKEN, "", &callbacks, fmi2False, fmi2False);
    if (!instance) fail("no instance");
    return instance;
}

int main(int argc, char **argv)
{
    if (argc != 3) return 2;
    const long most = atol(argv[1]);
    random_state = 88172645463325252u ^ (uint64_t)atol(argv[2]);
    long lives = 0;
    while (calls < most) {
        Instance *instance = created(), *other = created();
        for (int i = 0; i < 2000 && instance->core.state != TERMINATED; i++) any_call(instance, other);
        fmi2FreeInstance(instance);
        fmi2FreeInstance(other);
        lives++;
    }
    printf("%ld calls, %ld refused, %ld lives\n", calls, refused_calls, lives);
    return 0;
}
