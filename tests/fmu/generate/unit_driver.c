/* Loads a unit's FMI 2 library as an importer does, steps it and prints values. Run under wine and qemu-user.

   unit_driver LIBRARY GUID STEPS SIZE FIRST COUNT: after STEPS steps of SIZE seconds, COUNT values from reference FIRST. */

#include "fmi2FunctionTypes.h"

#include <stdio.h>
#include <stdlib.h>

#ifdef _WIN32
#include <windows.h>
static void *load(const char *path) { return (void *)LoadLibraryA(path); }
static void *find(void *library, const char *name) { return (void *)GetProcAddress(library, name); }
#else
#include <dlfcn.h>
static void *load(const char *path) { return dlopen(path, RTLD_NOW); }
static void *find(void *library, const char *name) { return dlsym(library, name); }
#endif

static void logger(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category, fmi2String text, ...)
{
    (void)e, (void)name, (void)status, (void)category;
    fprintf(stderr, "%s\n", text);
}

static int fail(const char *what)
{
    fprintf(stderr, "failed: %s\n", what);
    return 1;
}

int main(int argc, char **argv)
{
    if (argc != 7) return fail("expected six arguments");
    void *library = load(argv[1]);
    if (!library) return fail("loading the library");
    const long steps = atol(argv[3]);
    const double size = atof(argv[4]);
    const unsigned first = (unsigned)atoi(argv[5]), count = (unsigned)atoi(argv[6]);

    fmi2InstantiateTYPE *instantiate = (fmi2InstantiateTYPE *)find(library, "fmi2Instantiate");
    fmi2SetupExperimentTYPE *setup = (fmi2SetupExperimentTYPE *)find(library, "fmi2SetupExperiment");
    fmi2EnterInitializationModeTYPE *enter = (fmi2EnterInitializationModeTYPE *)find(library, "fmi2EnterInitializationMode");
    fmi2ExitInitializationModeTYPE *leave = (fmi2ExitInitializationModeTYPE *)find(library, "fmi2ExitInitializationMode");
    fmi2DoStepTYPE *do_step = (fmi2DoStepTYPE *)find(library, "fmi2DoStep");
    fmi2GetRealTYPE *get_real = (fmi2GetRealTYPE *)find(library, "fmi2GetReal");
    fmi2FreeInstanceTYPE *release = (fmi2FreeInstanceTYPE *)find(library, "fmi2FreeInstance");
    if (!instantiate || !setup || !enter || !leave || !do_step || !get_real || !release) return fail("finding fmi2*");

    const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    fmi2Component unit = instantiate("driven", fmi2CoSimulation, argv[2], "", &callbacks, fmi2False, fmi2False);
    if (!unit) return fail("fmi2Instantiate");
    if (setup(unit, fmi2False, 0.0, 0.0, fmi2False, 0.0) != fmi2OK) return fail("fmi2SetupExperiment");
    if (enter(unit) != fmi2OK || leave(unit) != fmi2OK) return fail("initialization");
    for (long i = 0; i < steps; i++)
        if (do_step(unit, (double)i * size, size, fmi2True) != fmi2OK) return fail("fmi2DoStep");
    for (unsigned i = 0; i < count; i++) {
        const fmi2ValueReference reference = first + i;
        fmi2Real value;
        if (get_real(unit, &reference, 1, &value) != fmi2OK) return fail("fmi2GetReal");
        printf("%.17g\n", value);
    }
    release(unit);
    return 0;
}
