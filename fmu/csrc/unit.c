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

static void unit_set(Unit *unit, int index, double value)
{
    if (unit->values[index] == value) return;
    unit->values[index] = value;
    if (index >= AT_PARAMETERS && index < AT_OUTPUTS) {
        unit->initialised = false;
        return;
    }
    unit->flows_stale = true;
    unit->rates_current = false;
    if (index >= AT_STATES) unit->outputs_current = false;
}

/* ---- the equations ---- */

typedef int Equations(const double **arguments, double **results, int *iw, double *w, int memory);

static void evaluate_rates(Equations *rates, const Unit *unit, const double *state, double *result)
{
    const double *arguments[] = {state, unit->values + AT_INPUTS, unit->constants};
    double *results[] = {result};
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

/* The quadratic part of the free attitude's rates. */
static void free_attitude_products(const void *unit, const double *products, double *rates)
{
    const double *arguments[] = {products, ((const Unit *)unit)->weights};
    double *results[] = {rates};
    target_free_attitude_products(arguments, results, NULL, NULL, 0);
}

/* Without gravity gradient: the torque, a constant, is all that turns the attitude from outside. */
static bool attitude_is_free(const Unit *unit) { return unit->values[AT_GRAVITY_GRADIENT] == 0.0; }

static void update_rates(Unit *unit)
{
    double orbit[WIDTH], *rates = unit->values + AT_DERIVATIVES;
    (attitude_is_free(unit) ? free_attitude_rates : attitude_rates)(unit, unit->values + AT_STATES, rates);
    orbit_rates(unit, unit->values + AT_STATES + ORBIT_START, orbit);
    memcpy(rates + ORBIT_START, orbit, ORBIT_SIZE * sizeof *orbit);
    unit->rates_current = true;
}

static void update_outputs(Unit *unit)
{
    const double *arguments[] = {unit->values + AT_STATES, unit->values + AT_PARAMETERS, unit->constants};
    double *results[] = {unit->values + AT_OUTPUTS};
    target_run_outputs(arguments, results, NULL, NULL, 0);
    unit->outputs_current = true;
}

static void unit_update(Unit *unit, unsigned kinds)
{
    unit->values[AT_TIME] = unit->time;
    if (kinds & OUTPUT && !unit->outputs_current) update_outputs(unit);
    if (kinds & DERIVATIVE && !unit->rates_current) update_rates(unit);
}

/* ---- the beginning ---- */

/* Whether all checks of the parameters hold; if not, says which does not. */
static bool parameters_hold(const Unit *unit, char message[MESSAGE_SIZE])
{
    double margins[N_CHECKS], found[N_CHECKS];
    const double *arguments[] = {unit->values + AT_PARAMETERS};
    double *to_margins[] = {margins}, *to_found[] = {found};
    target_margins(arguments, to_margins, NULL, NULL, 0);
    target_found(arguments, to_found, NULL, NULL, 0);
    for (int i = 0; i < N_CHECKS; i++) {
        if (margins[i] > 0.0) continue;
        snprintf(message, MESSAGE_SIZE, "%s: found %s %g, expected %s", CHECKS[i].variable, CHECKS[i].quantity, found[i],
                 CHECKS[i].expected);
        return false;
    }
    return true;
}

/* Constants and tolerance from the parameters. */
static void take_parameters(Unit *unit)
{
    const double *parameters[] = {unit->values + AT_PARAMETERS}, *constants[] = {unit->constants};
    double *to_constants[] = {unit->constants}, *to_weights[] = {unit->weights};
    target_constants(parameters, to_constants, NULL, NULL, 0);
    target_free_attitude_weights(constants, to_weights, NULL, NULL, 0);
    const double tolerance = unit->values[AT_TOLERANCE];
    unit->tolerance = unit->experiment_tolerance > 0.0 ? fmin(tolerance, unit->experiment_tolerance) : tolerance;
    unit->initialised = true;
    unit->outputs_current = unit->rates_current = false;
}

/* Both flows begin at the unit's state and time. */
static void start_flows(Unit *unit)
{
    unit->started = unit->time;
    flow_start(&unit->attitude, unit->values + AT_STATES, ATTITUDE_SIZE);
    flow_start(&unit->orbit, unit->values + AT_STATES + ORBIT_START, ORBIT_SIZE);
}

static bool unit_initialise(Unit *unit, char message[MESSAGE_SIZE])
{
    if (!parameters_hold(unit, message)) return false;
    const double *arguments[] = {unit->values + AT_PARAMETERS};
    double *to_state[] = {unit->values + AT_STATES}, *to_scale[] = {unit->scale};
    target_initial(arguments, to_state, NULL, NULL, 0);
    target_nominals(arguments, to_scale, NULL, NULL, 0);
    take_parameters(unit);
    memcpy(unit->attitude.scale, unit->scale, ATTITUDE_SIZE * sizeof *unit->scale);
    memcpy(unit->orbit.scale, unit->scale + ORBIT_START, ORBIT_SIZE * sizeof *unit->scale);
    unit->orbit.scale[ORBIT_SIZE] = 1.0; /* of a state that is not there */
    unit->attitude.step = unit->orbit.step = 0.0;
    start_flows(unit);
    unit->flows_stale = unit->inputs_busy = false;
    return true;
}

static bool unit_tune(Unit *unit, char message[MESSAGE_SIZE])
{
    if (unit->initialised) return true;
    if (!parameters_hold(unit, message)) return false;
    take_parameters(unit);
    unit->flows_stale = true;
    return true;
}

/* ---- the way ---- */

/* Let the attitude reach `elapsed`, without gravity gradient and with it. */
static __attribute__((flatten)) const char *advance_free_attitude(Unit *unit, double elapsed)
{
    return taylor_advance(&unit->attitude, free_attitude_rates, free_attitude_products, unit, unit->tolerance, elapsed,
                          unit->inputs_busy);
}

static const char *advance_pulled_attitude(Unit *unit, double elapsed)
{
    return dop853_advance(&unit->attitude, attitude_rates, unit, unit->tolerance, elapsed, unit->inputs_busy);
}

/* Let the attitude reach `elapsed` and put its state there. */
static const char *run_attitude(Unit *unit, double elapsed)
{
    const bool is_free = attitude_is_free(unit);
    const char *trouble = NULL;
    if (unit->attitude.time < elapsed) trouble = (is_free ? advance_free_attitude : advance_pulled_attitude)(unit, elapsed);
    if (trouble) return trouble;
    (is_free ? taylor_interpolate : dop853_interpolate)(&unit->attitude, elapsed, unit->values + AT_STATES, ATTITUDE_SIZE);
    return NULL;
}

/* The same for the orbit. */
static const char *run_orbit(Unit *unit, double elapsed)
{
    const char *trouble = NULL;
    if (unit->orbit.time < elapsed)
        trouble = dop853_advance(&unit->orbit, orbit_rates, unit, unit->tolerance, elapsed, unit->inputs_busy);
    if (!trouble) dop853_interpolate(&unit->orbit, elapsed, unit->values + AT_STATES + ORBIT_START, ORBIT_SIZE);
    return trouble;
}

static const char *run_flows(Unit *unit, double elapsed)
{
    const char *trouble = run_attitude(unit, elapsed);
    /* The orbit's true anomaly is the one that counts, so it comes second. */
    return trouble ? trouble : run_orbit(unit, elapsed);
}

/* The same where something has to be integrated, and may fail. */
static const char *integrate(Unit *unit, double time)
{
    const Unit before = *unit;
    if (unit->flows_stale) start_flows(unit);
    unit->inputs_busy = unit->flows_stale;
    const char *trouble = run_flows(unit, time - unit->started);
    if (trouble) *unit = before;
    return trouble;
}

static bool unit_advance(Unit *unit, double time, char message[MESSAGE_SIZE])
{
    const double elapsed = time - unit->started;
    if (unit->flows_stale || unit->attitude.time < elapsed || unit->orbit.time < elapsed) {
        const char *trouble = integrate(unit, time);
        if (trouble) {
            snprintf(message, MESSAGE_SIZE, "integration from %.17g s to %.17g s failed: %s", unit->time, time, trouble);
            return false;
        }
    } else {
        unit->inputs_busy = false;
        run_flows(unit, elapsed);
    }
    unit->flows_stale = false;
    unit->time = time;
    unit->outputs_current = unit->rates_current = false;
    return true;
}

/* ---- derivatives ---- */

/* A stretch of the values that stands in a vector of knowns or unknowns. */
typedef struct {
    int offset;
    int size;
} Stretch;

static const Stretch RUN_KNOWNS[] = {{AT_INPUTS, N_INPUTS}, {AT_STATES, N_STATES}, {0, 0}};
static const Stretch RUN_UNKNOWNS[] = {{AT_OUTPUTS, N_OUTPUTS}, {AT_DERIVATIVES, N_STATES}, {0, 0}};
static const Stretch START_KNOWNS[] = {{AT_INPUTS, N_INPUTS}, {AT_PARAMETERS, N_PARAMETERS}, {0, 0}};
static const Stretch START_UNKNOWNS[] = {{AT_OUTPUTS, N_OUTPUTS}, {AT_STATES, N_STATES}, {AT_DERIVATIVES, N_STATES}, {0, 0}};

static void gather(const Stretch *stretches, const double values[N_VALUES], double *vector)
{
    for (; stretches->size; vector += stretches->size, stretches++)
        memcpy(vector, values + stretches->offset, (size_t)stretches->size * sizeof *vector);
}

static void scatter(const Stretch *stretches, const double *vector, double values[N_VALUES])
{
    for (; stretches->size; vector += stretches->size, stretches++)
        memcpy(values + stretches->offset, vector, (size_t)stretches->size * sizeof *vector);
}

static void unit_derivative(Unit *unit, bool at_start, bool reverse, const double seed[N_VALUES], double image[N_VALUES])
{
    const Stretch *knowns = at_start ? START_KNOWNS : RUN_KNOWNS, *unknowns = at_start ? START_UNKNOWNS : RUN_UNKNOWNS;
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
