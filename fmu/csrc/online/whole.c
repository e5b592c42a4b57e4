/* The online estimator, after `relative`, the generated step on an orbit. */
#include <math.h>
#include <stddef.h>

#include "online.h"
#include "small.h"

/* [r; v] in C to the end of a step, and the transition: the generated function stores it by columns. */
static void relative_step(double begin, double end, const double *elements, double x[6], double F[6][6]) {
    double from[6], columns[36], work[relative_SZ_W];
    for (int k = 0; k < 6; k++) from[k] = x[k];
    const double *arguments[relative_SZ_ARG] = {&begin, &end, elements, from};
    double *results[relative_SZ_RES] = {x, columns};
    relative(arguments, results, (int[relative_SZ_IW + 1]){0}, work, 0);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) F[i][j] = columns[6 * j + i];
}

#include "registration.c"
#include "bank.c"
#include "filter.c"
#include "features.c"
#include "node.c"
#include "online.c"
