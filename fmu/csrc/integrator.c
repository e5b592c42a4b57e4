/* What DOP853 and Taylor's method share. */

#include "integrator.h"

#include <math.h>
#include <string.h>

static void integrator_start(Integrator *integrator, const double *state, int size)
{
    integrator->time = integrator->length = 0.0;
    memset(integrator->state, 0, sizeof integrator->state);
    memcpy(integrator->state, state, (size_t)size * sizeof *state);
}

/* fmax and fmin without a function call. */
static inline double larger(double a, double b) { return a > b ? a : b; }
static inline double smaller(double a, double b) { return a < b ? a : b; }
