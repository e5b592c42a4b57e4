/* Steps a statically linked unit of either version of FMI; compiled once for each unit of a program, with

   VERSION (2 or 3), FMI2_FUNCTION_PREFIX or FMI3_FUNCTION_PREFIX, and RUN, the name of the function that it defines. */

#if VERSION == 3
#include "fmi3Functions.h"
#define CHECK(call) \
    if ((call) != fmi3OK) return 1
#else
#include "fmi2Functions.h"
#define CHECK(call) \
    if ((call) != fmi2OK) return 1
#endif

#include <stdbool.h>
#include <stdlib.h>

int RUN(const char *token, unsigned first, int steps, double size, double *values, size_t count);

/* Take steps, then read `count` values from reference `first`; 0 if all went well. */
int RUN(const char *token, unsigned first, int steps, double size, double *values, size_t count)
{
#if VERSION == 3
    bool event, terminate, early;
    double last;
    fmi3Instance unit = fmi3InstantiateCoSimulation("linked", token, "", false, false, false, false, NULL, 0, NULL, NULL, NULL);
    if (!unit) return 1;
    CHECK(fmi3EnterInitializationMode(unit, false, 0.0, 0.0, false, 0.0));
    CHECK(fmi3ExitInitializationMode(unit));
    for (int i = 0; i < steps; i++) CHECK(fmi3DoStep(unit, i * size, size, true, &event, &terminate, &early, &last));
    CHECK(fmi3GetFloat64(unit, &first, 1, values, count));
    fmi3FreeInstance(unit);
#else
    const fmi2CallbackFunctions callbacks = {NULL, calloc, free, NULL, NULL};
    fmi2Component unit = fmi2Instantiate("linked", fmi2CoSimulation, token, "", &callbacks, fmi2False, fmi2False);
    if (!unit) return 1;
    CHECK(fmi2SetupExperiment(unit, fmi2False, 0.0, 0.0, fmi2False, 0.0));
    CHECK(fmi2EnterInitializationMode(unit));
    CHECK(fmi2ExitInitializationMode(unit));
    for (int i = 0; i < steps; i++) CHECK(fmi2DoStep(unit, i * size, size, fmi2True));
    for (unsigned i = 0; i < count; i++) {
        const fmi2ValueReference reference = first + i;
        CHECK(fmi2GetReal(unit, &reference, 1, &values[i]));
    }
    fmi2FreeInstance(unit);
#endif
    return 0;
}
