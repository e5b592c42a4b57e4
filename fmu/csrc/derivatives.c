/* Derivatives of the unit's values by each other. */

#include "unit.h"

#include <string.h>

/* A range of the values that stands in a vector of knowns or unknowns. */
typedef struct {
    int offset;
    int size;
} Range;

static const Range RUN_KNOWNS[] = {{AT_INPUTS, N_INPUTS}, {AT_PARAMETERS, N_PARAMETERS}, {AT_STATES, N_STATES}, {0, 0}};
static const Range RUN_UNKNOWNS[] = {{AT_OUTPUTS, N_OUTPUTS}, {AT_DERIVATIVES, N_STATES}, {0, 0}};
static const Range START_KNOWNS[] = {{AT_INPUTS, N_INPUTS}, {AT_PARAMETERS, N_PARAMETERS}, {0, 0}};
static const Range START_UNKNOWNS[] = {{AT_OUTPUTS, N_OUTPUTS}, {AT_STATES, N_STATES}, {AT_DERIVATIVES, N_STATES}, {0, 0}};

static void gather(const Range *ranges, const double values[N_VALUES], double *vector)
{
    for (; ranges->size; vector += ranges->size, ranges++)
        memcpy(vector, values + ranges->offset, (size_t)ranges->size * sizeof *vector);
}

static void scatter(const Range *ranges, const double *vector, double values[N_VALUES])
{
    for (; ranges->size; vector += ranges->size, ranges++)
        memcpy(values + ranges->offset, vector, (size_t)ranges->size * sizeof *vector);
}

static void unit_derivative(Unit *unit, bool at_start, bool reverse, const double seed[N_VALUES], double image[N_VALUES])
{
    const Range *knowns = at_start ? START_KNOWNS : RUN_KNOWNS, *unknowns = at_start ? START_UNKNOWNS : RUN_UNKNOWNS;
    double from[N_VALUES], to[N_VALUES];
    gather(reverse ? unknowns : knowns, seed, from);
    const double *u = unit->values + AT_INPUTS, *p = unit->values + AT_PARAMETERS, *x = unit->values + AT_STATES;
    const double *at_start_arguments[] = {u, p, from}, *run_arguments[] = {x, u, p, unit->constants, from};
    double *results[] = {to};
    if (at_start)
        (reverse ? target_initial_reverse : target_initial_forward)(at_start_arguments, results, NULL, NULL, 0);
    else
        (reverse ? target_run_reverse : target_run_forward)(run_arguments, results, NULL, NULL, 0);
    scatter(reverse ? knowns : unknowns, to, image);
}
