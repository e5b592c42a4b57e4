/* One translation unit: everything but the fmi2* functions stays private to the library. */

#define CASADI_SYMBOL_EXPORT static
#include "model.c"

#include "flow.c"
#include "unit.c"
#include "fmi2.c"
#include "fmi2_values.c"
#include "fmi2_step.c"
#include "fmi2_absent.c"
