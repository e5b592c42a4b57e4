/* What both methods have in common. */

#include "flow.h"

#include <math.h>
#include <string.h>

static void flow_start(Flow *flow, const double *state, int size)
{
    flow->time = flow->length = 0.0;
    memset(flow->state, 0, sizeof flow->state);
    memcpy(flow->state, state, (size_t)size * sizeof *state);
}

/* fmax and fmin without the call of a function. */
static inline double larger(double a, double b) { return a > b ? a : b; }
static inline double smaller(double a, double b) { return a < b ? a : b; }
