/* Loads a unit's library as an importer does, steps it and prints values. Run under wine and qemu-user; compiled with VERSION, that of
   FMI, 2 or 3.

   unit_driver LIBRARY TOKEN STEPS SIZE FIRST COUNT VALUES: after STEPS steps of SIZE seconds, the VALUES values of COUNT variables
   from reference FIRST. */

#if VERSION == 3
#include "fmi3FunctionTypes.h"
#else
#include "fmi2FunctionTypes.h"
#endif

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#ifdef _WIN32
/* Linked as the units are, with nothing of MinGW (see csrc/windows.c). */
#include <io.h>
#include <windows.h>
static void *load(const char *path) { return (void *)LoadLibraryA(path); }
static void *find(void *library, const char *name) { return (void *)GetProcAddress(library, name); }

int main(int argc, char **argv);
int _configure_narrow_argv(int mode);
void __main(void) {} /* called by main */
void windows_start(void)
{
    _configure_narrow_argv(1);
    exit(main(*__p___argc(), *__p___argv()));
}
#else
#include <dlfcn.h>
#include <unistd.h>
static void *load(const char *path) { return dlopen(path, RTLD_NOW); }
static void *find(void *library, const char *name) { return dlsym(library, name); }
#endif

enum { OUTPUT = 1, ERRORS = 2 };

static void say(int stream, const char *format, ...)
{
    char text[1000];
    va_list values;
    va_start(values, format);
    const int length = vsnprintf(text, sizeof text, format, values);
    va_end(values);
    if (write(stream, text, (unsigned)length) != length) exit(2);
}

static int fail(const char *what)
{
    say(ERRORS, "failed: %s\n", what);
    return 1;
}

/* The function of a name in the library, of its type. */
#define FIND(name) \
    name##TYPE *name = (name##TYPE *)find(library, #name); \
    if (!name) return fail("finding " #name)

#if VERSION == 3
static void logger(fmi3InstanceEnvironment e, fmi3Status status, fmi3String category, fmi3String text)
{
    (void)e, (void)status, (void)category;
    say(ERRORS, "%s\n", text);
}

static int run(void *library, const char *token, long steps, double size, const unsigned *references, size_t count,
               double *values, size_t n_values)
{
    FIND(fmi3InstantiateCoSimulation);
    FIND(fmi3EnterInitializationMode);
    FIND(fmi3ExitInitializationMode);
    FIND(fmi3DoStep);
    FIND(fmi3GetFloat64);
    FIND(fmi3FreeInstance);
    bool event, terminate, early;
    double last;
    fmi3Instance unit =
        fmi3InstantiateCoSimulation("driven", token, "", false, false, false, false, NULL, 0, NULL, logger, NULL);
    if (!unit) return fail("instantiation");
    if (fmi3EnterInitializationMode(unit, false, 0.0, 0.0, false, 0.0) != fmi3OK) return fail("initialization");
    if (fmi3ExitInitializationMode(unit) != fmi3OK) return fail("initialization");
    for (long i = 0; i < steps; i++)
        if (fmi3DoStep(unit, (double)i * size, size, true, &event, &terminate, &early, &last) != fmi3OK) return fail("fmi3DoStep");
    if (fmi3GetFloat64(unit, references, count, values, n_values) != fmi3OK) return fail("fmi3GetFloat64");
    fmi3FreeInstance(unit);
    return 0;
}
#else
static void logger(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category, fmi2String text, ...)
{
    (void)e, (void)name, (void)status, (void)category;
    say(ERRORS, "%s\n", text);
}

static int run(void *library, const char *token, long steps, double size, const unsigned *references, size_t count,
               double *values, size_t n_values)
{
    FIND(fmi2Instantiate);
    FIND(fmi2SetupExperiment);
    FIND(fmi2EnterInitializationMode);
    FIND(fmi2ExitInitializationMode);
    FIND(fmi2DoStep);
    FIND(fmi2GetReal);
    FIND(fmi2FreeInstance);
    const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    fmi2Component unit = fmi2Instantiate("driven", fmi2CoSimulation, token, "", &callbacks, fmi2False, fmi2False);
    if (!unit) return fail("instantiation");
    if (fmi2SetupExperiment(unit, fmi2False, 0.0, 0.0, fmi2False, 0.0) != fmi2OK) return fail("fmi2SetupExperiment");
    if (fmi2EnterInitializationMode(unit) != fmi2OK) return fail("initialization");
    if (fmi2ExitInitializationMode(unit) != fmi2OK) return fail("initialization");
    for (long i = 0; i < steps; i++)
        if (fmi2DoStep(unit, (double)i * size, size, fmi2True) != fmi2OK) return fail("fmi2DoStep");
    if (count != n_values || fmi2GetReal(unit, references, count, values) != fmi2OK) return fail("fmi2GetReal");
    fmi2FreeInstance(unit);
    return 0;
}
#endif

int main(int argc, char **argv)
{
    if (argc != 8) return fail("expected seven arguments");
    void *library = load(argv[1]);
    if (!library) return fail("loading the library");
    const unsigned first = (unsigned)atoi(argv[5]);
    const size_t count = (size_t)atol(argv[6]), n_values = (size_t)atol(argv[7]);
    unsigned *references = malloc(count * sizeof *references);
    double *values = malloc(n_values * sizeof *values);
    if (!references || !values) return fail("memory");
    for (size_t i = 0; i < count; i++) references[i] = first + (unsigned)i;
    if (run(library, argv[2], atol(argv[3]), atof(argv[4]), references, count, values, n_values)) return 1;
    for (size_t i = 0; i < n_values; i++) say(OUTPUT, "%.17g\n", values[i]);
    return 0;
}
