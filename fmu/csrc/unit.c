#include "unit.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { ATTITUDE_SIZE = 8, ORBIT_START = 7, ORBIT_SIZE = 7 }; /* parts of the state; they share the true anomaly */

static void unit_reset(Unit *unit)
{
    memset(unit, 0, sizeof *unit);
    memcpy(unit->values, STARTS, sizeof STARTS);
}

static void unit_set(Unit *unit, unsigned index, double value)
{
    if (unit->values[index] == value) return;
    unit->values[index] = value;
    if (VARIABLES[index].kind == PARAMETER) unit->initialised = false;
    if (VARIABLES[index].kind == INPUT) unit->inputs_changed = true;
}

/* ---- the equations, as the flows call them ---- */

static void evaluate_rates(int (*rates)(const double **, double **, int *, double *, int), const Unit *unit,
                           const double *state, double *result)
{
    const double *arguments[RATES_ARGUMENTS] = {state, unit->values, unit->constants};
    double *results[RATES_RESULTS] = {result};
    rates(arguments, results, NULL, NULL, 0);
}

static void free_attitude_rates(const void *unit, const double *state, double *rates)
{
    evaluate_rates(target_free_attitude_rates, unit, state, rates);
}

static void attitude_rates(const void *unit, const double *state, double *rates)
{
    evaluate_rates(target_attitude_rates, unit, state, rates);
}

static void orbit_rates(const void *unit, const double *state, double *rates)
{
    evaluate_rates(target_orbit_rates, unit, state, rates);
    rates[ORBIT_SIZE] = 0.0;
}

/* ---- the beginning ---- */

/* The first parameter check that does not hold, or N_CHECKS. */
static int failing_check(Unit *unit, double found[N_CHECKS])
{
    double margins[N_CHECKS];
    const double *arguments[] = {unit_parameters(unit)};
    double *to_margins[] = {margins}, *to_found[] = {found};
    target_margins(arguments, to_margins, NULL, NULL, 0);
    target_found(arguments, to_found, NULL, NULL, 0);
    int i = 0;
    while (i < N_CHECKS && margins[i] > 0.0) i++;
    return i;
}

/* Both flows begin at the unit's state and time. */
static void start_flows(Unit *unit)
{
    unit->started = unit->time;
    flow_start(&unit->attitude, unit->state, ATTITUDE_SIZE);
    flow_start(&unit->orbit, unit->state + ORBIT_START, ORBIT_SIZE);
}

static bool unit_initialise(Unit *unit, char message[MESSAGE_SIZE])
{
    double found[N_CHECKS], scale[N_STATES];
    const int failed = failing_check(unit, found);
    if (failed < N_CHECKS) {
        const Check *check = &CHECKS[failed];
        snprintf(message, MESSAGE_SIZE, "%s: found %s %g, expected %s", check->variable, check->quantity,
                 found[failed], check->expected);
        return false;
    }
    const double *arguments[] = {unit_parameters(unit)};
    double *to_state[] = {unit->state}, *to_scale[] = {scale}, *to_constants[] = {unit->constants};
    target_initial(arguments, to_state, NULL, NULL, 0);
    target_nominals(arguments, to_scale, NULL, NULL, 0);
    target_constants(arguments, to_constants, NULL, NULL, 0);
    memcpy(unit->attitude.scale, scale, ATTITUDE_SIZE * sizeof *scale);
    memcpy(unit->orbit.scale, scale + ORBIT_START, ORBIT_SIZE * sizeof *scale);
    unit->orbit.scale[ORBIT_SIZE] = 1.0; /* of a state that is not there */
    unit->attitude.step = unit->orbit.step = 0.0;

    const double tolerance = unit_parameters(unit)[PARAMETER_TOLERANCE];
    unit->tolerance = unit->experiment_tolerance > 0.0 ? fmin(tolerance, unit->experiment_tolerance) : tolerance;
    start_flows(unit);
    unit->inputs_changed = unit->inputs_busy = false;
    unit->initialised = true;
    unit->outputs_current = false;
    return true;
}

/* ---- the way ---- */

/* Let one flow reach `elapsed` and put its state there. */
static const char *run_flow(Unit *unit, Flow *flow, Rates *rates, double elapsed, double *state, int size)
{
    const char *trouble = NULL;
    if (flow->time < elapsed)
        trouble = flow_advance(flow, rates, unit, unit->tolerance, elapsed, unit->inputs_busy);
    if (!trouble) flow_interpolate(flow, elapsed, state, size);
    return trouble;
}

static const char *run_flows(Unit *unit, double elapsed)
{
    const bool pulled = unit_parameters(unit)[PARAMETER_GRAVITY_GRADIENT] != 0.0;
    const char *trouble = run_flow(unit, &unit->attitude, pulled ? attitude_rates : free_attitude_rates, elapsed,
                                   unit->state, ATTITUDE_SIZE);
    /* The orbit's true anomaly is the one that counts, so it comes second. */
    return trouble ? trouble : run_flow(unit, &unit->orbit, orbit_rates, elapsed, unit->state + ORBIT_START, ORBIT_SIZE);
}

static bool unit_advance(Unit *unit, double time, char message[MESSAGE_SIZE])
{
    const double elapsed = time - unit->started;
    if (unit->inputs_changed || unit->attitude.time < elapsed || unit->orbit.time < elapsed) {
        const Unit before = *unit;
        if (unit->inputs_changed) start_flows(unit);
        unit->inputs_busy = unit->inputs_changed;
        const char *trouble = run_flows(unit, time - unit->started);
        if (trouble) {
            *unit = before;
            snprintf(message, MESSAGE_SIZE, "integration from %.17g s to %.17g s failed: %s", unit->time, time, trouble);
            return false;
        }
    } else {
        unit->inputs_busy = false;
        run_flows(unit, elapsed);
    }
    unit->inputs_changed = false;
    unit->time = time;
    unit->outputs_current = false;
    return true;
}

static void unit_update_outputs(Unit *unit)
{
    if (unit->outputs_current) return;
    const double *arguments[] = {unit->state, unit_parameters(unit), unit->constants};
    double *results[] = {unit_outputs(unit)};
    target_run_outputs(arguments, results, NULL, NULL, 0);
    unit->outputs_current = true;
}
