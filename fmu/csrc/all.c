/* One translation unit: only the functions of the FMI version are exported. */

#define CASADI_SYMBOL_EXPORT static
#include "core.c"

#include "instance.c"
#include "saved.c"
#include "step.c"
#include "values.c"
#include "calls.c"

#if FMI_VERSION == 3
#include "fmi3.c"
#include "fmi3_absent.c"
#else
#include "fmi2.c"
#endif
