/* Time of one fmi2DoStep as an importer written in C sees it; run by benchmark.py.

   step_benchmark LIBRARY GUID STEPS STEP_SIZE VARIABLES FIRST: prints nanoseconds a step, without and with reading every
   output, and then the outputs at the end. VARIABLES is the number of variables up to the last output, FIRST the outputs'
   first reference. */

#define _POSIX_C_SOURCE 199309L
#include "fmi2FunctionTypes.h"

#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static void logger(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category, fmi2String text, ...)
{
    (void)e, (void)name, (void)status, (void)category;
    fprintf(stderr, "%s\n", text);
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

int main(int argc, char **argv)
{
    if (argc != 7) return 2;
    void *library = dlopen(argv[1], RTLD_NOW);
    if (!library) return fprintf(stderr, "%s\n", dlerror()), 2;
    const long steps = atol(argv[3]);
    const double size = atof(argv[4]);
    const unsigned values = (unsigned)atoi(argv[5]), first = (unsigned)atoi(argv[6]), count = values - first;

    fmi2InstantiateTYPE *instantiate = (fmi2InstantiateTYPE *)dlsym(library, "fmi2Instantiate");
    fmi2SetupExperimentTYPE *setup = (fmi2SetupExperimentTYPE *)dlsym(library, "fmi2SetupExperiment");
    fmi2EnterInitializationModeTYPE *enter = (fmi2EnterInitializationModeTYPE *)dlsym(library, "fmi2EnterInitializationMode");
    fmi2ExitInitializationModeTYPE *leave = (fmi2ExitInitializationModeTYPE *)dlsym(library, "fmi2ExitInitializationMode");
    fmi2DoStepTYPE *do_step = (fmi2DoStepTYPE *)dlsym(library, "fmi2DoStep");
    fmi2GetRealTYPE *get_real = (fmi2GetRealTYPE *)dlsym(library, "fmi2GetReal");
    fmi2ResetTYPE *reset = (fmi2ResetTYPE *)dlsym(library, "fmi2Reset");

    fmi2ValueReference *references = malloc(count * sizeof *references);
    fmi2Real *outputs = malloc(count * sizeof *outputs);
    for (unsigned i = 0; i < count; i++) references[i] = first + i;

    const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    fmi2Component unit = instantiate("benchmark", fmi2CoSimulation, argv[2], "", &callbacks, fmi2False, fmi2False);
    if (!unit) return 2;
    for (int reading = 0; reading < 2; reading++) {
        reset(unit);
        setup(unit, fmi2False, 0.0, 0.0, fmi2False, 0.0);
        enter(unit);
        leave(unit);
        const double begin = now();
        for (long i = 0; i < steps; i++) {
            if (do_step(unit, (double)i * size, size, fmi2True) != fmi2OK) return 1;
            if (reading && get_real(unit, references, count, outputs) != fmi2OK) return 1;
        }
        printf("%.1f\n", (now() - begin) / (double)steps);
    }
    for (unsigned i = 0; i < count; i++) printf("%.17g\n", outputs[i]);
    return 0;
}
