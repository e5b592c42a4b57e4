/* One translation unit: only the functions of the FMI version are exported. */

#define CASADI_SYMBOL_EXPORT static
#include "model.c"

#include "integrator.c"
#include "dop853.c"
#include "taylor.c"
#include "turned.c"
#include "unit.c"
#include "derivatives.c"

#include "instance.c"
#include "saved.c"
#include "step.c"
#include "values.c"

#if FMI_VERSION == 3
#include "fmi3.c"
#include "fmi3_absent.c"
#else
#include "fmi2.c"
#endif
