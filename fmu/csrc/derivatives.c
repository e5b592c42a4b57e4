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

/* The target's pose at the start or in a run. */
static void find_pose(const Unit *unit, bool at_start, double pose[POSE_SIZE])
{
    double state[N_STATES], constants[N_CONSTANTS];
    const double *p[] = {unit->values + AT_PARAMETERS}, *arguments[] = {unit->values + AT_STATES, unit->constants};
    double *to_state[] = {state}, *to_constants[] = {constants}, *results[] = {pose};
    if (at_start) {
        target_initial(p, to_state, NULL, NULL, 0);
        target_constants(p, to_constants, NULL, NULL, 0);
        arguments[0] = state, arguments[1] = constants;
    }
    target_pose(arguments, results, NULL, NULL, 0);
}

static void unit_derivative(Unit *unit, bool at_start, bool reverse, const double seed[N_VALUES], double image[N_VALUES])
{
    const Range *knowns = at_start ? START_KNOWNS : RUN_KNOWNS, *unknowns = at_start ? START_UNKNOWNS : RUN_UNKNOWNS;
    double from[N_VALUES], to[N_VALUES], pose[POSE_SIZE], of_pose[POSE_SIZE];
    const double *u = unit->values + AT_INPUTS, *p = unit->values + AT_PARAMETERS, *x = unit->values + AT_STATES;
    const double *body = unit->values + AT_TARGET_FEATURES, *rest = reverse ? from + N_SEEN : from;
    const double *at_start_arguments[] = {u, p, rest, of_pose}, *run_arguments[] = {x, u, p, unit->constants, rest, of_pose};
    const double **arguments = at_start ? at_start_arguments : run_arguments;
    double *forward[] = {to + N_SEEN, of_pose}, *back[] = {to, to + BODY_IN_KNOWNS + N_SEEN};
    find_pose(unit, at_start, pose);
    gather(reverse ? unknowns : knowns, seed, from);
    if (reverse) {
        see_reverse(pose, body, from, of_pose, to + BODY_IN_KNOWNS);
        (at_start ? target_initial_reverse : target_run_reverse)(arguments, back, NULL, NULL, 0);
    } else {
        (at_start ? target_initial_forward : target_run_forward)(arguments, forward, NULL, NULL, 0);
        see_forward(pose, body, of_pose, from + BODY_IN_KNOWNS, to);
    }
    scatter(reverse ? knowns : unknowns, to, image);
}
