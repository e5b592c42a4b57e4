/* The unit as a WebAssembly module. Its host cannot pass functions, so the logger is here: it keeps the last message until
   the host reads it. All else goes through the fmi2* functions. */

#include "all.c"
#include "dialect.h"

#include <stdio.h>
#include <stdlib.h>

static char last_message[MESSAGE_SIZE];

static void keep_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                         fmi2String message, ...)
{
    (void)environment, (void)name, (void)status, (void)category;
    snprintf(last_message, sizeof last_message, "%s", message); /* the unit sends no formats */
}

/* The last message of the unit; empty if there is none. */
EXPORTED const char *unit_message(void);
const char *unit_message(void) { return last_message; }

/* fmi2Instantiate for this module; NULL if there is no memory. */
EXPORTED fmi2Component unit_instantiate(void);
fmi2Component unit_instantiate(void)
{
    static const fmi2CallbackFunctions callbacks = {keep_message, calloc, free, NULL, NULL};
    return fmi2Instantiate("unit", fmi2CoSimulation, MODEL_TOKEN, "", &callbacks, fmi2False, fmi2False);
}
