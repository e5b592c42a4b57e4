#include "unit.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Parts of the state; they share the target's place. */
enum { RATE_START = 4, ORBIT_START = 7, ATTITUDE_SIZE = ORBIT_START + PLACE_SIZE, ORBIT_SIZE = PLACE_SIZE + 6 };

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
    unit->integrators_stale = true;
    unit->rates_current = false;
    if (index >= AT_STATES) {
        unit->outputs_current = false;
        unit->states_unchecked = true;
    }
}

#if FMI_VERSION == 2
static void unit_set_rate(Unit *unit, int index, double rate)
{
    if (unit->input_rates[index] == rate) return;
    unit->input_rates[index] = rate;
    unit->integrators_stale = true;
}
#endif

/* ---- the equations ---- */

/* The inputs at a time of the integrators; `changing` is where they are written if they change. */
static inline const double *inputs_at(const Unit *unit, double time, double changing[N_INPUTS])
{
    if (!unit->ramping) return unit->values + AT_INPUTS;
    for (int i = 0; i < N_INPUTS; i++) changing[i] = unit->first_inputs[i] + unit->input_rates[i] * time;
    return changing;
}

static void evaluate_rates(Equations *rates, const Unit *unit, const double *inputs, const double *state, double *result)
{
    const double *arguments[] = {state, inputs, unit->constants};
    double *results[] = {result};
    rates(arguments, results, NULL, NULL, 0);
}

static void free_attitude_rates(const void *unit, double time, const double *state, double *rates)
{
    double changing[N_INPUTS];
    evaluate_rates(target_free_attitude_rates, unit, inputs_at(unit, time, changing), state, rates);
}

#if !TURNED_SERIES
static void attitude_rates(const void *unit, double time, const double *state, double *rates)
{
    double changing[N_INPUTS];
    evaluate_rates(target_attitude_rates, unit, inputs_at(unit, time, changing), state, rates);
}
#endif

static void orbit_rates(const void *unit, double time, const double *state, double *rates)
{
    double changing[N_INPUTS];
    evaluate_rates(target_orbit_rates, unit, inputs_at(unit, time, changing), state, rates);
    for (int i = ORBIT_SIZE; i < WIDTH; i++) rates[i] = 0.0;
}

/* The quadratic part of the rates of the free attitude. */
static void free_attitude_products(const void *unit, const double *products, double *rates)
{
    const double *arguments[] = {products, ((const Unit *)unit)->weights};
    double *results[] = {rates};
    target_free_attitude_products(arguments, results, NULL, NULL, 0);
}

/* Without gravity gradient and eddy currents, the torque input is the only external torque. */
static bool attitude_is_free(const Unit *unit) { return !ALWAYS_TURNED && unit->values[AT_GRAVITY_GRADIENT] == 0.0; }

static void update_rates(Unit *unit)
{
    const double *inputs = unit->values + AT_INPUTS, *state = unit->values + AT_STATES;
    double *rates = unit->values + AT_DERIVATIVES;
    evaluate_rates(attitude_is_free(unit) ? target_free_attitude_rates : target_attitude_rates, unit, inputs, state, rates);
    evaluate_rates(target_orbit_rates, unit, inputs, state + ORBIT_START, rates + ORBIT_START);
    unit->rates_current = true;
}

static void update_outputs(Unit *unit)
{
    double pose[POSE_SIZE];
    const double *arguments[] = {unit->values + AT_STATES, unit->constants};
    double *results[] = {unit->values + AT_OUTPUTS + N_SEEN, pose};
    target_run_outputs(arguments, results, NULL, NULL, 0);
    see_features(pose, unit->values + AT_TARGET_FEATURES, unit->values + AT_OUTPUTS);
    unit->outputs_current = true;
}

static void unit_update(Unit *unit, unsigned kinds)
{
    unit->values[AT_TIME] = unit->time;
    if (kinds & OUTPUT && !unit->outputs_current) update_outputs(unit);
    if (kinds & DERIVATIVE && !unit->rates_current) update_rates(unit);
}

/* ---- checks ---- */

static bool states_hold(const double *states, char message[MESSAGE_SIZE])
{
    return all_hold(STATE_CHECKS, N_STATE_CHECKS, target_state_margins, target_state_found, states, message);
}

static bool unit_check_states(Unit *unit, char message[MESSAGE_SIZE])
{
    if (unit->states_unchecked && !states_hold(unit->values + AT_STATES, message)) return false;
    unit->states_unchecked = false;
    return true;
}

static const double *unit_nominals(const Unit *unit) { return unit->scale; }

static bool unit_set_states(Unit *unit, const double *states, char message[MESSAGE_SIZE])
{
    if (!states_hold(states, message)) return false;
    for (int i = 0; i < N_STATES; i++) unit_set(unit, AT_STATES + i, states[i]);
    unit->states_unchecked = false;
    return true;
}

/* ---- initialisation ---- */

static bool unit_parameters_hold(const double parameters[N_PARAMETERS], char message[MESSAGE_SIZE])
{
    return all_hold(CHECKS, N_CHECKS, target_margins, target_found, parameters, message);
}

/* Compute constants and tolerance from the parameters. */
static void take_parameters(Unit *unit)
{
    const double *parameters[] = {unit->values + AT_PARAMETERS}, *constants[] = {unit->constants};
    double *to_constants[] = {unit->constants}, *to_weights[] = {unit->weights}, *to_series[] = {unit->series_constants};
    target_constants(parameters, to_constants, NULL, NULL, 0);
    target_series_constants(parameters, to_series, NULL, NULL, 0);
    target_free_attitude_weights(constants, to_weights, NULL, NULL, 0);
    const double tolerance = unit->values[AT_SOLVER_TOLERANCE];
    unit->tolerance = unit->experiment_tolerance > 0.0 ? fmin(tolerance, unit->experiment_tolerance) : tolerance;
    unit->initialised = true;
    unit->outputs_current = unit->rates_current = false;
}

/* Whether the attitude's integrator works in the axes of its series. */
static bool attitude_is_series(const Unit *unit) { return TURNED_SERIES && !attitude_is_free(unit); }

/* Take over the inputs' rates, and what follows from that of the torque: J^-1 times it. */
static void start_ramps(Unit *unit)
{
    static const double at_rest[ATTITUDE_SIZE] = {1.0};
    unit->ramping = false;
    for (int i = 0; i < N_INPUTS; i++) unit->ramping |= unit->input_rates[i] != 0.0;
    memset(unit->series_torque_rate, 0, sizeof unit->series_torque_rate);
    if (!unit->ramping) return;
    memcpy(unit->first_inputs, unit->values + AT_INPUTS, sizeof unit->first_inputs);
    double rates[ATTITUDE_SIZE], *ramp = unit->attitude_ramp + RATE_START;
    evaluate_rates(target_free_attitude_rates, unit, unit->input_rates, at_rest, rates);
    memcpy(ramp, rates + RATE_START, 3 * sizeof *ramp);
    if (!attitude_is_series(unit)) return;
    double inputs[N_INPUTS];
    memcpy(inputs + AT_TARGET_TORQUE, ramp, 3 * sizeof *inputs);
    const double *of_ramp[] = {at_rest, inputs, unit->series_constants};
    const double *of_rate[] = {at_rest, unit->input_rates, unit->series_constants};
    double ignored[ATTITUDE_SIZE], *to_ramp[] = {ignored, ramp}, *to_rate[] = {ignored, unit->series_torque_rate};
    target_to_series(of_ramp, to_ramp, NULL, NULL, 0);
    target_to_series(of_rate, to_rate, NULL, NULL, 0);
}

/* Start both integrators at the unit's state and time. */
static void start_integrators(Unit *unit)
{
    unit->started = unit->time;
    start_ramps(unit);
    double attitude[ATTITUDE_SIZE];
    memcpy(attitude, unit->values + AT_STATES, sizeof attitude);
    if (attitude_is_series(unit)) {
        const double *arguments[] = {unit->values + AT_STATES, unit->values + AT_INPUTS, unit->series_constants};
        double *results[] = {attitude, unit->series_torque};
        target_to_series(arguments, results, NULL, NULL, 0);
    }
    integrator_start(&unit->attitude, attitude, ATTITUDE_SIZE);
    integrator_start(&unit->orbit, unit->values + AT_STATES + ORBIT_START, ORBIT_SIZE);
}

static bool unit_initialise(Unit *unit, char message[MESSAGE_SIZE])
{
    if (!unit_parameters_hold(unit->values + AT_PARAMETERS, message)) return false;
    const double *arguments[] = {unit->values + AT_PARAMETERS};
    double *to_state[] = {unit->values + AT_STATES}, *to_scale[] = {unit->scale};
    target_initial(arguments, to_state, NULL, NULL, 0);
    target_nominals(arguments, to_scale, NULL, NULL, 0);
    take_parameters(unit);
    memcpy(unit->attitude.scale, unit->scale, ATTITUDE_SIZE * sizeof *unit->scale);
    memcpy(unit->orbit.scale, unit->scale + ORBIT_START, ORBIT_SIZE * sizeof *unit->scale);
    for (int i = ORBIT_SIZE; i < WIDTH; i++) unit->orbit.scale[i] = 1.0; /* places that are not used */
    unit->attitude.step = unit->orbit.step = 0.0;
    start_integrators(unit);
    unit->integrators_stale = unit->inputs_changing = false;
    return true;
}

static void unit_tune(Unit *unit)
{
    if (unit->initialised) return;
    take_parameters(unit);
    unit->integrators_stale = true;
}

/* ---- advancing ---- */

static inline const double *ramp_of(const Unit *unit) { return unit->ramping ? unit->attitude_ramp : NULL; }

/* Integrate the attitude until `elapsed` is reached or passed, free and under torques that depend on the place. */
static ALWAYS_INLINE double expand_free_attitude(
    Integrator *integrator, Row terms[TAYLOR_ORDER + 1], const void *context, double tolerance)
{
    return expand_products(integrator, terms, free_attitude_rates, free_attitude_products, ramp_of(context), context, tolerance);
}

static FLATTEN const char *advance_free_attitude(Unit *unit, double elapsed)
{
    return taylor_advance(&unit->attitude, expand_free_attitude, unit, unit->tolerance, elapsed, unit->inputs_changing);
}

#if TURNED_SERIES
/* One over the square of the quaternion's length. */
static double shrinking_of(const double *q) { return 1.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]); }

static inline void series_torque_at(const Unit *unit, double time, double torque[3])
{
    for (int i = 0; i < 3; i++) torque[i] = unit->series_torque[i] + unit->series_torque_rate[i] * time;
}

/* The place's series are cut earlier than the attitude's, so that they may be what bounds the step. */
static double expand_turned_attitude(Integrator *integrator, Row terms[TAYLOR_ORDER + 1], const void *context, double tolerance)
{
    const Unit *unit = context;
    const double shrinking = shrinking_of(integrator->state);
    double relative[WIDTH], torque[3];
    series_torque_at(unit, integrator->time, torque);
    const double *constants[] = {torque, unit->series_constants, &shrinking};
    Workspace work;
    begin_terms(integrator, terms, relative);
    turned_rates(terms, constants, &work);
    choose_unit(integrator, terms, relative);
    turned_terms(terms, integrator->unit, constants, ramp_of(unit), &work);
    const double reach = reach_of(terms, TAYLOR_ORDER, relative, tolerance);
    for (int i = 0; i < ORBIT_START; i++) relative[i] = 0.0;
    return is_within(terms, SLOW_ORDER, relative, tolerance, reach) ? reach
                                                                    : smaller(reach, reach_of(terms, SLOW_ORDER, relative, tolerance));
}

static WIDE FLATTEN const char *advance_turned_attitude(Unit *unit, double elapsed)
{
    return taylor_advance(&unit->attitude, expand_turned_attitude, unit, unit->tolerance, elapsed, unit->inputs_changing);
}
#else
static const char *advance_turned_attitude(Unit *unit, double elapsed)
{
    return dop853_advance(&unit->attitude, attitude_rates, unit, unit->tolerance, elapsed, unit->inputs_changing);
}
#endif

/* Advance the attitude and write its state at `elapsed`. */
static const char *run_attitude(Unit *unit, double elapsed)
{
    const bool is_free = attitude_is_free(unit);
    const char *failure = NULL;
    if (unit->attitude.time < elapsed)
        failure = (is_free ? advance_free_attitude : advance_turned_attitude)(unit, elapsed);
    if (failure) return failure;
    double *state = unit->values + AT_STATES;
    (is_free || TURNED_SERIES ? taylor_interpolate : dop853_interpolate)(&unit->attitude, elapsed, state, ATTITUDE_SIZE);
    if (attitude_is_series(unit)) {
        const double *arguments[] = {state, unit->series_constants};
        double found[ORBIT_START], *results[] = {found};
        target_from_series(arguments, results, NULL, NULL, 0);
        memcpy(state, found, sizeof found);
    }
    return NULL;
}

/* Advance the orbit and write its state at `elapsed`. */
static const char *run_orbit(Unit *unit, double elapsed)
{
    const char *failure = NULL;
    if (unit->orbit.time < elapsed)
        failure = dop853_advance(&unit->orbit, orbit_rates, unit, unit->tolerance, elapsed, unit->inputs_changing);
    if (!failure) dop853_interpolate(&unit->orbit, elapsed, unit->values + AT_STATES + ORBIT_START, ORBIT_SIZE);
    return failure;
}

static const char *run_integrators(Unit *unit, double elapsed)
{
    const char *failure = run_attitude(unit, elapsed);
    /* Both hold the target's place; the orbit's is the one to keep, so it is written last. */
    return failure ? failure : run_orbit(unit, elapsed);
}

/* Advance where an integration step is needed, which may fail. */
static const char *integrate(Unit *unit, double time)
{
    const Unit before = *unit;
    if (unit->integrators_stale) start_integrators(unit);
    unit->inputs_changing = unit->integrators_stale;
    const char *failure = run_integrators(unit, time - unit->started);
    if (failure) *unit = before;
    return failure;
}

static bool unit_advance(Unit *unit, double time, char message[MESSAGE_SIZE])
{
    const double elapsed = time - unit->started;
    if (unit->integrators_stale || unit->attitude.time < elapsed || unit->orbit.time < elapsed) {
        const char *failure = integrate(unit, time);
        if (failure) {
            snprintf(message, MESSAGE_SIZE, "integration from %.17g s to %.17g s failed: %s", unit->time, time, failure);
            return false;
        }
    } else {
        unit->inputs_changing = false;
        run_integrators(unit, elapsed);
    }
    unit->integrators_stale = false;
    unit->time = time;
    inputs_at(unit, time - unit->started, unit->values + AT_INPUTS);
    unit->outputs_current = unit->rates_current = false;
    return true;
}
