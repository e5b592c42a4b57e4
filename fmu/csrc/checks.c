/* Conditions on parameters and states; their texts are in tables.h, their margins in model.c. */

#include "unit.h"

#include <stdio.h>

/* A function that CasADi has written. */
typedef int Equations(const double **arguments, double **results, int *iw, double *w, int memory);

/* Whether all checks of some values hold; if not, `message` names the first that fails. */
static bool all_hold(const Check *checks, int count, Equations *to_margins, Equations *to_found, const double *values,
                     char message[MESSAGE_SIZE])
{
    double margins[MOST_CHECKS], found[MOST_CHECKS];
    double *margins_result[] = {margins}, *found_result[] = {found};
    to_margins(&values, margins_result, NULL, NULL, 0);
    for (int i = 0; i < count; i++) {
        if (margins[i] > 0.0) continue;
        to_found(&values, found_result, NULL, NULL, 0);
        snprintf(message, MESSAGE_SIZE, "%s: found %s %g, expected %s", checks[i].variable, checks[i].quantity, found[i],
                 checks[i].expected);
        return false;
    }
    return true;
}
